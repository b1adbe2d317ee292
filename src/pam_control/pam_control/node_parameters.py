"""All parameters of the controller's node as they are declared, without ROS.

Most of them are declared at the fields of `ControlSettings` and of the control laws. Those of the
node alone are declared here, and those of its action in `actions.goal_tolerances`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pam_control.actions.goal_tolerances import PARAMETERS, joint_tolerances
from pam_control.declared import BY_SIZE, Declared, declarations, share_of_stiffness
from pam_control.joint_scale import GRID_SHARES
from pam_control.laws.position_stiffness import PositionStiffness
from pam_control.laws.registry import laws, users
from pam_control.settings import ADAPTS, DESIGNED, ControlSettings

OF_NODE: Final = (
    Declared(
        "loop.realtime_priority", 0, "-", 0, 99,
        "priority of the control thread (SCHED_FIFO) if the system permits it; 0: normal",
        fixed=True,
    ),
    Declared(
        "loop.align", False, "-", 0, 0,
        "shift the cycles so that they begin shortly after pressure_states arrives", fixed=True,
    ),
    Declared(
        "telemetry.rate", 100.0, "Hz", 1.0, 2000.0,
        "rate of ~/reference, ~/error and ~/disturbance", fixed=True,
    ),
    Declared(
        "design.least_stiffness", BY_SIZE, "N m/rad", 0.01, 1e5,
        "lowest stiffness for which gains are designed and checked",
        by_size=share_of_stiffness(GRID_SHARES[0]),
    ),
    Declared(
        "design.greatest_stiffness", BY_SIZE, "N m/rad", 0.01, 1e5,
        "highest stiffness for which gains are designed and checked",
        by_size=share_of_stiffness(GRID_SHARES[-1]),
    ),
    Declared(
        "stiffness_test.amplitude", 0.0, "rad", 0.0, 0.2,
        "amplitude of a small motion of a joint that rests, by which its stiffness is estimated; "
        "0: none",
        laws=ADAPTS,
    ),
    Declared(
        "stiffness_test.frequency", 1.5, "Hz", 0.2, 2.0, "frequency of this motion", laws=ADAPTS
    ),
    Declared(
        "files.folder", "", "-", 0, 0,
        "folder of the files that adaptation.rig_file and learning.file name; empty: "
        "pam_control in $ROS_HOME or ~/.ros",
        fixed=True,
    ),
    Declared(
        "adaptation.rig_file", "", "-", 0, 0,
        "new rig file in files.folder that ~/save_adapted_rig writes, with what was learnt",
        laws=ADAPTS,
    ),
    Declared(
        "trajectory.max_points", 50_000, "-", 1, 1_000_000,
        "largest number of points of a trajectory; 50,000 are 100 s at 500 Hz",
    ),
)  # fmt: skip
GAINS: Final = {
    "proportional": "N m/rad",
    "integral": "N m/(rad s)",
    "derivative": "N m s/rad",
}


def _law() -> Declared:
    """The parameter that names the control law."""
    names = list(laws())
    text = f"control law: {', '.join(names[:-1])} or {names[-1]}"
    return Declared("law", PositionStiffness.name, "-", 0, 0, text, fixed=True)


def _gains(joint: str) -> list[Declared]:
    text = f"gain of {joint}; -1: designed"
    return [
        Declared(f"gains.{joint}.{part}", DESIGNED, unit, -1.0, 1e5, f"{part} {text}")
        for part, unit in GAINS.items()
    ]


def declared_parameters(joint_names: Sequence[str]) -> list[Declared]:
    """All parameters of the node except those of the rig, those of one group together.

    Parameters
    ----------
    joint_names : sequence of str
        Names of the joints; each joint has its own gains and tolerances.
    """
    found = [_law(), *OF_NODE]
    for owner in (ControlSettings, *laws().values()):
        found += [replace(each, laws=users(each)) for _, each in declarations(owner)]
    found += PARAMETERS
    for name in joint_names:
        found += [*joint_tolerances(name), *_gains(name)]
    once = {each.key: each for each in found}
    groups = list(dict.fromkeys(key.split(".")[0] for key in once))
    return sorted(once.values(), key=lambda each: groups.index(each.key.split(".")[0]))
