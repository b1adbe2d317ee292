"""Simulates the plant along a recording and corrects its pressures by the measured ones.

This is a Luenberger observer with one small, fixed gain on the pressures and none on the motion. A
muscle behind a shut valve integrates, so that a free run from the commands drifts away after any
error. With the correction, an error decays within `horizon`. The prediction errors then show what
the model misses in the last fraction of a second, however long the recording is. States that are
not measured (spool, creep, thread friction, gas temperature, reservoir) are integrated by the model
along the measured history. The diagnosis minimises the prediction errors of this observer, which is
the prediction error method (Ljung, System Identification, chapters 4 and 7). It resembles multiple
shooting with windows that fade exponentially.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.channel_order import (
    AGONIST_FORCE,
    AGONIST_PRESSURE,
    BOTH_FORCES,
    N_CHANNELS,
    POSITION,
    SPEED,
)
from pam_model.physics.pressure_sensor import pressure_reading, true_pressure
from pam_model.plant.compile_beside import CompileBeside
from pam_model.plant.compiled import compiled, entry_point, for_kernel, fused_entry_point
from pam_model.plant.kernel import muscle_pull
from pam_model.plant.lane_blocks import Lanes, blocks_of_lanes, in_lines
from pam_model.plant.lane_choice import VECTOR, LaneKernel
from pam_model.plant.lane_kernel import advance_lanes, with_loops
from pam_model.plant.lane_twins import SINGLE, Variant
from pam_model.plant.layout import (
    C_AMBIENT,
    C_DRAWN,
    C_EXTERNAL,
    C_MUSCLES,
    C_SUPPLY,
    M_TUBE,
    N_MUSCLE_CONSTANTS,
    N_MUSCLE_STATES,
    S_PRESSURE,
    S_VALVE_PRESSURE,
    Y_MUSCLES,
    Y_POSITION,
    Y_RESERVOIR,
    Y_VELOCITY,
)
from pam_model.plant.muscle_arms import SIDES
from pam_model.plant.sensors import (
    K_BIAS,
    K_DELAY,
    K_GAIN,
    K_LAG,
    K_OFFSET,
    N_MUSCLE_SENSORS,
    lag_weights,
    sensors_of,
)

Array = npt.NDArray[np.float64]
FOLLOW_MOTION, FOLLOW_PRESSURES, FOLLOW_BOTH = -1, -2, -3
HALF_FLOW = SPEED + 1
"""First of two columns of `restart`, which are needed with FOLLOW_PRESSURES: how much the flow of
either valve changes the reading of the pressure from a sample to the middle of its interval."""
# Gains of the corrections: of the pressures, of the motion, and of the motion at the start of the
# recording; and the duration of this start [s].
FADE, HOLD_POSITION, HOLD_SPEED, CATCH_POSITION, CATCH_SPEED, CATCH_TIME = range(6)
N_GAINS = 6
MOST_LATE = 0.3
"""Largest bandwidth of a correction of the motion times the delay of the measurement.

The correction is (2 w s + w^2)/s^2 with bandwidth w; its gain is 1 at 2.06 w, where its phase
margin is 76 deg. A delay of 0.64/w uses this up.
"""
# After the sensors' constants: the weights with which the reading and the pressure of the last
# sample remain in the reading of a lagging sensor (`lag_weights`), for both muscles. In `shown`,
# too, both pressures follow both readings.
K_LAST_READING = sensors_of(len(SIDES))
K_LAST_PRESSURE = K_LAST_READING + len(SIDES)


@compiled
def start_sample(
    c: Any,
    sensors: Any,
    y: Any,
    shown: Any,
    history: Any,
    external: Any,
    drawn: Any,
    restart: Any,
    k: int,
    anew: bool,
    window: int,
) -> None:
    """Set the states that are followed to the measured ones, or all of them at a restart."""
    history[k] = y[Y_POSITION]
    if len(external) > 0:
        c[C_EXTERNAL] = external[k]
    if len(drawn) > 0:
        c[C_DRAWN] = max(drawn[k, 0] + drawn[k, 1] * (y[Y_RESERVOIR] - c[C_SUPPLY]), 0.0)
    if anew or window in (FOLLOW_MOTION, FOLLOW_BOTH):
        y[Y_POSITION] = restart[k, POSITION] - sensors[K_OFFSET]
        y[Y_VELOCITY] = restart[k, SPEED]
    if anew or window in (FOLLOW_PRESSURES, FOLLOW_BOTH):
        for i in range(2):
            o = Y_MUSCLES + i * N_MUSCLE_STATES
            s = i * N_MUSCLE_SENSORS
            gain, bias = sensors[s + K_GAIN], sensors[s + K_BIAS]
            gauge = true_pressure(restart[k, AGONIST_PRESSURE + i], gain, bias)
            y[o + S_PRESSURE] = gauge + c[C_AMBIENT]
            y[o + S_VALVE_PRESSURE] = gauge + c[C_AMBIENT]
    if anew:
        for i in range(2):
            gauge = y[Y_MUSCLES + i * N_MUSCLE_STATES + S_PRESSURE] - c[C_AMBIENT]
            shown[i] = gauge
            shown[2 + i] = gauge


@compiled
def correct_pressures(
    c: Any,
    sensors: Any,
    y: Any,
    shown: Any,
    total: Any,
    measured: Any,
    known: Any,
    k: int,
    fade: float,
) -> None:
    """Add the errors of both pressures to `total`, and correct the pressures by a part of them."""
    for i in range(2):
        o = Y_MUSCLES + i * N_MUSCLE_STATES
        s = i * N_MUSCLE_SENSORS
        channel = AGONIST_PRESSURE + i
        has_tube = c[C_MUSCLES + i * N_MUSCLE_CONSTANTS + M_TUBE] > 0.0
        gain = sensors[s + K_GAIN]
        inside, at_valve = y[o + S_PRESSURE], y[o + S_VALVE_PRESSURE]
        true = (at_valve if has_tube else inside) - c[C_AMBIENT]
        seen = true + sensors[K_LAST_READING + i] * (shown[i] - true)
        seen += sensors[K_LAST_PRESSURE + i] * (shown[2 + i] - true)
        error = measured[k, channel] - pressure_reading(seen, gain, sensors[s + K_BIAS])
        total[channel] += error if known[k, channel] else np.nan
        correction = fade * error / gain if known[k, channel] else 0.0
        y[o + S_PRESSURE] = inside + correction
        y[o + S_VALVE_PRESSURE] = at_valve + (correction if has_tube else 0.0)
        shown[i] = seen + correction
        shown[2 + i] = true + correction


@compiled
def correct_motion(
    sensors: Any,
    y: Any,
    history: Any,
    total: Any,
    measured: Any,
    known: Any,
    k: int,
    position_gain: float,
    speed_gain: float,
    sample_time: float,
) -> None:
    """Add the error of the position to `total`, and correct the motion by a part of it."""
    delay = sensors[K_DELAY] / sample_time
    whole = math.floor(delay)
    share = delay - whole
    late = max(k - whole, 0)
    position = (1.0 - share) * history[late] + share * history[max(late - 1, 0)]
    error = measured[k, POSITION] - (position + sensors[K_OFFSET])
    total[POSITION] += error if known[k, POSITION] else np.nan
    if known[k, POSITION]:
        # position_gain is twice the bandwidth: a late error is corrected more slowly
        slower = MOST_LATE / max(MOST_LATE, 0.5 * position_gain * delay)
        y[Y_POSITION] += slower * position_gain * error
        y[Y_VELOCITY] += slower**2 * speed_gain * error


@compiled
def compare_pulls(
    c: Any, tables: Any, y: Any, total: Any, measured: Any, known: Any, k: int
) -> None:
    """Add the errors of both pulls to `total`."""
    for i in range(2):
        channel = AGONIST_FORCE + i
        error = measured[k, channel] - muscle_pull(i, c, tables, y)
        total[channel] += error if known[k, channel] else np.nan


@compiled
def enter_interval(sensors: Any, y: Any, restart: Any, k: int, window: int) -> None:
    """Change pressures that are followed to those between this sample and the next one.

    Their valves are shut between samples, so that they would lag behind by half a sample.
    """
    if window == FOLLOW_PRESSURES:
        for i in range(2):
            o = Y_MUSCLES + i * N_MUSCLE_STATES
            change = restart[k, HALF_FLOW + i] / sensors[i * N_MUSCLE_SENSORS + K_GAIN]
            y[o + S_PRESSURE] += change
            y[o + S_VALVE_PRESSURE] += change


# Loops over the lanes, which `with_loops` defines for each kernel.
start_sample_lanes: Any = None
correct_pressures_lanes: Any = None
correct_motion_lanes: Any = None
compare_pulls_lanes: Any = None
enter_interval_lanes: Any = None
advance_block: Any = None


def _observe(
    active: int,
    c: Any,
    sensors: Any,
    tables: Any,
    commands: Any,
    measured: Any,
    known: Any,
    external: Any,
    drawn: Any,
    shut: bool,
    sample_time: float,
    steps: int,
    gains: Any,
    window: int,
    restart: Any,
    y: Any,
    k1: Any,
    k2: Any,
    k3: Any,
    k4: Any,
    ys: Any,
    held: Any,
    contact: Any,
    torque: Any,
    shown: Any,
    drive: Any,
    block: int,
    has_pulls: bool,
    totals: Any,
    history: Any,
) -> None:
    """Run a block of lanes; add its prediction errors to the sums `totals` (NaN with gaps)."""
    for k in range(len(commands)):
        total = totals[k // block]
        anew = window > 0 and k % window == 0
        start_sample_lanes(
            active, c, sensors, y, shown, history, external, drawn, restart, k, anew, window
        )
        correct_pressures_lanes(
            active, c, sensors, y, shown, total, measured, known, k, gains[FADE]
        )
        # The joint may still swing when the recording begins, so its motion is corrected at first.
        early = k * sample_time < gains[CATCH_TIME] and window in (0, FOLLOW_PRESSURES)
        first = CATCH_POSITION if early else HOLD_POSITION
        correct_motion_lanes(
            active, sensors, y, history, total, measured, known, k, gains[first],
            gains[first + 1], sample_time,
        )  # fmt: skip
        if has_pulls:
            compare_pulls_lanes(active, c, tables, y, total, measured, known, k)
        enter_interval_lanes(active, sensors, y, restart, k, window)
        advance_block(
            active, c, tables, y, k1, k2, k3, k4, ys, held, contact, torque, drive, commands, k,
            shut, sample_time, steps,
        )  # fmt: skip


@cache
def _compiled_observer(variant: Variant) -> Callable[..., None]:
    """`_observe` compiled for a variant of the plant."""
    loops = (start_sample, correct_pressures, correct_motion, compare_pulls, enter_interval)
    made = with_loops(_observe, loops, variant)
    made.__globals__["advance_block"] = advance_lanes(variant)
    return fused_entry_point(made) if variant is SINGLE else entry_point(made)


_KERNELS = CompileBeside("_observe")


def observe(
    constants: Array,
    sensors: Array,
    tables: Any,
    commands: Array,
    measured: Array,
    known: npt.NDArray[np.bool_],
    initial: Array,
    *,
    sample_time: float,
    step: float,
    horizon: float,
    position_bandwidth: float = 0.0,
    window: int = 0,
    restart: Array | None = None,
    external: Array | None = None,
    drawn: Array | None = None,
    shut: bool = False,
    block: int = 4,
    catch_time: float = 1.0,
    catch_bandwidth: float = 15.0,
    threads: int = 1,
    kernels: Sequence[LaneKernel] | None = None,
) -> Array:
    """Prediction errors of several plants along one recording.

    Parameters
    ----------
    constants : ndarray, shape (lanes, n_constants)
        Constants of each plant.
    sensors : ndarray, shape (lanes, n_sensors)
        Sensor constants of each plant, from `pam_model.plant.sensors.sensor_constants`.
    tables : sequence of two ndarrays
        Force tables in the form that the plant expects.
    commands : ndarray, shape (N, 2)
        Valve commands as logged; each is held for one sample.
    measured, known : ndarray, shape (N, N_CHANNELS)
        Measurements, and whether they are true samples.
    initial : ndarray, shape (lanes, n_states)
        States at the first sample.
    sample_time, step : float
        Step of the recording and longest step of the integration [s].
    horizon : float
        Time constant of the correction of the pressures [s]; infinite for no correction.
    position_bandwidth : float
        If above 0, the motion is also corrected, with this bandwidth [rad/s].
    window : int
        Number of samples after which the state is reset to `restart`; 0 for never. With
        FOLLOW_MOTION, FOLLOW_PRESSURES or FOLLOW_BOTH, these states are set to the measured ones in
        every sample.
    restart : ndarray, shape (N, 4) or (N, 6), optional
        Measured pressures [Pa], position [rad] and speed [rad/s] for such a reset; with
        FOLLOW_PRESSURES, `HALF_FLOW` of both muscles as well [Pa].
    external : ndarray, shape (N,), optional
        External torque on the joint [N m].
    drawn : ndarray, shape (N, 2), optional
        What others draw from the same reservoir, see `pam_model.views.air_drawn`.
    shut : bool
        Whether the valves are shut.
    block : int
        Number of samples averaged into one row of the result.
    catch_time, catch_bandwidth : float
        Time at the start in which the motion is corrected [s], and the bandwidth of this
        correction [rad/s].
    threads : int
        Number of lanes that are simulated in parallel.
    kernels : sequence of LaneKernel, optional
        Kernels that simulate lanes side by side in the vectors of the processor; the result is the
        same as without. By default those that are compiled, which begins where a process has enough
        work for one. Without numba there are none.

    Returns
    -------
    ndarray, shape (lanes, N // block, N_CHANNELS)
        Mean prediction error of each block in the channel's unit; NaN where a sample is missing.
    """
    lanes = constants.shape[0]
    samples = commands.shape[0]
    blocks = samples // block
    caught = max(position_bandwidth, catch_bandwidth)
    gains = np.empty(N_GAINS)
    gains[FADE] = 1.0 - math.exp(-sample_time / horizon)
    gains[HOLD_POSITION] = min(2.0 * position_bandwidth * sample_time, 1.0)
    gains[HOLD_SPEED] = position_bandwidth**2 * sample_time
    gains[CATCH_POSITION] = min(2.0 * caught * sample_time, 1.0)
    gains[CATCH_SPEED] = caught**2 * sample_time
    gains[CATCH_TIME] = catch_time
    lags = sensors[:, [K_LAG, N_MUSCLE_SENSORS + K_LAG]]
    weights = np.array([[lag_weights(lag, sample_time) for lag in lane] for lane in lags.tolist()])
    with_weights = np.hstack([sensors, weights[..., 0], weights[..., 1]])
    has_pulls = bool(known[:, BOTH_FORCES].any())
    result = np.empty((lanes, blocks, N_CHANNELS))
    kernel_commands = for_kernel(commands)

    def one(group: Lanes) -> None:
        width = group.width
        c, y = group.side_by_side(constants), group.side_by_side(initial)
        ambient = constants[:, C_AMBIENT, None]
        shown = initial[:, Y_MUSCLES + S_PRESSURE :: N_MUSCLE_STATES] - ambient
        # Samples after the last whole block are summed as well, and left out of the result.
        totals = np.zeros((blocks + 1, N_CHANNELS * width))
        if not has_pulls:
            totals[:, AGONIST_FORCE * width :] = np.nan
        _compiled_observer(group.variant)(
            group.active,
            c,
            group.side_by_side(with_weights),
            tables,
            kernel_commands,
            measured,
            known,
            np.zeros(0) if external is None else external,
            np.zeros((0, 2)) if drawn is None else drawn,
            shut,
            sample_time,
            group.steps,
            gains,
            0 if restart is None else window,
            np.zeros((1, 4)) if restart is None else restart,
            y,
            *(in_lines(np.zeros(initial.shape[1] * width)) for _ in range(5)),
            in_lines(np.zeros(2 * width)),
            in_lines(np.zeros(2 * width)),
            in_lines(np.zeros(width)),
            group.side_by_side(np.hstack([shown, shown])),
            np.zeros(3),
            block,
            has_pulls,
            totals,
            np.zeros(samples * width),
        )
        sums = totals[:blocks].reshape(blocks, N_CHANNELS, width)
        for lane, member in enumerate(group.members):
            np.divide(sums[..., lane], block, out=result[member])

    def once(kernel: LaneKernel, lane: int) -> None:
        some, few = [lane] * VECTOR, 2 * block  # enough for the kernel to be used
        observe(
            constants[some], sensors[some], tables, commands[:few], measured[:few],
            known[:few], initial[some], sample_time=sample_time, step=step, horizon=horizon,
            block=block, kernels=[kernel.for_all(VECTOR)],
        )  # fmt: skip

    if kernels is None:
        kernels = _KERNELS.ready_kernels(constants, samples, once)
    groups = blocks_of_lanes(constants, kernels, sample_time, step, threads)
    if threads > 1 and len(groups) > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(one, groups))
    else:
        for group in groups:
            one(group)
    return result
