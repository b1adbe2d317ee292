"""One cycle of all joints under control: its stages in their order, over common rows."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pam_control.control_step import Measurement
from pam_control.cycle.joint_channel import JointChannel
from pam_control.cycle.joint_cycle import CycleRows, demand, longest_delay, new_cycle, sense, settle
from pam_control.cycle.pressure_loops import PressureLoops
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.joint_models import JointModels
from pam_control.joint_setup import JointSetup
from pam_control.laws.law import AnyLaw
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.rows.loop_rows import V_TUBE
from pam_control.rows.muscle_table import MuscleTable
from pam_control.rows.plan_rows import W_DESIRED
from pam_control.settings import ControlSettings
from pam_model.plant.compiled import for_kernel, listed, listed_column, prepare
from pam_model.views.joint_numbers import joint_numbers


class ControlCycle:
    """The cycle of all joints of a robot.

    Parameters
    ----------
    reservoir : SupplyReservoir
        From which all valves draw.
    setups : sequence of JointSetup
        What is in force for each joint at the start.

    Attributes
    ----------
    channels : list of JointChannel
        The joints.
    """

    def __init__(
        self,
        joints: Sequence[JointModels],
        reservoir: SupplyReservoir,
        law: AnyLaw,
        setups: Sequence[JointSetup],
        references: ReferenceGenerator,
    ) -> None:
        self._joints, self._law, self._references = joints, law, references
        robot = joints[0].robot
        self._count = len(robot.muscles)
        self._table = table = MuscleTable.of(robot)
        self._owned = [[int(loop) for loop in owned] for owned in table.owned]
        numbers = for_kernel(joint_numbers(robot))
        self._valves = PressureLoops(robot, joints, table, reservoir, numbers)
        states, loops = law.init_together(joints), self._valves.loops
        if law.together:
            self._rows = CycleRows(states[0].rows.w, states[0].rows.x)
        else:
            self._rows = CycleRows(*new_cycle(*np.shape(table.owned)))
        self.channels = [
            JointChannel(models, tuple(loops[k] for k in owned), setup, self._rows, state)
            for models, owned, setup, state in zip(joints, table.owned, setups, states, strict=True)
        ]
        self._positions = for_kernel(np.zeros(len(joints)))
        self._sinks = False  # the air is let out slowly
        self.use(setups)
        self._compile()

    def _compile(self) -> None:
        """Let no cycle wait for machine code."""
        rows, valves, references = self._rows, self._valves, self._references.limited_references
        w, x, k, u, d, owned = rows.w, rows.x, rows.k, rows.u, valves.demands, self._table.owned
        history, ends = references.history, references.ends
        prepare(
            sense,
            owned,
            w,
            x,
            k,
            u,
            d,
            valves.state,
            history,
            ends,
            self._positions,
            0.0,
            0.0,
            0.0,
            0.0,
        )
        prepare(demand, owned, w, x, k, u, d, 0.0)
        prepare(settle, owned, x, k, u, for_kernel(np.zeros(len(d))), 0.0, False)
        prepare(longest_delay, owned, k, valves.state)

    def use(self, setups: Sequence[JointSetup]) -> None:
        """Use other settings, gains and values of the law from the next cycle on."""
        for place, (channel, setup) in enumerate(zip(self.channels, setups, strict=True)):
            channel.use(setup)
            acts = max(setup.acting_delays) + channel.models.pressure_lag
            self._valves.use(place, setup.settings, setup.adapts, acts)
        self._rows.use(setups, self._joints)
        self._law = setups[0].law if setups else self._law
        self._learners = {
            place: setup.learner for place, setup in enumerate(setups) if setup.learner is not None
        }

    def begin(self) -> float:
        """Begin a cycle; return the longest learnt delay of a command, beside the stated ones [s].

        The references have to reach ahead by it before `commands` is called.
        """
        for channel in self.channels:
            channel.prepare()
        return longest_delay(self._table.owned, self._rows.k, self._valves.state)

    def commands(
        self,
        time: float,
        step: float,
        measurement: Measurement,
        settings: ControlSettings,
        stiffnesses: Sequence[float],
        torques: Sequence[float | None],
        share: float | None,
    ) -> list[float]:
        """The commands of all muscles; NaN for a muscle that belongs to no joint.

        Parameters
        ----------
        time, step : float
            Present time, and time since the last cycle [s].
        measurement : Measurement
            Corrected by what the rig file says about the sensors.
        settings : ControlSettings
            In force.
        stiffnesses, torques : sequence of float, of float or None
            Commanded for each joint [N m/rad], [N m]; None: no torque is commanded.
        share : float or None
            Share of the pressures that is left while the air is let out slowly [-]; None otherwise.
        """
        rows, valves, table = self._rows, self._valves, self._table
        references = self._references.limited_references
        measured_at = measurement.pressure_time - settings.measurement_delay
        valves.read([measurement.pressures[place] for place in table.places], step)
        for place, learner in self._learners.items():
            learner.follow(self._references.spline(self._joints[place].name))
        self._positions[:] = measurement.positions
        sense(
            table.owned, rows.w, rows.x, rows.k, rows.u, valves.demands, valves.state,
            references.history, references.ends, self._positions, time, measurement.position_time,
            measured_at, settings.measurement_delay,
        )  # fmt: skip
        if share is not None or self._sinks:
            self._sinks = share is not None
            for channel in self.channels:
                channel.sink(share)
        if share is None:
            self._plan(step, stiffnesses, torques)
        demand(table.owned, rows.w, rows.x, rows.k, rows.u, valves.demands, step)
        found, cut = valves.command(time - measured_at, step)
        settle(table.owned, rows.x, rows.k, rows.u, cut, step, share is not None)
        tubes, desired = listed_column(valves.state, V_TUBE), listed_column(rows.w, W_DESIRED)
        told = zip(self.channels, listed(rows.x), listed(rows.k), desired, self._owned, strict=True)
        for channel, x, k, pressures, owned in told:
            channel.tell(x, k, tuple(pressures), sum([tubes[loop] > 0.0 for loop in owned]))
        commands = [math.nan] * self._count
        for place, command in zip(table.places, listed(found), strict=True):
            commands[place] = command
        return commands

    def _plan(
        self, step: float, stiffnesses: Sequence[float], torques: Sequence[float | None]
    ) -> None:
        """Let the law plan the pressures of all joints."""
        asked = zip(self.channels, stiffnesses, torques, strict=True)
        if self._law.together:
            for channel, stiffness, _ in asked:
                channel.ask(stiffness)
            states = [channel.law_state for channel in self.channels]
            self._law.plan_together(states, step, self._learners)
            return
        for channel, stiffness, torque in asked:
            channel.plan(step, stiffness, torque, self._references.motion[channel.models.name])
