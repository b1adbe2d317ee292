"""Rigs with hidden effects, on which the controller with the nominal rig file is tried.

They have one effect of moderate size, a delay, or several effects at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from pam_check.blind.effect_cases import KNOWN, size_of
from pam_check.blind.hidden_size import HiddenSize
from pam_check.blind.truth_plant import TruthJoint
from pam_check.control.closed_loop import Muscles
from pam_model.errors import PamError

type HiddenRig = tuple[TruthJoint, Muscles]

NOTHING: Final = "nothing"
SEVERAL: Final = "several"
"""Stands for all rigs with several effects."""


def _late(commands: float = 0.0, encoder: float = 0.0, pressures: float = 0.0) -> HiddenSize:
    """Delays of the commands and of the encoder, and a lag of the pressure sensors [s]."""
    both = {"command_delay": commands, "pressure_lag": pressures}
    return HiddenSize("", muscles=(both, both), joint={"position_delay": encoder})


def _rubs(sliding: float, breakaway: float, speed: float) -> HiddenSize:
    """Dry friction that falls with speed [N m], [rad/s]."""
    joint = {"coulomb_torque": sliding, "static_torque": breakaway, "stribeck_speed": speed}
    return HiddenSize("", joint=joint)


WRONG_DIMENSIONS: Final = HiddenSize("", scaled_joint={"pulley_radius": 1.02})
DELAYS: Final[Mapping[str, tuple[HiddenSize, ...]]] = {
    **{f"commands {d} ms": (_late(commands=1e-3 * d),) for d in (10, 15, 20, 25, 30)},
    **{f"encoder {d} ms": (_late(encoder=1e-3 * d),) for d in (10, 15, 20, 25, 30)},
    **{f"pressures {d} ms": (_late(pressures=1e-3 * d),) for d in (10, 20, 30)},
}
COMBINED: Final[Mapping[str, tuple[HiddenSize, ...]]] = {
    "hysteresis, commands 19 ms": (size_of("hysteresis"), _late(commands=0.019)),
    "hysteresis, encoder 19 ms": (size_of("hysteresis"), _late(encoder=0.019)),
    "hysteresis, dry friction, commands 10 ms, radius 2 %": (
        size_of("hysteresis"), _rubs(0.3, 0.3, 0.1), _late(commands=0.01), WRONG_DIMENSIONS,
    ),
    "tube, dry friction": (size_of("tube_restriction"), size_of("coulomb_friction")),
    "tube, falling friction": (size_of("tube_restriction"), size_of("stribeck_friction")),
    "tube, hysteresis": (size_of("tube_restriction"), size_of("hysteresis")),
    "dry friction, commands 15 ms": (size_of("coulomb_friction"), _late(commands=0.015)),
    "falling friction 0.25 and 0.5 N m": (_rubs(0.25, 0.5, 0.1),),
    "falling friction 0.4 and 0.8 N m, slow": (_rubs(0.4, 0.8, 0.05),),
    "load, commands 15 ms": (size_of("payload"), _late(commands=0.015)),
    "load, dry friction": (size_of("payload"), size_of("coulomb_friction")),
    "dead zone, dry friction": (size_of("valve_dead_zone"), size_of("coulomb_friction")),
}  # fmt: skip


def names() -> list[str]:
    """Of all rigs."""
    return [NOTHING, *KNOWN, *DELAYS, *COMBINED]


def hidden_rig(true: HiddenRig, name: str) -> HiddenRig:
    """A true rig with what is hidden in the one of this name."""
    sizes = DELAYS.get(name) or COMBINED.get(name) or ()
    for size in sizes or [size_of(effect) for effect in (name,) if effect != NOTHING]:
        true = size.applied(*true)
    return true


def chosen_rigs(option: str, given: Sequence[str] | None, default: Sequence[str]) -> list[str]:
    """The rigs that a command names, or its default.

    Raises
    ------
    PamError
        For an unknown name.
    """
    chosen: list[str] = []
    for name in given or default:
        if name == SEVERAL:
            chosen += COMBINED
        elif name in names():
            chosen.append(name)
        else:
            known = ", ".join(names())
            raise PamError(f"{option} {name}: unknown; expected some of {known}, or {SEVERAL}")
    return chosen
