"""The simulated joint: the ideal physics and every effect of pam_model.effects.

The integration is classical RK4 with a fixed step and held commands (pam_model.plant.kernel). It is
compiled if numba is installed; otherwise plain Python gives the same results. `simulate` runs whole
recordings for one or many parameter vectors. Measured signals can prescribe motion or pressures, so
that each stage of a rig can be examined alone. `Plant` simulates one joint step by step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.bounds import within
from pam_model.effects.registry import filled
from pam_model.effects.slots import PullState
from pam_model.errors import PamError
from pam_model.physics.pressure_sensor import true_pressure
from pam_model.plant import layout as lay
from pam_model.plant.batch_kernel import simulate_block
from pam_model.plant.command_history import CommandHistory
from pam_model.plant.compile_beside import CompileBeside
from pam_model.plant.compiled import HAVE_NUMBA, for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.default_step import DEFAULT_STEP
from pam_model.plant.kernel import WORK_ROWS, record, run
from pam_model.plant.lane_blocks import Lanes, blocks_of_lanes
from pam_model.plant.lane_choice import VECTOR, LaneKernel, lane_kernels
from pam_model.plant.lane_twins import SINGLE
from pam_model.plant.muscle_arms import MuscleArms, names_of
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.sensors import (
    K_BIAS,
    K_DELAY,
    K_GAIN,
    K_OFFSET,
    N_MUSCLE_SENSORS,
    Measured,
    SensorFilter,
    measure,
    sensor_constants,
)
from pam_model.plant.single_kernel import run_without_laws
from pam_model.plant.trajectory import Trajectory

Array = npt.NDArray[np.float64]

_KERNELS = CompileBeside("run_block")
_SINGLE_KERNELS = CompileBeside("run")


def _kernel_of_one(
    constants: Array,
    kernels: Sequence[LaneKernel] | None,
    work: int,
    compile_it: Callable[[LaneKernel, int], object],
) -> Callable[..., None]:
    """`run`; for a single joint without the laws that it does not have, if that is compiled."""
    if not HAVE_NUMBA or len(constants) > 1:
        return run
    if kernels is None:
        (own,) = lane_kernels(constants)
        # also read from disk only where it is worth it: that takes longer than a short simulation
        ready = _SINGLE_KERNELS.is_ready(own.variant, work, partial(compile_it, own, 0))
        kernels = (own,) if ready else ()
    return run_without_laws(kernels[0].variant) if kernels else run


def initial_state(
    parameters: PlantParameters,
    *,
    position: float = 0.0,
    velocity: float = 0.0,
    pressures: Sequence[float] | None = None,
    commands: Sequence[float] | None = None,
    creep_settled: bool = True,
) -> Array:
    """An initial state, in the order of layout.state_names.

    Parameters
    ----------
    parameters : PlantParameters
        Of the joint.
    position, velocity : float
        [rad], [rad/s].
    pressures : sequence of float, optional
        Gauge pressure in each muscle [Pa]; 0 by default.
    commands : sequence of float, optional
        Commands to which the valves have settled; 0 by default.
    creep_settled : bool
        True if the bladders have been at this position for long, False if they were just moved
        there from their rest length.

    Raises
    ------
    PamError
        For a number that is not finite, or a pressure below a vacuum.
    """
    p = parameters
    ambient, names = p["gas.ambient_pressure"], names_of(p.muscles)
    pressures = [0.0] * len(names) if pressures is None else pressures
    commands = [0.0] * len(names) if commands is None else commands
    within("position", position, unit="rad")
    within("velocity", velocity, unit="rad/s")
    if len(pressures) != len(names) or len(commands) != len(names):
        raise PamError(
            f"{len(pressures)} pressures and {len(commands)} commands: expected {len(names)} of "
            f"each, of {', '.join(names)}"
        )
    for pressure, command in zip(pressures, commands, strict=True):
        within("pressure", pressure, -ambient, unit="Pa gauge")
        within("command", command)
    y = np.zeros(lay.states_of(len(names)))
    y[lay.Y_POSITION], y[lay.Y_VELOCITY] = position, velocity
    y[lay.Y_RESERVOIR] = p["supply_pressure"]
    for i, (pressure, command) in enumerate(zip(pressures, commands, strict=True)):
        o = lay.states_of(i)
        y[o + lay.S_SPOOL] = command
        y[o + lay.S_PRESSURE] = y[o + lay.S_VALVE_PRESSURE] = pressure + ambient
        y[o + lay.S_TEMPERATURE] = p["gas.temperature"]
    if not creep_settled:
        lengths = simulate(p, np.zeros((1, len(names))), 1e-6, y).lengths[0]
        for i, muscle in enumerate(names):
            o = lay.states_of(i)
            for _, slot in filled(PullState):
                place = o + lay.PULL_STATES[slot.name]
                y[place] = slot.unsettled(float(lengths[i]), p[f"{muscle}.rest_length"])
    return y


def vented_state(parameters: PlantParameters) -> Array:
    """The state at rest: muscles vented, valves at exhaust, joint where gravity holds it."""
    position = min(
        max(parameters["joint.gravity_angle"], parameters["joint.lower_limit"]),
        parameters["joint.upper_limit"],
    )
    kinds = [parameters[f"{side}.valve.kind"] for side in names_of(parameters.muscles)]
    commands = [0.0 if kind > 0.0 else -1.0 for kind in kinds]
    return initial_state(parameters, position=position, commands=commands)


def simulate(
    parameters: PlantParameters,
    commands: Array,
    sample_time: float,
    state: Array | None = None,
    step: float = DEFAULT_STEP,
    *,
    values: Array | None = None,
    positions: Array | None = None,
    pressures: Array | None = None,
    shut: bool = False,
    threads: int = 1,
    kernels: Sequence[LaneKernel] | None = None,
) -> Trajectory:
    """Simulate a joint under sampled commands.

    Parameters
    ----------
    parameters : PlantParameters
        The joint.
    commands : (n, n_muscles) array
        Per muscle: spool -1..1 of a flow valve, gauge pressure [Pa] of a regulator; row k holds
        from k sample times to k + 1.
    sample_time : float
        [s].
    state : (n_states,) or (n_lane, n_states) array, optional
        Initial state; by default `initial_state` at rest and vented.
    step : float
        Longest RK4 step [s]. A sample time is divided into equal steps no longer than this; the
        steps are shorter if a small tube or reservoir needs it.
    values : (n_lane, n_parameters) array, optional
        Simulate this batch of vectors instead of `parameters.values`.
    positions : (n,) array, optional
        Measured position [rad] that prescribes the motion, with linear interpolation. Offset and
        delay of the encoder are removed first.
    pressures : (n, n_muscles) array, optional
        Measured gauge pressures [Pa] that prescribe the gas at the sensors. Gain and bias of the
        sensors are removed first.
    shut : bool
        The valves stay shut regardless of the commands; leaks remain.
    threads : int
        Number of lanes, or blocks of lanes, that run at the same time (compiled kernels release the
        interpreter lock).
    kernels : sequence of LaneKernel, optional
        Kernels that simulate lanes side by side in the vectors of the processor, or one lane
        without the laws that it does not need, of `lane_kernels`; the result is the same as
        without, to 1e-12. By default those that are compiled, which begins in a thread where a
        process has enough work for one. Several lanes with prescribed motion or pressures are
        simulated one after the other, as all are without numba.

    Raises
    ------
    PamError
        For arrays of a wrong shape, values that are not finite, or times not above zero.
    """
    muscles = parameters.muscles
    commands = _checked("commands", commands, (None, len(muscles)))
    within("sample_time", sample_time, unit="s", above=0.0)
    within("step", step, unit="s", above=0.0)
    count = len(commands)
    lanes = parameters.values[None] if values is None else values
    lanes = _checked("values", lanes, (None, len(parameters.values)))
    positions = None if positions is None else _checked("positions", positions, (count,))
    pressures = (
        None if pressures is None else _checked("pressures", pressures, (count, len(muscles)))
    )
    if state is None:
        state = initial_state(parameters)
    n_states, n_outputs = lay.states_of(len(muscles)), lay.outputs_of(len(muscles))
    states: Array = np.array(np.broadcast_to(state, (len(lanes), n_states)), dtype=float)
    outputs: Array = np.empty((len(lanes), count, n_outputs))
    tables = tuple(for_kernel(table) for table in parameters.tables)
    kernel_commands = for_kernel(commands)
    constants = derive_constants(lanes, muscles=muscles)

    def run_lane(i: int) -> None:
        given_positions, given_pressures = _true_drive(
            lanes[i], muscles, positions, pressures, sample_time
        )
        y = for_kernel(states[i])
        rows = outputs[i] if HAVE_NUMBA else np.empty_like(outputs[i]).tolist()
        run_single(
            for_kernel(constants[i]),
            tables,
            kernel_commands,
            0,
            for_kernel(given_positions),
            for_kernel(given_pressures),
            shut,
            sample_time,
            step,
            y,
            for_kernel(np.zeros((WORK_ROWS, n_states))),
            rows,
        )
        states[i] = y
        if not HAVE_NUMBA:
            outputs[i] = rows

    def run_group(group: Lanes) -> None:
        if group.variant is SINGLE:
            run_lane(int(group.members[0]))
            return
        simulate_block(
            group,
            constants,
            tables,
            kernel_commands,
            states,
            outputs,
            sample_time=sample_time,
            shut=shut,
        )

    def once(kernel: LaneKernel, lane: int) -> None:
        few = np.repeat(lanes[lane : lane + 1], 1 if len(lanes) == 1 else VECTOR, axis=0)
        simulate(
            parameters, commands[:2], sample_time, step=step, values=few,
            kernels=[kernel.for_all(len(few))],
        )  # fmt: skip

    prescribed = positions is not None or pressures is not None
    work = count * math.ceil(sample_time / step)
    run_single = _kernel_of_one(constants, kernels, work, once)
    if not HAVE_NUMBA or prescribed or len(lanes) == 1:
        kernels = ()
    elif kernels is None:
        kernels = _KERNELS.ready_kernels(constants, work, once)
    groups = blocks_of_lanes(constants, kernels, sample_time, step, threads)
    if threads > 1 and len(groups) > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(run_group, groups))
    else:
        for group in groups:
            run_group(group)
    time: Array = np.arange(count, dtype=np.float64) * sample_time
    if values is None:
        return Trajectory(time, outputs[0], states[0], muscles)
    return Trajectory(time, outputs, states, muscles)


def simulate_measured(
    parameters: PlantParameters, trajectory: Trajectory, values: Array | None = None
) -> Measured:
    """The readings of the rig's sensors along a trajectory, with the sensing effects.

    Parameters
    ----------
    parameters : PlantParameters
        The joint.
    trajectory : Trajectory
        From `simulate` with the same parameters (and `values`).
    values : (n_lane, n_parameters) array, optional
        The batch of which the trajectory was simulated.
    """
    return measure(
        parameters.values if values is None else values,
        trajectory.time,
        trajectory.position,
        trajectory.valve_pressures,
        parameters.muscles,
    )


class Plant:
    """One joint, simulated step by step; it holds the state and the delayed commands.

    Parameters
    ----------
    parameters : PlantParameters
        The joint, with its effects.
    step : float
        Longest RK4 step [s].
    state : array, optional
        Initial state; by default at rest at position 0, vented.
    reservoir_share : float, optional
        Share of the reservoir that belongs to this joint [-], see `RobotPlant`.

    Raises
    ------
    PamError
        For a step that is not above 0.
    """

    def __init__(
        self,
        parameters: PlantParameters,
        step: float = DEFAULT_STEP,
        state: Array | None = None,
        *,
        reservoir_share: float = 1.0,
    ) -> None:
        within("step", step, unit="s", above=0.0)
        self.parameters = parameters
        self._reservoir_share = reservoir_share
        self.step_length = step
        start = initial_state(parameters) if state is None else state
        muscles = len(parameters.muscles)
        self._constants = for_kernel(self._derived())
        self._tables = tuple(for_kernel(table) for table in parameters.tables)
        self._none = for_kernel(np.zeros(0))
        self._no_pressures = for_kernel(np.zeros((0, muscles)))
        self._work = for_kernel(np.zeros((WORK_ROWS, lay.states_of(muscles))))
        self._y = for_kernel(np.array(start, dtype=float))
        self._row = for_kernel(np.zeros((1, lay.outputs_of(muscles))))
        self._sensors = SensorFilter(parameters.values, parameters.muscles)
        self._history = CommandHistory(self.longest_delay)
        self.time = 0.0
        self.record_outputs()

    @property
    def state(self) -> Array:
        """A copy of the state, in the order of layout.state_names."""
        return np.array(self._y[: lay.states_of(len(self.parameters.muscles))], dtype=float)

    @property
    def output(self) -> dict[str, float]:
        """The present true quantities, by the names of layout.output_names."""
        names = lay.output_names(names_of(self.parameters.muscles))
        return {name: float(x) for name, x in zip(names, self._row[0], strict=False)}

    @property
    def path_speeds(self) -> tuple[float, ...]:
        """Rates of the lengths of all muscles' paths [m/s]."""
        speed = float(self._constants[lay.C_RADIUS] * self._row[0][lay.O_VELOCITY])
        return tuple(-muscle.arm * speed for muscle in self.parameters.muscles)

    @property
    def reservoir_pressure(self) -> float:
        """Pressure of the reservoir from which the valves draw [Pa absolute]."""
        return float(self._y[lay.Y_RESERVOIR])

    @property
    def longest_delay(self) -> float:
        """The longest delay of a valve's command [s]."""
        first = range(len(self.parameters.muscles))
        return max(float(self._constants[lay.constants_of(i) + lay.M_DELAY]) for i in first)

    def _derived(self) -> Array:
        own = self.parameters
        return derive_constants(own.values, self._reservoir_share, own.muscles)

    def share_memory(self, constants: Any, state: Any, output: Any) -> None:
        """Use these arrays from now on, as a joint of a `RobotPlant`.

        Their beginnings have the same content; what follows belongs to joints with more muscles.
        """
        self._constants, self._y, self._row = constants, state, output

    def change(self, changes: Mapping[str, float]) -> None:
        """Change parameters of the gas during the simulation; the state is kept.

        Parameters
        ----------
        changes : mapping of str to float
            As `PlantParameters.forced` takes them.
        """
        self.parameters = self.parameters.forced(changes)
        derived = self._derived()
        self._constants[: len(derived)] = for_kernel(derived)
        if not self._constants[lay.C_DROOP] > 0.0:
            self._y[lay.Y_RESERVOIR] = self.parameters["supply_pressure"]

    def step(self, commands: Sequence[float], duration: float) -> tuple[float, ...]:
        """Hold the commands for `duration` [s]; return the readings of the sensors at its end.

        Parameters
        ----------
        commands : sequence of float
            Of each muscle: spool -1..1 of a flow valve, gauge pressure [Pa] of a regulator.
        duration : float
            [s].

        Returns
        -------
        position : float
            [rad].
        pressures : float, one for each muscle
            Gauge [Pa].
        """
        rows, at = self._history.with_next(commands[: len(self.parameters.muscles)], duration)
        run(
            self._constants,
            self._tables,
            for_kernel(np.array(rows)),
            at,
            self._none,
            self._no_pressures,
            False,
            duration,
            self.step_length,
            self._y,
            self._work,
            self._row,
        )
        return self.observe(duration)

    def observe(self, duration: float) -> tuple[float, ...]:
        """Write the outputs of a state that is `duration` [s] later; return the readings."""
        self.time += duration
        self.record_outputs()
        row = self._row[0]
        return self._sensors.update(
            self.time,
            float(row[lay.O_POSITION]),
            [
                float(row[lay.outputs_of(i) + lay.O_VALVE_PRESSURE])
                for i in range(len(self.parameters.muscles))
            ],
        )

    def record_outputs(self) -> None:
        """Compute the outputs of the present state."""
        record(self._constants, self._tables, self._y, self._row[0])


def _checked(name: str, array: Array, shape: tuple[int | None, ...]) -> Array:
    result = np.ascontiguousarray(array, dtype=float)
    fits = result.ndim == len(shape) and all(
        want is None or want == got for want, got in zip(shape, result.shape, strict=True)
    )
    if not fits:
        wanted = tuple("n" if size is None else size for size in shape)
        raise PamError(f"{name} has shape {result.shape}, expected {wanted}")
    if not np.all(np.isfinite(result)):
        raise PamError(f"{name} holds values that are not finite")
    return result


def _true_drive(
    values: Array,
    muscles: MuscleArms,
    positions: Array | None,
    pressures: Array | None,
    sample_time: float,
) -> tuple[Array, Array]:
    """True position and pressures: offset, delay, gain and bias of the sensors are removed."""
    given_positions, given_pressures = np.zeros(0), np.zeros((0, len(muscles)))
    if positions is None and pressures is None:
        return given_positions, given_pressures
    sensors = sensor_constants(values, muscles)
    if positions is not None:
        given_positions = positions - sensors[K_OFFSET]
        delay = sensors[K_DELAY]
        if delay > 0.0:
            places = np.arange(len(positions)) + delay / sample_time
            given_positions = np.interp(places, np.arange(len(positions)), given_positions)
    if pressures is not None:
        gain, bias = sensors[K_GAIN::N_MUSCLE_SENSORS], sensors[K_BIAS::N_MUSCLE_SENSORS]
        given_pressures = np.ascontiguousarray(true_pressure(pressures, gain, bias))
    return given_positions, given_pressures
