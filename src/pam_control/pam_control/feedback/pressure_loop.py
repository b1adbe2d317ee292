"""Pressure loop: from the desired pressure of a muscle to its valve's command.

For a flow valve, the desired dp/dt = feedforward + gain (reference - pressure) gives a mass flow
by the law of the polytropic chamber, m = (V dP/dt / exponent + P dV/dt)/(R T). The inverse of the
ISO 6358 flow gives the spool opening, and a lead compensator removes most of the spool's lag. For a
pressure regulator, the command is the reference itself within its limits.

Source: ISO 6358 and chamber as in the rig's nominal physics; the inversion is derived here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from pam_control.adaptation.flow_adaptation import FlowAdaptation, FlowSample
from pam_control.adaptation.tube_pressure import TubePressure
from pam_control.compensation.valve_inverse import ValveInverse
from pam_control.feedback.pressure_watch import PressureWatch
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.feedback.valve_lead import ValveLead
from pam_control.limited import limited
from pam_model.effects.slots import Leak
from pam_model.gas import (
    GAS_CONSTANT,
    flow_for_pressure_rate,
    opening_for_flow,
    reference_density,
    reference_flow,
)
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.robot import Robot, RobotMuscle
from pam_model.robot.static_force import gas_volume

LEAST_CAPACITY = 0.01  # of the full flow
TOLD_TUBE = 0.5
"""Part of the loss by the rig file that is used until the tube was seen to work: with twice the
true loss, the loop of the observed pressure is unstable, with half of it, it is a little slower."""
LENGTH_EDGE = 1e-6  # m, distance from the ends of the force model's range


@dataclass(slots=True)
class PressureDemand:
    """Input of the pressure loop of one muscle; all pressures are gauge pressures.

    Attributes
    ----------
    reference : float
        Desired pressure at the time of measurement [Pa].
    rate : float
        Feedforward of dp/dt for the time when the valve will act [Pa/s].
    ahead : float
        Change of the reference from the measurement until that time [Pa].
    length : float
        Muscle length at that time [m].
    length_rate : float
        dL/dt at that time [m/s].
    """

    reference: float
    rate: float
    ahead: float
    length: float
    length_rate: float


@dataclass(slots=True)
class PressureLoopSettings:
    """Gain, lead compensation and limit, the same for every muscle.

    Attributes
    ----------
    gain : float
        [1/s].
    lead_ratio : float
        Part of the valve's lag that is left uncompensated [-].
    spool_limit : float
        Largest spool command [-].
    adaptation : bool
        Whether to learn how the valve's flow differs from its data.
    acting_delay : float
        Time from a measurement until the command computed from it acts, as the rig file tells [s].
    """

    gain: float
    lead_ratio: float
    spool_limit: float = 1.0
    adaptation: bool = False
    acting_delay: float = 0.0


class PressureLoop(Protocol):
    """One muscle's valve command."""

    @property
    def gain_factor(self) -> float:
        """Share of the gain that is in use [-]."""
        ...

    @property
    def late(self) -> float:
        """By how much more than told the commands are late, as was learnt [s]."""
        ...

    @property
    def behind_tube(self) -> bool:
        """Whether the muscle was found to be behind a tube."""
        ...

    def reset(self) -> None:
        """Reset the state."""
        ...

    def forget_adaptation(self) -> None:
        """Forget what was learnt of the valve."""
        ...

    def inside(self, shown: float, step: float) -> float:
        """Pressure in the muscle, where the sensor is found to show another one.

        Parameters
        ----------
        shown : float
            Measured [Pa gauge].
        step : float
            Time since the last call [s].
        """
        ...

    def command(
        self, demand: PressureDemand, pressure: float, settings: PressureLoopSettings, step: float
    ) -> tuple[float, bool]:
        """The valve's command, and whether it was limited.

        Parameters
        ----------
        demand : PressureDemand
            Desired pressure and motion.
        pressure : float
            Measured gauge pressure [Pa].
        settings : PressureLoopSettings
            The present settings.
        step : float
            Time since the last call [s].
        """
        ...


class FlowValveLoop:
    """A proportional flow valve: spool -1 (exhaust) to 1 (supply).

    Parameters
    ----------
    robot : Robot
        Gives gas and supply.
    muscle : RobotMuscle
        Gives the valve.
    gas_space : JointMuscle
        Gives the gas volume.
    reservoir : SupplyReservoir
        From which all valves of the robot draw.
    """

    def __init__(
        self, robot: Robot, muscle: RobotMuscle, gas_space: JointMuscle, reservoir: SupplyReservoir
    ) -> None:
        self._reservoir = reservoir
        self._model = gas_space.model
        low, high = self._model.length_bounds
        self._lengths = (low + LENGTH_EDGE, high - LENGTH_EDGE)
        self._valve = muscle.valve
        self._watch = PressureWatch(muscle.max_pressure)
        self._inverse = ValveInverse.from_muscle(robot.rig.muscles[muscle.place])
        self._leaks = tuple((slot.law, values) for _, slot, values in muscle.laws(Leak))
        self._lead = ValveLead(muscle.valve.time_constant)
        self._dead_volume = gas_space.dead_volume
        self._ambient = robot.gas.ambient_pressure
        self._temperature = robot.gas.temperature
        self._density = reference_density(robot.gas.temperature)
        self._exponent = robot.gas.polytropic_exponent
        self._full = self._full_flow(True, self._ambient)
        turn = (muscle.place + 0.5) / len(robot.muscles)
        valve, loss = muscle.valve, 0.0
        if valve.tube is not None:
            loss = TOLD_TUBE * (valve.sonic_conductance / valve.tube.conductance) ** 2
        self.adaptation = FlowAdaptation(self._full, robot.supply.pressure, turn, loss)
        self._tube = TubePressure()
        self._flow = self._rate = self._shown = self._loss = 0.0

    def reset(self) -> None:
        """Reset the lead compensator, the watch and the observer of the tube."""
        if self._watch.factor < 1.0 and self.adaptation.tube.share == 0.0:
            self.adaptation.forget()
        self._lead.reset()
        self._watch.reset()
        self.adaptation.restart()
        self._tube.reset()
        self._flow = self._rate = self._shown = self._loss = 0.0

    def forget_adaptation(self) -> None:
        """Forget what was learnt of the valve."""
        self.adaptation.forget()

    def _full_flow(self, filling: bool, absolute: float) -> float:
        """Flow of the open valve into the muscle by its data [kg/s]."""
        valve = self._valve
        supply = self._reservoir.pressure
        first, second = (supply, absolute) if filling else (absolute, self._ambient)
        flow = self._density * reference_flow(
            valve.sonic_conductance, valve.critical_ratio, first, second
        )
        return flow if filling else -flow

    @property
    def gain_factor(self) -> float:
        """Share of the gain that is in use [-]; below 1 after chatter."""
        return self._watch.factor

    @property
    def late(self) -> float:
        """By how much more than told the commands are late, as was learnt [s]."""
        return self.adaptation.delay

    @property
    def behind_tube(self) -> bool:
        """Whether the muscle was found to be behind a tube."""
        return self.adaptation.tube.share > 0.0

    def inside(self, shown: float, step: float) -> float:
        """Pressure in the muscle [Pa gauge]; that of the sensor, unless a tube was found."""
        self._shown = shown
        tube = self.adaptation.tube
        if tube.share == 0.0:
            if self._loss != 0.0:
                self._loss = 0.0
                self._tube.reset()
            return shown
        self._loss = tube.share * tube.unit_loss(self._flow, max(shown, 0.0) + self._ambient)
        return self._tube.update(step, shown, self._loss, self._rate)

    def command(
        self, demand: PressureDemand, pressure: float, settings: PressureLoopSettings, step: float
    ) -> tuple[float, bool]:
        """Spool command, and whether the valve is too small for the desired pressure rate."""
        error = demand.reference - pressure
        before = self._watch.factor
        gain = settings.gain * self._watch.update(error, step)
        if self._watch.factor < before:
            # flows that change within a cycle or two tell nothing else
            self.adaptation.forget_flows()
        # chatter means that the sensor does not see the muscle: of use is only what tells why
        adapts = settings.adaptation and (
            self._watch.factor == 1.0 or self.adaptation.tube.share > 0.0
        )
        if adapts:
            # what is learnt corrects the feedforward; it must never raise the gain of the loop
            gain *= self.adaptation.least_share
        rate = demand.rate + gain * error
        absolute = max(pressure + demand.ahead + self._ambient, self._ambient)
        length = limited(demand.length, *self._lengths)
        gas = absolute - self._ambient
        volume, by_length, by_pressure = gas_volume(self._model, gas, length)
        # threads and cable that stretch take gas as a larger volume does
        volume += self._dead_volume + self._exponent * absolute * by_pressure
        volume_rate = by_length * demand.length_rate
        flow = flow_for_pressure_rate(
            rate,
            absolute,
            volume,
            volume_rate,
            temperature=self._temperature,
            exponent=self._exponent,
        )
        leaving = 0.0
        for law, values in self._leaks:
            leaving += self._density * law(
                absolute, self._ambient, self._valve.critical_ratio, *values
            )
        flow += leaving
        per_pressure = 1.0 / (GAS_CONSTANT * self._temperature)
        fills, capacity = flow >= 0.0, 1.0
        # the valve sees the pressure before the tube
        line = max(absolute + self._shown - pressure, self._ambient)
        full = self._full_flow(fills, line)
        into = flow - leaving
        if settings.adaptation:
            # none at the supply's pressure, or in an empty muscle
            capacity = max(abs(full), LEAST_CAPACITY * self._full)
        if adapts:
            moved = absolute * volume_rate * per_pressure
            flow = self.adaptation.corrected(flow, moved, capacity, absolute)
            if (flow >= 0.0) != fills:
                full = self._full_flow(not fills, line)
        opening = opening_for_flow(flow, full)
        limit = settings.spool_limit
        given = flow if abs(opening) < limit else limited(opening, -limit, limit) * abs(full)
        self._reservoir.draw(given)
        if self.behind_tube:
            late = step / (max(settings.acting_delay, 0.0) + step)
            self._flow += late * (into + given - flow - self._flow)
            moved = (pressure + self._ambient) * volume_rate
            self._rate = (self._flow / per_pressure - moved) * self._exponent / volume
        if settings.adaptation:
            shown = max(self._shown + self._ambient, self._ambient)
            sample = FlowSample(
                given - leaving,
                capacity,
                shown,
                self._loss,
                volume * per_pressure / self._exponent,
                shown * volume_rate * per_pressure,
                settings.acting_delay,
            )
            self.adaptation.learn(step, sample)
        opening = self._inverse.opening(opening)
        wanted = self._inverse.spool(limited(opening, -limit, limit))
        command = self._lead.command(wanted, settings.lead_ratio, step)
        return limited(command, -limit, limit), abs(opening) >= limit


class RegulatorLoop:
    """A pressure regulator, which closes its own loop; its command is in Pa gauge.

    Parameters
    ----------
    robot : Robot
        Its supply bounds the command.
    muscle : RobotMuscle
        Gives the valve and the maximum pressure.
    """

    def __init__(self, robot: Robot, muscle: RobotMuscle) -> None:
        full_scale = muscle.valve.full_scale or math.inf
        self._limit = min(full_scale, muscle.max_pressure, robot.supply_gauge_pressure)

    @property
    def gain_factor(self) -> float:
        """A regulator closes its own loop."""
        return 1.0

    @property
    def late(self) -> float:
        """A regulator closes its own loop; nothing is learnt of it."""
        return 0.0

    @property
    def behind_tube(self) -> bool:
        """A regulator closes its own loop; nothing is learnt of it."""
        return False

    def inside(self, shown: float, step: float) -> float:
        """A regulator closes its own loop; what its sensor shows is taken as it is."""
        return shown

    def reset(self) -> None:
        """There is no state to reset."""

    def forget_adaptation(self) -> None:
        """A regulator closes its own loop; nothing is learnt of it."""

    def command(
        self, demand: PressureDemand, pressure: float, settings: PressureLoopSettings, step: float
    ) -> tuple[float, bool]:
        """The reference at the time when the valve acts, and whether it was limited."""
        wanted = demand.reference + demand.ahead
        given = max(0.0, min(self._limit, wanted))
        return given, given != wanted


def create_pressure_loop(
    robot: Robot, muscle: RobotMuscle, gas_space: JointMuscle, reservoir: SupplyReservoir
) -> PressureLoop:
    """The loop for the muscle's kind of valve."""
    if muscle.valve.kind == "pressure_regulator":
        return RegulatorLoop(robot, muscle)
    return FlowValveLoop(robot, muscle, gas_space, reservoir)
