"""What is made of the controller node's parameters: settings, control law and controller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from pam_control.controller import Controller
from pam_control.declared import BY_SIZE, Declared, read_fields
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.pid import PidGains
from pam_control.kept_files import file_inside, kept_folder
from pam_control.laws.law import AnyLaw
from pam_control.laws.registry import laws
from pam_control.node_parameters import GAINS, declared_parameters
from pam_control.settings import ControlSettings
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.parameter_row import Parameter, Value

COMMAND_DELAY: Final = ControlSettings().command_delay
"""From the controller to the valve over topics [s]."""


def _parameter(each: Declared) -> Parameter:
    return Parameter(
        each.key, each.default, each.unit, each.lowest, each.high, each.description,
        changeable=not each.fixed,
    )  # fmt: skip


def parameter_table(
    joint_names: Sequence[str], command_delay: float = COMMAND_DELAY
) -> list[Parameter]:
    """All parameters of the node except those of the rig.

    Parameters
    ----------
    joint_names : sequence of str
        Names of the joints; each joint has its own gains.
    command_delay : float, optional
        Default of `loop.command_delay` [s].
    """
    table = [_parameter(each) for each in declared_parameters(joint_names)]
    return [
        replace(each, default=command_delay) if each.name == "loop.command_delay" else each
        for each in table
    ]


def law_from(values: Mapping[str, Value]) -> AnyLaw:
    """The control law that the parameters name, with its own ones.

    Parameters
    ----------
    values : mapping
        Every parameter of the table.

    Raises
    ------
    PamError
        For an unknown law, or a number that is neither within its bounds nor -1.
    """
    known, name = laws(), str(values["law"])
    if name not in known:
        names = list(known)
        raise PamError(f"law = {name!r}: must be {', '.join(names[:-1])} or {names[-1]}")
    return known[name](**read_fields(known[name], values))


def settings_from(values: Mapping[str, Value], joint_names: Sequence[str]) -> ControlSettings:
    """Settings from checked parameters; gains of -1 are designed later.

    Parameters
    ----------
    values : mapping
        Every parameter of the table.
    joint_names : sequence of str
        As for `parameter_table`.

    Raises
    ------
    PamError
        For a design range whose lower end is above its upper end, a stiffness test without
        anything that would learn from it, or a file outside of files.folder.
    """
    for each in declared_parameters(()):  # of other laws, too
        each.taken(values[each.key])
    _check_stiffness_test(values)
    kept_file(values, "adaptation.rig_file")
    fields = read_fields(ControlSettings, values)
    partial = {name: _given_gains(values, name) for name in joint_names}
    fields["gains"] = {
        name: GainSchedule.constant(
            PidGains(**given, derivative_filter=fields["derivative_filter"])
        )
        for name, given in partial.items()
        if len(given) == len(GAINS)
    }
    fields["partial_gains"] = {
        name: given for name, given in partial.items() if 0 < len(given) < len(GAINS)
    }
    fields["stiffness_grid"] = _stiffness_grid(values)
    fields["learning_file"] = str(kept_file(values, "learning.file") or "")
    return ControlSettings(**fields)


def _given_gains(values: Mapping[str, Value], joint: str) -> dict[str, float]:
    gains = {part: float(values[f"gains.{joint}.{part}"]) for part in GAINS}
    return {part: gain for part, gain in gains.items() if gain >= 0.0}


def _stiffness_grid(values: Mapping[str, Value]) -> tuple[float, ...]:
    low, high = (float(values[f"design.{end}_stiffness"]) for end in ("least", "greatest"))
    if (low == BY_SIZE) != (high == BY_SIZE):
        raise PamError(
            f"design.least_stiffness = {low:g} and design.greatest_stiffness = {high:g}: both must "
            "be given in N m/rad, or both be -1 for values that follow from the size of each joint"
        )
    if low > high:
        raise PamError(
            f"design.least_stiffness = {low:g} N m/rad must not be above "
            f"design.greatest_stiffness = {high:g} N m/rad"
        )
    return () if low == BY_SIZE else tuple(sorted({low, 0.5 * (low + high), high}))


def _check_stiffness_test(values: Mapping[str, Value]) -> None:
    law = laws().get(str(values["law"]))
    learns = values["adaptation.enabled"] and law is not None and law.has_adaptation
    if float(values["stiffness_test.amplitude"]) > 0.0 and not learns:
        raise PamError(
            "stiffness_test.amplitude: must be 0 unless law is model_based and adaptation.enabled "
            "is true, because only then a stiffness is estimated"
        )


def kept_file(values: Mapping[str, Value], key: str) -> Path | None:
    """The file that a parameter names; None for an empty name.

    Raises
    ------
    PamError
        If it is not inside of files.folder.
    """
    name = str(values[key])
    return file_inside(kept_folder(str(values["files.folder"])), name, key) if name else None


def create_controller(
    rig: Rig,
    values: Mapping[str, Value],
    joint_names: Sequence[str],
    designs: KeptDesigns | None = None,
) -> Controller:
    """Create the controller that the parameters describe.

    Parameters
    ----------
    rig : Rig
        The controlled rig.
    values : mapping
        Every parameter of the table.
    joint_names : sequence of str
        As for `parameter_table`.
    designs : KeptDesigns, optional
        Store of designed gains; by default in memory only.

    Raises
    ------
    PamError
        For an unknown law; ControlDesignError if the loop would not be safe.
    """
    return Controller(rig, settings_from(values, joint_names), designs, law_from(values))
