"""The size at which each effect is hidden from the controller, and why this size.

A size is moderate: near the middle of what the blind check draws (`pam_check.blind.draw`), so that
a rig with it is a rig that people have, and its owner does not know of it. The reasons say what the
size means on the elbow of config/.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from pam_check.blind.truth_plant import TruthJoint, TruthMuscle


@dataclass(frozen=True, slots=True)
class HiddenSize:
    """One hidden effect.

    Attributes
    ----------
    reason : str
        Why this size.
    muscles : tuple of mapping
        Changed fields of the agonist and of the antagonist.
    joint : mapping
        Changed fields of the joint.
    added_to_muscles, added_to_joint : mapping
        What is added to fields of both muscles, and of the joint.
    scaled_joint : mapping
        Factors of fields of the joint.
    """

    reason: str
    muscles: tuple[Mapping[str, float], Mapping[str, float]] = ({}, {})
    joint: Mapping[str, float] = field(default_factory=dict)
    added_to_muscles: Mapping[str, float] = field(default_factory=dict)
    added_to_joint: Mapping[str, float] = field(default_factory=dict)
    scaled_joint: Mapping[str, float] = field(default_factory=dict)

    def applied(
        self, joint: TruthJoint, muscles: tuple[TruthMuscle, TruthMuscle]
    ) -> tuple[TruthJoint, tuple[TruthMuscle, TruthMuscle]]:
        """The rig with the hidden effect."""
        changed = {
            **self.joint,
            **{name: getattr(joint, name) + more for name, more in self.added_to_joint.items()},
            **{name: getattr(joint, name) * by for name, by in self.scaled_joint.items()},
        }
        first, second = (
            muscle._replace(**{**own, **{n: getattr(muscle, n) + more for n, more in both.items()}})
            for muscle, own, both in zip(
                muscles, self.muscles, (self.added_to_muscles,) * 2, strict=True
            )
        )
        return joint._replace(**changed), (first, second)


def _both(reason: str, **values: float) -> HiddenSize:
    return HiddenSize(reason, muscles=(values, values))


def _agonist(reason: str, **values: float) -> HiddenSize:
    return HiddenSize(reason, muscles=(values, {}))


CLEAN: Final = HiddenSize("nothing is hidden; the rig is its rig file")

HIDDEN: Final[Mapping[str, HiddenSize]] = {
    "valve_dead_zone": _both("an overlap of 6 % of the stroke is usual", dead_zone=0.06),
    "valve_null_offset": _agonist("a valve that was not adjusted, 3 % open", null_offset=0.03),
    "valve_lag": _both("a second pole of 20 ms, four times the stated lag", second_pole=0.02),
    "exhaust_restriction": _both("a silencer takes 40 % of the flow", exhaust_ratio=0.6),
    "supply_droop": HiddenSize(
        "a 0.6 l reservoir behind a thin hose",
        joint={"reservoir_volume": 6e-4, "reservoir_conductance": 2.5e-10},
    ),
    "tube_restriction": _both(
        "a metre of narrow tube between valve and muscle", tube_volume=6e-6, tube_conductance=3e-9
    ),
    "command_delay": _both("a bus cycle of 20 ms that nobody stated", command_delay=0.019),
    "leakage": _both("hisses audibly: 2 % of the valve", leak=7e-11),
    "dead_volume": HiddenSize("fittings of 30 ml more", added_to_muscles={"dead_volume": 3e-5}),
    "thermal": _both("between isothermal and adiabatic at 1 Hz", heat_transfer=0.3),
    "hysteresis": _both(
        "six per cent of the muscle's force, dry threads", thread_friction=0.006, play_length=1e-3
    ),
    "creep": _both("a tenth of the joint's stiffness", creep_stiffness=550.0, creep_order=0.25),
    "bladder_elasticity": _both(
        "1.5 mm of rubber of 1 MPa", bladder_volume=1.4e-5, bladder_modulus=1e6
    ),
    "end_caps": _both("contraction is 12 % more than a cylinder's", end_factor=1.12),
    "braid_extensibility": _both("nylon threads, 1 % at 4 bar", thread_compliance=1.8e-5),
    "cable_compliance": _both("a Dyneema cable with knots, 125 N/mm", cable_compliance=8e-6),
    "coulomb_friction": HiddenSize(
        "a tenth of the torque that holds the limb level",
        joint={"coulomb_torque": 0.55, "static_torque": 0.55},
    ),
    "stribeck_friction": HiddenSize(
        "breaks away at twice the friction of the moving joint",
        joint={"coulomb_torque": 0.42, "static_torque": 0.84, "stribeck_speed": 0.1},
    ),
    "viscous_friction": HiddenSize(
        "2.4 times the stated damping, as of stiff grease",
        added_to_joint={"viscous_friction": 0.35},
    ),
    "payload": HiddenSize(
        "0.8 kg at 0.21 m in the hand",
        added_to_joint={"gravity_torque": 0.8 * 9.81 * 0.21, "inertia": 0.8 * 0.21**2},
    ),
    "pulley_radius": HiddenSize(
        "10 % more, a cable that lies higher", scaled_joint={"pulley_radius": 1.1}
    ),
    "position_offset": HiddenSize(
        "an encoder put on by eye, 2.6 degrees", joint={"position_offset": 0.045}
    ),
    "position_delay": HiddenSize(
        "an encoder read over a slow bus", joint={"position_delay": 0.018}
    ),
    "pressure_gain": _agonist("a sensor of another range, 7 % off", pressure_gain=1.07),
    "pressure_bias": _agonist("a zero that drifted by 10 kPa", pressure_bias=1e4),
    "pressure_lag": _both("a filter of 6 Hz in the sensor", pressure_lag=0.026),
}
"""By effect, in the order of the table of effects."""
