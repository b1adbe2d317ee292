"""The joints of a robot, coupled by its links and by the reservoir from which all valves draw.

M(q) dv/dt + h(q, v) = torques of muscles, friction and end stops
dP_s/dt = k R T (mdot_in - sum of mdot_drawn)/V_s
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from pam_model.body.hinge_tree import N_LINK_NUMBERS, N_LINK_SCRATCH
from pam_model.body.link import STANDARD_GRAVITY, Link, link_numbers, smallest_inertia
from pam_model.bounds import within
from pam_model.errors import PamError
from pam_model.plant import layout as lay
from pam_model.plant.command_history import CommandHistory
from pam_model.plant.compiled import for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.default_step import DEFAULT_STEP
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.robot_kernel import N_ROWS, run_robot
from pam_model.plant.simulate import Plant, initial_state

Array = npt.NDArray[np.float64]
Reading = tuple[float, ...]


class Crossing(NamedTuple):
    """A muscle of one joint that crosses another joint as well."""

    joint: int  # the joint to whose muscles it belongs
    muscle: int  # which of them it is
    other: int  # the joint that it crosses
    # its constant lever arm there [m]; above 0 if its pull turns the joint in the positive
    # direction
    arm: float


class RobotPlant:
    """The joints of a robot, simulated step by step.

    Parameters
    ----------
    parameters : sequence of PlantParameters
        By joint. With `links`, the inertia and the gravity torque of a joint are what it has in
        addition to them, such as those of its pulley or of a payload on the last link.
    step : float, optional
        Longest RK4 step [s].
    states : sequence of array, optional
        By joint, as for `Plant`.
    links : sequence of Link, optional
        The link that each joint turns; without them, the joints do not move each other.
    gravity : (3,) array, optional
        Acceleration of free fall in the frame of the base [m/s^2].
    crossings : sequence of Crossing, optional
        The muscles that cross more than their own joint.

    Attributes
    ----------
    joints : tuple of Plant
        The plant of each joint, for its outputs and to change its parameters.

    Raises
    ------
    PamError
        If there is not one link for each joint, or a link is none that a body can be, or a muscle
        crosses a joint that does not exist.
    """

    def __init__(
        self,
        parameters: Sequence[PlantParameters],
        step: float = DEFAULT_STEP,
        states: Sequence[Array | None] | None = None,
        *,
        links: Sequence[Link] = (),
        gravity: Sequence[float] = STANDARD_GRAVITY,
        crossings: Sequence[Crossing] = (),
    ) -> None:
        n = len(parameters)
        if links and len(links) != n:
            raise PamError(f"{len(links)} links for {n} joints: expected one for each")
        share = 1.0 / max(n, 1)
        starts = [
            initial_state(one) if start is None else start
            for one, start in zip(parameters, states or [None] * n, strict=True)
        ]
        own = np.array(
            [derive_constants(one.values, muscles=one.muscles)[lay.C_INERTIA] for one in parameters]
        )
        numbers = link_numbers(links) if links else np.zeros((0, N_LINK_NUMBERS))
        if links:
            lower, upper = (
                [one[f"joint.{side}_limit"] for one in parameters] for side in ("lower", "upper")
            )
            # For the longest stable step and the damping of presliding.
            felt = smallest_inertia(numbers, own, lower, upper)
            parameters = [
                one.forced({"joint.inertia": one["joint.inertia"] + felt[i] - own[i]})
                for i, one in enumerate(parameters)
            ]
        self.joints = tuple(
            Plant(one, step, start, reservoir_share=share)
            for one, start in zip(parameters, starts, strict=True)
        )
        self._step = step
        self._is_alone = n == 1 and not links
        counts = [len(one.muscles) for one in parameters]
        most = max(counts, default=0)
        rows = _checked_crossings(crossings, counts)
        self._history = CommandHistory(
            max((plant.longest_delay for plant in self.joints), default=0.0)
        )
        self._constants = for_kernel(
            _rows(
                [derive_constants(one.values, share, one.muscles) for one in parameters],
                lay.constants_of(most),
            )
        )
        self._y = for_kernel(_rows(starts, lay.states_of(most)))
        shape = (n, lay.outputs_of(most))
        self._outputs = for_kernel(np.zeros((1, *shape)))
        for i, plant in enumerate(self.joints):
            plant.share_memory(self._constants[i], self._y[i], self._outputs[0][i : i + 1])
        self._topology = (
            for_kernel(np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])),
            for_kernel(rows),
        )
        self._tables = for_kernel(_stacked([t for one in parameters for t in one.tables]))
        self._body = tuple(
            for_kernel(array)
            for array in (
                numbers,
                np.array(gravity, dtype=float),
                own,
                np.zeros((n, N_LINK_SCRATCH)),
                np.zeros((n, n)),
                np.zeros((n, n)),
            )
        )
        self._scratch = tuple(
            for_kernel(np.zeros(size))
            for size in (
                (4, n, lay.states_of(most)),
                (n, lay.states_of(most)),
                sum(counts),
                1 + most,
                (N_ROWS, n),
            )
        )
        if crossings:  # the first outputs, of muscles whose path the other joints change
            self._run(np.zeros((1, sum(counts))), 0, 0.0, for_kernel(np.zeros((0, *shape))))
            for plant in self.joints:
                plant.record_outputs()

    @property
    def reservoir_pressure(self) -> float:
        """Pressure of the reservoir from which all valves draw [Pa absolute]."""
        return self.joints[0].reservoir_pressure

    def step(self, commands: Sequence[Sequence[float]], duration: float) -> list[Reading]:
        """Hold the commands for `duration` [s]; return the readings of the sensors at its end.

        Parameters
        ----------
        commands : sequence of sequence of float
            By joint, as for `Plant.step`.
        duration : float
            [s].

        Returns
        -------
        list of (position, pressure of each muscle)
            By joint, as from `Plant.step`.
        """
        if self._is_alone:
            return [self.joints[0].step(commands[0], duration)]
        flat = [command for own in commands for command in own]
        rows, at = self._history.with_next(flat, duration)
        self._run(np.array(rows), at, duration, self._outputs)
        return [plant.observe(duration) for plant in self.joints]

    def _run(self, commands: Array, first: int, duration: float, outputs: Any) -> None:
        ks, ys, held, drive, work = self._scratch
        run_robot(
            self._constants, self._tables, self._topology, self._body, for_kernel(commands), first,
            duration, self._step, self._y, ks, ys, held, drive, work, outputs,
        )  # fmt: skip


def _rows(parts: Sequence[Array], length: int) -> Array:
    """Arrays as rows of one, filled up with zeros."""
    rows = np.zeros((len(parts), length))
    for part, row in zip(parts, rows, strict=True):
        row[: len(part)] = part
    return rows


def _checked_crossings(crossings: Sequence[Crossing], counts: Sequence[int]) -> Array:
    """Crossings as rows, if these joints with so many muscles can have them."""
    joints = range(len(counts))
    for one in crossings:
        exists = one.joint in joints and one.other in joints and one.joint != one.other
        if not (exists and one.muscle in range(counts[one.joint])):
            raise PamError(f"{one}: expected a muscle of one joint, and another joint")
        within("lever arm of a crossing", one.arm, unit="m")
    return np.array(crossings, dtype=float).reshape(len(crossings), 4)


def _stacked(tables: Sequence[Array]) -> Array:
    """Force tables as one array (n, rows, columns).

    A table with fewer rows goes on in pressure as it does beyond its last row: linearly.
    """
    rows, columns = np.max([table.shape for table in tables], axis=0)
    stacked = np.zeros((len(tables), rows, columns))
    for table, place in zip(tables, stacked, strict=True):
        height, width = table.shape
        place[:height, :width] = table
        further = np.arange(1, rows - height + 1)[:, None]
        place[height:, :width] = table[-1] + further * (table[-1] - table[-2])
    return stacked
