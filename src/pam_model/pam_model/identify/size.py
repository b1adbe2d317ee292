"""Sizes an antagonistic joint: from torque, range, speed and pressure to pulley, muscle and valve.

Sources: the braid by equations (1), (2), (6) and (15)-(19) of "A Review of Design and Modeling of
Pneumatic Artificial Muscle" (`pam_model.identify.design`); the flow by ISO 6358-1. The pull that is
needed is that of the shortest muscle, with the other one empty. The valve must supply the gas for
the change of volume and of pressure while the joint crosses its range at full speed.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from pam_model.errors import PamError
from pam_model.gas.constants import GAS_CONSTANT, REFERENCE_TEMPERATURE
from pam_model.gas.flow import mass_flow, reference_flow
from pam_model.identify.design import MuscleDesign, design
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig.from_datasheet import BraidFromDatasheet
from pam_model.rig.new_rig import NewRig
from pam_model.rig.types import Rig

CONTRACTION = 0.2  # of the rest length over the whole range
MARGIN = 1.3  # on the torque: thread friction and the wall cost 10 to 30 % of an ideal braid's pull
FILLED = 5.0 / 6.0  # of the supply (gauge), the pressure up to which the valve fills at full speed
FRICTION_TIME = 0.02  # s/rad, viscous friction for each N m of torque
AMBIENT = 101_325.0  # Pa
CRITICAL_RATIO = 0.3  # ISO 6358 b of a usual valve
CATALOGUE = (7e5, 6e5)
"""Absolute pressures at which catalogues state a valve's nominal flow: 6 to 5 bar gauge [Pa]."""
POINTS = 41


@dataclass(frozen=True, slots=True)
class JointSize:
    """A joint that meets the requirements."""

    torque: float  # wanted at every angle [N m]
    pulley_radius: float  # [m]
    muscle: MuscleDesign  # each of the two muscles
    peak_flow: float  # largest mass flow that a valve has to pass [kg/s]
    # C of a valve that passes it, into the muscle and out of it [m^3/(s Pa)]
    sonic_conductance: float
    nominal_flow: float  # the same as catalogues state it, from 6 to 5 bar gauge [l/min ANR]
    supply_pressure: float  # for which the valve is sized [Pa gauge]

    @property
    def braid(self) -> BraidFromDatasheet:
        """The muscle as the rig file needs it."""
        made = self.muscle
        return BraidFromDatasheet(made.thread_length, made.turns, made.rest_length)

    def table(self) -> str:
        """The joint as text."""
        return "\n".join(
            [
                f"pulley           {1e3 * self.pulley_radius:.1f} mm radius",
                self.muscle.table(),
                f"valve            C = {self.sonic_conductance:.2e} m^3/(s Pa), in catalogues "
                f"{self.nominal_flow:.0f} l/min from 6 to 5 bar; peak {1e3 * self.peak_flow:.3g} "
                "g/s",
            ]
        )

    def as_dict(self) -> dict[str, object]:
        """Plain values for JSON."""
        return {**asdict(self), "muscle": self.muscle.as_dict()}


def size_joint(
    torque: float,
    largest_angle: float,
    speed: float,
    pressure: float,
    muscle_length: float,
    supply_pressure: float | None = None,
) -> JointSize:
    """Size a joint with two equal muscles.

    Parameters
    ----------
    torque : float
        Wanted at every angle of the range, in both directions [N m].
    largest_angle : float
        The joint turns from minus this angle to this angle [rad].
    speed : float
        With which it shall cross the range [rad/s].
    pressure : float
        Largest pressure of the muscles [Pa gauge].
    muscle_length : float
        Room for a muscle, at rest [m]. Longer muscles allow a larger pulley and are thinner.
    supply_pressure : float, optional
        [Pa gauge]; by default the largest pressure of the muscles, so that a valve that is stuck
        open cannot burst them.

    Raises
    ------
    DomainError
        If no such muscle can be built.
    PamError
        If the supply is below the largest pressure of the muscles.
    """
    supply_pressure = pressure if supply_pressure is None else supply_pressure
    if supply_pressure < pressure:
        raise PamError(
            f"the supply of {supply_pressure:g} Pa gauge is below the largest pressure of the "
            f"muscles, {pressure:g} Pa gauge; expected at least as much"
        )
    stroke = CONTRACTION * muscle_length
    radius = stroke / (2.0 * largest_angle)
    muscle = design(MARGIN * torque / radius, stroke, pressure, contraction=CONTRACTION)
    lengths = np.linspace(muscle.end_length, muscle.rest_length, POINTS)
    turns = 4.0 * np.pi * muscle.turns**2
    thread = muscle.thread_length**2
    volumes = lengths * (thread - lengths**2) / turns
    slopes = np.abs(thread - 3.0 * lengths**2) / turns
    # the muscle shortens and fills: P dV/dt + V dP/dt, both with the joint at full speed
    rate = pressure * speed / (2.0 * largest_angle)
    energy = (pressure + AMBIENT) * slopes * radius * speed + volumes * rate
    peak = float(energy.max()) / (GAS_CONSTANT * REFERENCE_TEMPERATURE)
    full = min(pressure, FILLED * supply_pressure) + AMBIENT
    supply = supply_pressure + AMBIENT
    # filling is slowest when the muscle is nearly full, emptying at half the pressure
    half = 0.5 * pressure + AMBIENT
    per_conductance = min(
        mass_flow(1.0, CRITICAL_RATIO, supply, full), mass_flow(1.0, CRITICAL_RATIO, half, AMBIENT)
    )
    conductance = peak / float(per_conductance)
    nominal = 60e3 * reference_flow(conductance, CRITICAL_RATIO, *CATALOGUE)
    return JointSize(torque, radius, muscle, peak, conductance, nominal, supply_pressure)


def sized_rig(size: JointSize, largest_angle: float, pressure: float, inertia: float) -> NewRig:
    """A rig with one such joint, for the simulation and for a rig file.

    Parameters
    ----------
    size : JointSize
        From `size_joint`.
    largest_angle, pressure : float
        As for `size_joint`.
    inertia : float
        About the joint [kg m^2].
    """
    return NewRig(
        joints=("joint",),
        buses=("can0",),
        braid=size.braid,
        pulley_radius=size.pulley_radius,
        largest_angle=largest_angle,
        inertia=inertia,
        gravity_torque=0.0,
        viscous_friction=FRICTION_TIME * size.torque,
        max_pressure=pressure,
        supply_pressure=size.supply_pressure,
        valve="flow",
        sonic_conductance=size.sonic_conductance,
    )


def torque_and_stiffness(rig: Rig, pressure: float) -> dict[str, list[float]]:
    """Largest torques and stiffness range over the angle.

    Parameters
    ----------
    rig : Rig
        With one joint.
    pressure : float
        Largest pressure [Pa gauge].

    Returns
    -------
    dict of str to list of float
        `angle` [rad], `highest_torque` and `lowest_torque` [N m], `least_stiffness` and
        `greatest_stiffness` [N m/rad] without torque.
    """
    joint = rig.joints[0]
    model = JointStatics.from_rig(rig, joint.name)
    lower, upper = joint.position_limits
    found: dict[str, list[float]] = {
        name: []
        for name in (
            "angle", "highest_torque", "lowest_torque", "least_stiffness", "greatest_stiffness",
        )
    }  # fmt: skip
    for angle in np.linspace(lower, upper, POINTS):
        position = float(angle)
        low, high = (model.pressures_for(0.0, k, position).stiffness for k in (0.0, 1e9))
        for name, value in zip(
            found,
            (position, model.torque((pressure, 0.0), position),
             model.torque((0.0, pressure), position), low, high),
            strict=True,
        ):  # fmt: skip
            found[name].append(float(value))
    if not all(np.isfinite(values).all() for values in found.values()):
        raise PamError("the muscles leave the range of their model within the range of the joint")
    return found
