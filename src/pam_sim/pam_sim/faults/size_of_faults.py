"""The sizes of faults on a rig: their ranges are written for the elbow of config/.

A hole that bursts a muscle of 150 ml is no leak of one of 30 ml, and a brake for a knee would not
be felt by a crane. A burst is therefore measured by the valve, a leak by what the driver's observer
of the gas can notice, what a pressure sensor shows by the highest pressure of its muscle, and what
a brake holds by the torque of a muscle at that pressure.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pam_driver.safety.limits_by_size import pressure_residual
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.pressure_rate import filling_rate
from pam_model.views.torque_balance import torque_scale

Ranges = Mapping[str, tuple[float, float]]
"""Of each number of a fault, from which values are drawn."""
_CONDUCTANCE: Final = 4e-9  # m^3/(s Pa), of the elbow's valves
_PRESSURE: Final = 6e5  # Pa gauge, its highest
_NOTICED: Final = 0.05442  # s, its limit of a deviation over the rate at which its valve fills
_LEAKS: Final = ("muscle_leak", "muscle_leak_small")
_TORQUE: Final = 31.523  # N m, of one of its muscles at this pressure and joint position 0
_OF_PRESSURE: Final = frozenset(
    {
        ("pressure_noisy", "amplitude"),
        ("pressure_noisier", "amplitude"),
        ("pressure_too_high", "shown"),
        ("pressure_drift", "rate"),
        ("pressure_offset", "by"),
    }
)


def ranges_on(fault: str, ranges: Ranges, rig: Rig) -> Ranges:
    """The ranges of a fault's numbers on a rig.

    Parameters
    ----------
    fault : str
        Its name.
    ranges : mapping of str to (low, high)
        Its ranges on the elbow.
    rig : Rig
        Its smallest leak or valve, its highest pressure and its strongest joint decide.
    """
    return {
        name: (low * size, high * size)
        for name, (low, high) in ranges.items()
        for size in (_size(fault, name, rig),)
    }


def _size(kind: str, parameter: str, rig: Rig) -> float:
    """The size of a number of a fault on this rig over that on the elbow."""
    if parameter == "conductance":
        robot = compose(rig)
        sizes = [
            muscle.valve.sonic_conductance
            * (
                pressure_residual(robot, muscle) / filling_rate(robot, muscle) / _NOTICED
                if kind in _LEAKS
                else 1.0
            )
            for muscle in robot.muscles
        ]
        return min(sizes) / _CONDUCTANCE
    if (kind, parameter) in _OF_PRESSURE:
        return max(muscle.max_pressure for muscle in rig.muscles) / _PRESSURE
    if parameter == "torque":
        robot = compose(rig)
        torques = (torque_scale(robot, joint) for joint in robot.joints)
        return max(torques, default=_TORQUE) / _TORQUE
    return 1.0
