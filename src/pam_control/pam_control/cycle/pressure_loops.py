"""The pressure loops of all muscles: their numbers and states, and what is learnt of their valves.

The functions that work with them are in `valve_stage`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from pam_control.adaptation.flow_adaptation import (
    EVERY,
    FlowAdaptation,
)
from pam_control.cycle.valve_stage import full_flow
from pam_control.feedback.pressure_watch import LEAST_SHARE, begin_watch
from pam_control.joint_models import JointModels
from pam_control.limited import limited
from pam_control.rows.loop_rows import (
    D_AHEAD,
    D_BY_PRESSURE,
    D_POSITION,
    D_PRESSURE,
    D_VOLUME,
    G_ACTS,
    G_ADAPTS,
    G_GAIN,
    G_LEAD_RATIO,
    G_SPOOL_LIMIT,
    N_BIAS,
    N_CONDUCTANCE,
    N_CRITICAL,
    N_DEMAND,
    N_FULL,
    N_GAIN,
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
from pam_control.rows.muscle_table import O_JOINT, MuscleTable
from pam_control.settings import ControlSettings
from pam_model.plant.compiled import for_kernel, listed_column
from pam_model.plant.control_laws import inverse_row
from pam_model.robot import Robot, RobotMuscle
from pam_model.views.gas_volume import gas_space
from pam_model.views.joint_numbers import is_closed_form
from pam_model.views.muscle_path import path_length

TOLD_TUBE: Final = 0.5
"""Part of the loss by the rig file that is used until the tube was seen to work: with twice the
true loss, the loop of the observed pressure is unstable, with half of it, it is a little slower."""
LENGTH_EDGE: Final = 1e-6  # m, distance from the ends of the force model's range


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
    table : MuscleTable
        The muscle of each row, and its joint.
    constants : rows
        Of `pam_model.views.joint_numbers`.

    Attributes
    ----------
    loops : list of MuscleLoop
        One for each row.
    numbers, inverses, settings, state, demands : rows
        `loop_rows.N_FULL`, inverses of the valves, `G_GAIN`, `V_FACTOR`, `D_REFERENCE` and their
        like.
    has_open : bool
        Whether `fill_volumes` has anything to do.
    """

    def __init__(
        self,
        robot: Robot,
        joints: Sequence[JointModels],
        table: MuscleTable,
        constants: Any,
    ) -> None:
        count = len(table.places)
        self._owners, self._constants = table.owners, constants
        self._muscles = [robot.muscles[place] for place in table.places]
        self.numbers = for_kernel(np.zeros((count, N_NUMBERS)))
        self.inverses = for_kernel(
            np.array([inverse_row(robot.rig.muscles[muscle.place]) for muscle in self._muscles])
        )
        self.settings = for_kernel(np.zeros((len(joints), N_SETTINGS)))
        self.state = for_kernel(np.zeros((count, N_STATE)))
        self.demands = for_kernel(np.zeros((count, N_DEMAND)))
        self.loops = [self._loop(robot, k, muscle) for k, muscle in enumerate(self._muscles)]
        self._open = [
            k for k, n in enumerate(self.numbers) if n[N_IN_CLOSED_FORM] == n[N_REGULATED] == 0.0
        ]
        self.has_open = bool(self._open)

    def _loop(self, robot: Robot, k: int, muscle: RobotMuscle) -> MuscleLoop:
        """Write the numbers of a muscle, and make its loop."""
        n, v, c = self.numbers[k], self.state[k], self._constants[self._owners[k][O_JOINT]]
        low, high = muscle.force_model.length_bounds
        valve, ambient = muscle.valve, robot.gas.ambient_pressure
        n[N_SIGN] = math.copysign(1.0, muscle.arms[0].length)
        n[N_SHORTEST], n[N_LONGEST] = low + LENGTH_EDGE, high - LENGTH_EDGE
        n[N_GAIN], n[N_BIAS] = muscle.pressure_gain, muscle.pressure_bias
        n[N_IN_CLOSED_FORM] = float(is_closed_form(c))
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
        g = self.settings[joint]
        g[G_GAIN], g[G_LEAD_RATIO] = settings.pressure_gain or 0.0, settings.lead_ratio
        g[G_SPOOL_LIMIT], g[G_ADAPTS], g[G_ACTS] = settings.spool_limit, float(adapts), acts

    def fill_volumes(self) -> None:
        """Write the gas volumes of muscles that are not in closed form."""
        for k in self._open:
            d, muscle = self.demands[k], self._muscles[k]
            length = path_length(muscle, {arm.joint: float(d[D_POSITION]) for arm in muscle.arms})
            length = limited(length, *(self.numbers[k][N_SHORTEST : N_LONGEST + 1]))
            gas = max(float(d[D_PRESSURE] + d[D_AHEAD]), 0.0)
            d[D_VOLUME : D_BY_PRESSURE + 1] = gas_space(muscle, gas, length)

    def learn(self) -> None:
        """Learn what is due of the valves."""
        chattered = listed_column(self.state, V_CHATTERED)
        since = listed_column(self.state, V_SINCE)
        for loop, chatters, waited in zip(self.loops, chattered, since, strict=True):
            if chatters > 0.0 or waited >= EVERY:
                loop.update()
