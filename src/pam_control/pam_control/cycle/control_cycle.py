"""One cycle of all joints under control: its stages in their order, over common rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pam_control.control_step import Measurement
from pam_control.cycle.joint_channel import JointChannel
from pam_control.cycle.joint_cycle import K_DELAY, K_STIFFNESS, CycleRows, new_cycle
from pam_control.cycle.pressure_loops import PressureLoops
from pam_control.cycle.stages import COMMAND, DEMAND, SETTLE, act, begin, measure
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.joint_models import JointModels
from pam_control.joint_setup import JointSetup
from pam_control.laws.law import AnyLaw
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.rows.muscle_table import MuscleTable
from pam_control.settings import ControlSettings
from pam_model.plant.compiled import for_kernel, listed, prepare
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
    telemetry : rows
        Of all joints, from the last cycle (`telemetry_rows`).
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
        self._table = table = MuscleTable.of(robot)
        self._constants = for_kernel(joint_numbers(robot))
        self._reservoir = reservoir
        self._valves = PressureLoops(robot, joints, table, self._constants)
        states, loops = law.init_together(joints), self._valves.loops
        if law.together:
            self._rows = CycleRows(states[0].rows.w, states[0].rows.x)
        else:
            self._rows = CycleRows(*new_cycle(*np.shape(table.owned)))
        self.channels = [
            JointChannel(models, tuple(loops[k] for k in owned), setup, self._rows, state)
            for models, owned, setup, state in zip(joints, table.owned, setups, states, strict=True)
        ]
        self.telemetry = self._rows.z
        k = self._rows.k
        self._scheduling = (k, K_STIFFNESS, k, K_DELAY)  # written by `JointChannel.prepare`
        if law.together:
            self._scheduling = law.scheduling(states)
        self._positions = for_kernel(np.zeros(len(joints)))
        self._pressures = for_kernel(np.zeros(len(robot.muscles)))
        self._commands = for_kernel(np.full(len(robot.muscles), math.nan))
        self._sinks = False  # the air is let out slowly
        self._asked: Sequence[float] = ()  # stiffnesses, as long as nothing else changes them
        self.use(setups)
        # no cycle waits for machine code
        prepare(begin, *self._of_begin())
        prepare(measure, 0.0, 0.0, 0.0, 0.0, 0.0, *self._of_measurement())
        prepare(act, DEMAND, SETTLE, 0.0, 0.0, 0.0, False, *self._of_act())

    def _of_begin(self) -> tuple[Any, ...]:
        """Arguments of `begin`."""
        return self._table.owned, self._rows.k, self._valves.state, *self._scheduling

    def _of_measurement(self) -> tuple[Any, ...]:
        """The rows for `measure`."""
        rows, valves, references = self._rows, self._valves, self._references.limited_references
        return (
            self._table.owners, self._table.owned, self._constants, valves.numbers, valves.state,
            valves.demands, self._pressures, rows.w, rows.x, rows.k, rows.u, references.history,
            references.ends, self._positions,
        )  # fmt: skip

    def _of_act(self) -> tuple[Any, ...]:
        """The rows for `act`."""
        rows, valves = self._rows, self._valves
        return (
            self._table.owners, self._table.owned, self._constants, valves.numbers,
            valves.inverses, valves.settings, valves.state, valves.demands, rows.w, rows.x, rows.k,
            rows.u, rows.z, self._commands,
        )  # fmt: skip

    def use(self, setups: Sequence[JointSetup]) -> None:
        """Use other settings, gains and values of the law from the next cycle on."""
        for place, (channel, setup) in enumerate(zip(self.channels, setups, strict=True)):
            channel.use(setup)
            acts = max(setup.acting_delays) + channel.models.pressure_lag
            self._valves.use(place, setup.settings, setup.learns_flows, acts)
        self._rows.use(setups, self._joints)
        self._law = setups[0].law if setups else self._law
        self._asks_again = any(
            setup.law.asks_again(setup.settings, setup.adapts) for setup in setups
        )
        self._asked = ()
        self._learners = {
            place: setup.learner for place, setup in enumerate(setups) if setup.learner is not None
        }

    def begin(self) -> float:
        """Begin a cycle; return the longest learnt delay of a command, beside the stated ones [s].

        The references have to reach ahead by it before `commands` is called.
        """
        if not self._law.together:
            for channel in self.channels:
                channel.prepare()
        return begin(*self._of_begin())

    def commands(
        self,
        time: float,
        step: float,
        measurement: Measurement,
        settings: ControlSettings,
        stiffnesses: Sequence[float],
        torques: Sequence[float | None],
        share: float | None,
    ) -> tuple[float, ...]:
        """The commands of all muscles; NaN for a muscle that belongs to no joint.

        Parameters
        ----------
        time, step : float
            Present time, and time since the last cycle [s].
        measurement : Measurement
            As the sensors show it.
        settings : ControlSettings
            In force.
        stiffnesses, torques : sequence of float, of float or None
            Commanded for each joint [N m/rad], [N m]; None: no torque is commanded.
        share : float or None
            Share of the pressures that is left while the air is let out slowly [-]; None otherwise.
        """
        measured_at = measurement.pressure_time - settings.measurement_delay
        for place, learner in self._learners.items():
            learner.follow(self._references.spline(self._joints[place].name))
        self._positions[:], self._pressures[:] = measurement.positions, measurement.pressures
        measure(
            time, step, measurement.position_time, measured_at, settings.measurement_delay,
            *self._of_measurement(),
        )  # fmt: skip
        if share is not None or self._sinks:
            self._sinks = share is not None
            for channel in self.channels:
                channel.sink(share)
        if share is None:
            self._plan(step, stiffnesses, torques)
        self._act(time - measured_at, step)
        return tuple(listed(self._commands))

    def _act(self, age: float, step: float) -> None:
        """Let the valves follow the plans, after a step [s], for pressures of this age [s]."""
        valves = self._valves
        rows = (self._reservoir.pressure, age, step, self._sinks, *self._of_act())
        first = DEMAND
        if valves.has_open:
            act(DEMAND, DEMAND, *rows)
            valves.fill_volumes()
            first = COMMAND
        drawn, is_due = act(first, SETTLE, *rows)
        self._reservoir.draw(drawn)
        if is_due:
            valves.learn()
            act(SETTLE, SETTLE, *rows)

    def _plan(
        self, step: float, stiffnesses: Sequence[float], torques: Sequence[float | None]
    ) -> None:
        """Let the law plan the pressures of all joints."""
        if self._law.together:
            # another list holds other stiffnesses
            if self._asks_again or stiffnesses is not self._asked:
                for channel, stiffness in zip(self.channels, stiffnesses, strict=True):
                    channel.ask(stiffness)
                self._asked = stiffnesses
            states = [channel.law_state for channel in self.channels]
            self._law.plan_together(states, step, self._learners)
            return
        asked = zip(self.channels, stiffnesses, torques, strict=True)
        for channel, stiffness, torque in asked:
            channel.plan(step, stiffness, torque, self._references.motion[channel.models.name])
