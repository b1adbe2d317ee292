"""Pressure loops: from the desired pressure of each muscle to its valve's command.

For a flow valve, the desired dp/dt = feedforward + gain (reference - pressure) gives a mass flow
by the law of the polytropic chamber, m = (V dP/dt / exponent + P dV/dt)/(R T). The inverse of the
ISO 6358 flow gives the spool opening, and a lead compensator removes most of the spool's lag. For a
pressure regulator, the command is the reference itself within its limits.

One compiled function computes the commands of all muscles; its rows are in `loop_rows`.

Source: ISO 6358 and chamber as in the rig's nominal physics; the inversion is derived here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from pam_control.adaptation.flow_adaptation import (
    EVERY,
    FlowAdaptation,
    corrected_flow,
    forget_weights,
    least_share,
    take_flow,
    unit_loss,
)
from pam_control.adaptation.tube_pressure import pressure_behind_tube
from pam_control.feedback.pressure_watch import LEAST_SHARE, begin_watch, watch_pressure
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.feedback.valve_lead import lead_command
from pam_control.joint_models import JointModels
from pam_control.limited import limited
from pam_control.rows.loop_rows import (
    D_AHEAD,
    D_BY_LENGTH,
    D_BY_PRESSURE,
    D_POSITION,
    D_PRESSURE,
    D_RATE,
    D_REFERENCE,
    D_SPEED,
    D_VOLUME,
    G_ACTS,
    G_ADAPTS,
    G_GAIN,
    G_LEAD_RATIO,
    G_SPOOL_LIMIT,
    N_CONDUCTANCE,
    N_CRITICAL,
    N_DEAD,
    N_DEMAND,
    N_FULL,
    N_IN_CLOSED_FORM,
    N_LAG,
    N_LONGEST,
    N_MOST,
    N_NUMBERS,
    N_REGULATED,
    N_SETTINGS,
    N_SHORTEST,
    N_SIGN,
    N_STATE,
    N_THRESHOLD,
    V_CHATTERED,
    V_DELAY,
    V_FACTOR,
    V_FLOW,
    V_INSIDE,
    V_LAGGED,
    V_LOSS,
    V_RATE,
    V_SHOWN,
    V_SINCE,
    V_TUBE,
)
from pam_control.rows.muscle_table import O_JOINT, O_NUMBERS, MuscleTable
from pam_control.settings import ControlSettings
from pam_model.gas import GAS_CONSTANT, flow_for_pressure_rate, opening_for_flow, reference_flow
from pam_model.physics.joint_geometry import length_per_position, muscle_length
from pam_model.plant.compiled import entry_point, for_kernel, prepare
from pam_model.plant.composition import leak
from pam_model.plant.control_laws import flow_opening, inverse_row, spool_position
from pam_model.plant.layout import (
    C_AMBIENT,
    C_DENSITY,
    C_EXPONENT,
    C_RADIUS,
    C_TEMPERATURE,
    M_NEUTRAL,
)
from pam_model.plant.muscle_stage import gas_volume as closed_gas_volume
from pam_model.robot import Robot, RobotMuscle
from pam_model.robot.static_force import gas_volume
from pam_model.views.joint_numbers import is_closed_form

LEAST_CAPACITY: Final = 0.01  # of the full flow
TOLD_TUBE: Final = 0.5
"""Part of the loss by the rig file that is used until the tube was seen to work: with twice the
true loss, the loop of the observed pressure is unstable, with half of it, it is a little slower."""
LENGTH_EDGE: Final = 1e-6  # m, distance from the ends of the force model's range


def full_flow(c: Any, n: Any, supply: float, fills: bool, absolute: float) -> float:
    """Flow of the open valve into the muscle by its data [kg/s]."""
    if fills:
        return float(
            c[C_DENSITY] * reference_flow(n[N_CONDUCTANCE], n[N_CRITICAL], supply, absolute)
        )
    return float(
        -c[C_DENSITY] * reference_flow(n[N_CONDUCTANCE], n[N_CRITICAL], absolute, c[C_AMBIENT])
    )


def true_pressure(c: Any, n: Any, v: Any, shown: float, step: float) -> float:
    """Pressure in the muscle [Pa gauge]; that of the sensor, unless a tube was found."""
    v[V_SHOWN] = shown
    if v[V_TUBE] == 0.0:
        if v[V_LOSS] != 0.0:
            v[V_LOSS] = 0.0
            v[V_INSIDE] = math.nan
        return shown
    v[V_LOSS] = v[V_TUBE] * unit_loss(n, v[V_FLOW], max(shown, 0.0) + c[C_AMBIENT])
    return pressure_behind_tube(v, step, shown, v[V_LOSS], v[V_RATE])


def gas_space(
    m: int, c: Any, n: Any, d: Any, table: Any, pressure: float, length: float
) -> tuple[float, float, float]:
    """Gas volume with dead volume [m^3], and its derivatives by length and pressure."""
    if n[N_IN_CLOSED_FORM] > 0.0:
        return closed_gas_volume(m, c, table, pressure, length)
    return d[D_VOLUME] + n[N_DEAD], d[D_BY_LENGTH], d[D_BY_PRESSURE]


def flow_valve(
    m: int, c: Any, n: Any, e: Any, g: Any, v: Any, d: Any, table: Any,
    supply: float, age: float, step: float,
) -> tuple[float, bool, float]:  # fmt: skip
    """Command of a flow valve.

    Parameters
    ----------
    m : int
        Where the constants of the muscle begin in those of its joint.
    c, n, e, g, v, d : rows
        Constants of the joint, numbers of the loop, inverses of the valve, settings, state and
        demand.
    table : rows
        Any rows; a muscle in closed form needs none.
    supply, age, step : float
        Pressure before the valve [Pa absolute], age of the measured pressures and time since the
        last call [s].

    Returns
    -------
    command : float
        Spool -1 (exhaust) to 1 (supply) [-].
    cut : bool
        Whether the valve is too small for the desired pressure rate.
    drawn : float
        Flow that the valve is asked for [kg/s].
    """
    ambient, acting_delay = c[C_AMBIENT], g[G_ACTS] + age
    pressure, shown = d[D_PRESSURE], v[V_SHOWN]
    error = d[D_REFERENCE] - pressure
    before = v[V_FACTOR]
    gain = g[G_GAIN] * watch_pressure(n, v, error, step)
    if v[V_FACTOR] < before:
        # flows that change within a cycle or two tell nothing else
        forget_weights(v)
        v[V_CHATTERED] = 1.0
    # chatter means that the sensor does not see the muscle: of use is only what tells why
    learns = g[G_ADAPTS] > 0.0
    adapts = learns and (v[V_FACTOR] == 1.0 or v[V_TUBE] > 0.0)
    if adapts:
        # what is learnt corrects the feedforward; it must never raise the gain of the loop
        gain *= least_share(v)
    rate = d[D_RATE] + gain * error
    absolute = max(pressure + d[D_AHEAD] + ambient, ambient)
    length = muscle_length(c[m + M_NEUTRAL], n[N_SIGN], c[C_RADIUS], d[D_POSITION])
    length = limited(length, n[N_SHORTEST], n[N_LONGEST])
    volume, by_length, by_pressure = gas_space(m, c, n, d, table, absolute - ambient, length)
    # threads and cable that stretch take gas as a larger volume does
    volume += c[C_EXPONENT] * absolute * by_pressure
    volume_rate = by_length * length_per_position(n[N_SIGN], c[C_RADIUS]) * d[D_SPEED]
    into = flow_for_pressure_rate(
        rate, absolute, volume, volume_rate, temperature=c[C_TEMPERATURE], exponent=c[C_EXPONENT]
    )
    leaving = c[C_DENSITY] * leak(m, c, absolute)
    flow = into + leaving
    per_pressure = 1.0 / (GAS_CONSTANT * c[C_TEMPERATURE])
    fills, capacity = flow >= 0.0, 1.0
    # the valve sees the pressure before the tube
    line = max(absolute + shown - pressure, ambient)
    full = full_flow(c, n, supply, fills, line)
    if learns:
        # none at the supply's pressure, or in an empty muscle
        capacity = max(abs(full), LEAST_CAPACITY * n[N_FULL])
    into = flow - leaving
    if adapts:
        moved = absolute * volume_rate * per_pressure
        flow = corrected_flow(n, v, flow, moved, capacity, absolute)
        if (flow >= 0.0) != fills:
            full = full_flow(c, n, supply, not fills, line)
    opening = opening_for_flow(flow, full)
    limit = g[G_SPOOL_LIMIT]
    given = flow if abs(opening) < limit else limited(opening, -limit, limit) * abs(full)
    if v[V_TUBE] > 0.0:
        late = step / (max(acting_delay, 0.0) + step)
        v[V_FLOW] += late * (into + given - flow - v[V_FLOW])
        moved = (pressure + ambient) * volume_rate
        v[V_RATE] = (v[V_FLOW] / per_pressure - moved) * c[C_EXPONENT] / volume
    if learns:
        seen = max(shown + ambient, ambient)
        take_flow(
            n, v, step, given - leaving, capacity, seen, v[V_LOSS],
            volume * per_pressure / c[C_EXPONENT], seen * volume_rate * per_pressure, acting_delay,
        )  # fmt: skip
    opening = flow_opening(e, opening)
    wanted = spool_position(e, limited(opening, -limit, limit))
    command = lead_command(n, v, wanted, g[G_LEAD_RATIO], step)
    return limited(command, -limit, limit), abs(opening) >= limit, given


def regulator(n: Any, d: Any) -> tuple[float, bool]:
    """Command of a pressure regulator [Pa gauge]: the reference when the valve acts, if it can."""
    wanted = d[D_REFERENCE] + d[D_AHEAD]
    given = max(0.0, min(n[N_MOST], wanted))
    return given, given != wanted


@entry_point
def true_pressures(owners: Any, c: Any, n: Any, v: Any, d: Any, shown: Any, step: float) -> None:
    """Write the pressure in every muscle to `D_PRESSURE`, from those that the sensors show [Pa]."""
    for k in range(len(n)):
        if n[k][N_REGULATED] > 0.0:
            d[k][D_PRESSURE] = shown[k]
        else:
            d[k][D_PRESSURE] = true_pressure(c[owners[k][O_JOINT]], n[k], v[k], shown[k], step)


@entry_point
def command_valves(
    owners: Any, c: Any, n: Any, e: Any, g: Any, v: Any, d: Any,
    supply: float, age: float, step: float, commands: Any, cut: Any,
) -> tuple[float, bool]:  # fmt: skip
    """Write the command of every valve, and whether it was limited.

    Returns
    -------
    drawn : float
        Flow that all valves together take from the supply [kg/s].
    is_due : bool
        Whether a fit has to be updated or forgotten.
    """
    drawn, is_due = 0.0, False
    for k in range(len(n)):
        if n[k][N_REGULATED] > 0.0:
            commands[k], is_cut = regulator(n[k], d[k])
        else:
            i, m = owners[k][O_JOINT], owners[k][O_NUMBERS]
            commands[k], is_cut, flow = flow_valve(
                m, c[i], n[k], e[k], g[i], v[k], d[k], c, supply, age, step
            )
            drawn += max(flow, 0.0)
            is_due = is_due or v[k][V_SINCE] >= EVERY or v[k][V_CHATTERED] > 0.0
        cut[k] = 1.0 if is_cut else 0.0
    return drawn, is_due


class MuscleLoop:
    """What others may see and change of the pressure loop of one muscle.

    Attributes
    ----------
    adaptation : FlowAdaptation or None
        What is learnt of a flow valve; a regulator closes its own loop.
    """

    def __init__(self, v: Any, adaptation: FlowAdaptation | None) -> None:
        self._v, self.adaptation = v, adaptation
        self._rest()

    def _rest(self) -> None:
        begin_watch(self._v)
        self._v[V_LAGGED] = self._v[V_INSIDE] = math.nan
        for place in (V_FLOW, V_RATE, V_SHOWN, V_LOSS, V_CHATTERED):
            self._v[place] = 0.0

    @property
    def gain_factor(self) -> float:
        """Share of the gain that is in use [-]; below 1 after chatter."""
        return float(self._v[V_FACTOR])

    @property
    def late(self) -> float:
        """By how much more than told the commands are late, as was learnt [s]."""
        return float(self._v[V_DELAY])

    @property
    def behind_tube(self) -> bool:
        """Whether the muscle was found to be behind a tube."""
        return bool(self._v[V_TUBE] > 0.0)

    def reset(self) -> None:
        """Reset the lead compensator, the watch and the observer of the tube."""
        if self.adaptation is not None:
            if self.gain_factor < 1.0 and not self.behind_tube:
                self.adaptation.forget()
            self.adaptation.restart()
        self._rest()

    def forget_adaptation(self) -> None:
        """Forget what was learnt of the valve."""
        if self.adaptation is not None:
            self.adaptation.forget()

    def update(self) -> None:
        """Learn what is due."""
        if self.adaptation is None:
            return
        if self._v[V_CHATTERED] > 0.0:
            self._v[V_CHATTERED] = 0.0
            self.adaptation.forget_flows()
        if self._v[V_SINCE] >= EVERY:
            self.adaptation.update()


class PressureLoops:
    """The pressure loops of all muscles.

    Parameters
    ----------
    robot : Robot
        Gives gas, supply, valves and the constants of its joints.
    joints : sequence of JointModels
        The models of all joints.
    table : MuscleTable
        The muscle of each row, and its joint.
    reservoir : SupplyReservoir
        From which all valves of the robot draw.
    numbers : rows
        Of `pam_model.views.joint_numbers`.

    Attributes
    ----------
    loops : list of MuscleLoop
        One for each row.
    state, demands : rows
        `loop_rows.V_FACTOR` and its like; `loop_rows.D_REFERENCE` and its like, which have to be
        written before `command`.
    """

    def __init__(
        self,
        robot: Robot,
        joints: Sequence[JointModels],
        table: MuscleTable,
        reservoir: SupplyReservoir,
        numbers: Any,
    ) -> None:
        count = len(table.places)
        self._owners, self._reservoir, self._constants = table.owners, reservoir, numbers
        self._muscles = [robot.muscles[place] for place in table.places]
        spaces = {
            row: space
            for models, rows in zip(joints, table.pairs, strict=True)
            for row, space in zip(
                rows, (models.model.agonist, models.model.antagonist), strict=True
            )
        }
        self._spaces = [spaces[row] for row in range(count)]
        self._numbers = for_kernel(np.zeros((count, N_NUMBERS)))
        self._inverses = for_kernel(
            np.array([inverse_row(robot.rig.muscles[muscle.place]) for muscle in self._muscles])
        )
        self._settings = for_kernel(np.zeros((len(joints), N_SETTINGS)))
        self.state = for_kernel(np.zeros((count, N_STATE)))
        self.demands = for_kernel(np.zeros((count, N_DEMAND)))
        self._commands, self._cut = (for_kernel(np.zeros(count)) for _ in range(2))
        self.loops = [self._loop(robot, k, muscle) for k, muscle in enumerate(self._muscles)]
        rows = (self._owners, self._constants, self._numbers)
        prepare(true_pressures, *rows, self.state, self.demands, self._commands, 0.0)
        prepare(
            command_valves, *rows, self._inverses, self._settings, self.state, self.demands,
            0.0, 0.0, 0.0, self._commands, self._cut,
        )  # fmt: skip
        self._open = [
            k for k, n in enumerate(self._numbers) if n[N_IN_CLOSED_FORM] == n[N_REGULATED] == 0.0
        ]

    def _loop(self, robot: Robot, k: int, muscle: RobotMuscle) -> MuscleLoop:
        """Write the numbers of a muscle, and make its loop."""
        n, v, c = self._numbers[k], self.state[k], self._constants[self._owners[k][O_JOINT]]
        low, high = self._spaces[k].model.length_bounds
        valve, ambient = muscle.valve, robot.gas.ambient_pressure
        n[N_SIGN] = math.copysign(1.0, muscle.arms[0].length)
        n[N_SHORTEST], n[N_LONGEST] = low + LENGTH_EDGE, high - LENGTH_EDGE
        n[N_IN_CLOSED_FORM], n[N_DEAD] = float(is_closed_form(c)), self._spaces[k].dead_volume
        n[N_THRESHOLD] = LEAST_SHARE * muscle.max_pressure
        n[N_LAG], n[N_CONDUCTANCE] = valve.time_constant, valve.sonic_conductance
        n[N_CRITICAL] = valve.critical_ratio
        if valve.kind == "pressure_regulator":
            n[N_REGULATED] = 1.0
            full_scale = valve.full_scale or math.inf
            n[N_MOST] = min(full_scale, muscle.max_pressure, robot.supply_gauge_pressure)
            return MuscleLoop(v, None)
        n[N_FULL] = full_flow(c, n, robot.supply.pressure, True, ambient)
        turn, loss = (muscle.place + 0.5) / len(robot.muscles), 0.0
        if valve.tube is not None:
            loss = TOLD_TUBE * (valve.sonic_conductance / valve.tube.conductance) ** 2
        return MuscleLoop(v, FlowAdaptation(n, v, robot.supply.pressure, turn, loss))

    def use(self, joint: int, settings: ControlSettings, adapts: bool, acts: float) -> None:
        """Use other settings of a joint from the next step on.

        Parameters
        ----------
        joint : int
            Its place.
        settings : ControlSettings
            Gain, lead and limit.
        adapts : bool
            Whether what is learnt is used.
        acts : float
            Time until the commands act, from a measurement without age [s].
        """
        g = self._settings[joint]
        g[G_GAIN], g[G_LEAD_RATIO] = settings.pressure_gain or 0.0, settings.lead_ratio
        g[G_SPOOL_LIMIT], g[G_ADAPTS], g[G_ACTS] = settings.spool_limit, float(adapts), acts

    def read(self, shown: Sequence[float], step: float) -> None:
        """Take what the sensors show [Pa gauge] after a step [s], and write `D_PRESSURE`."""
        true_pressures(
            self._owners, self._constants, self._numbers, self.state, self.demands,
            for_kernel(np.array(shown)), step,
        )  # fmt: skip

    def command(self, age: float, step: float) -> tuple[Any, Any]:
        """The commands of all valves, and 1 where one was limited, else 0.

        Parameters
        ----------
        age, step : float
            Age of the measured pressures, and time since the last call [s].
        """
        for k in self._open:
            d, space, muscle = self.demands[k], self._spaces[k], self._muscles[k]
            length = space.neutral_length - muscle.arms[0].length * float(d[D_POSITION])
            length = limited(length, *(self._numbers[k][N_SHORTEST : N_LONGEST + 1]))
            gas = max(float(d[D_PRESSURE] + d[D_AHEAD]), 0.0)
            d[D_VOLUME : D_BY_PRESSURE + 1] = gas_volume(space.model, gas, length)
        drawn, is_due = command_valves(
            self._owners, self._constants, self._numbers, self._inverses, self._settings,
            self.state, self.demands, self._reservoir.pressure, age, step, self._commands,
            self._cut,
        )  # fmt: skip
        self._reservoir.draw(drawn)
        if is_due:
            for loop in self.loops:
                loop.update()
        return self._commands, self._cut
