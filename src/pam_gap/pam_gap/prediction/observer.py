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
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.channel_order import (
    AGONIST_FORCE,
    AGONIST_PRESSURE,
    N_CHANNELS,
    POSITION,
    SPEED,
)
from pam_model.physics.pressure_sensor import pressure_reading, true_pressure
from pam_model.plant.compiled import entry_point
from pam_model.plant.kernel import run
from pam_model.plant.layout import (
    AGONIST,
    C_AMBIENT,
    C_EXTERNAL,
    M_TUBE,
    N_MUSCLE_CONSTANTS,
    N_MUSCLE_OUTPUTS,
    N_MUSCLE_STATES,
    N_OUTPUTS,
    N_STATES,
    O_AGONIST,
    O_FORCE,
    S_PRESSURE,
    S_VALVE_PRESSURE,
    Y_AGONIST,
    Y_POSITION,
    Y_VELOCITY,
)
from pam_model.plant.sensors import (
    K_BIAS,
    K_DELAY,
    K_GAIN,
    K_LAG,
    K_OFFSET,
    N_MUSCLE_SENSORS,
)

Array = npt.NDArray[np.float64]
FOLLOW_MOTION, FOLLOW_PRESSURES, FOLLOW_BOTH = -1, -2, -3
# Gains of the corrections: of the pressures, of the motion, and of the motion at the start of the
# recording; and the duration of this start [s].
FADE, HOLD_POSITION, HOLD_SPEED, CATCH_POSITION, CATCH_SPEED, CATCH_TIME = range(6)
N_GAINS = 6


@entry_point
def _observe(  # noqa: PLR0912, PLR0915  (one compiled loop)
    c: Any,
    sensors: Any,
    tables: Any,
    commands: Any,
    measured: Any,
    known: Any,
    external: Any,
    shut: bool,
    sample_time: float,
    step: float,
    gains: Any,
    window: int,
    restart: Any,
    y: Any,
    work: Any,
    row: Any,
    block: int,
    total: Any,
    history: Any,
    nothing: Any,
    no_pressures: Any,
) -> None:
    """Run one lane and add its prediction errors to the block sums in `total` (NaN with gaps)."""
    samples = len(commands)
    shown0 = y[Y_AGONIST + S_PRESSURE] - c[C_AMBIENT]
    shown1 = y[Y_AGONIST + N_MUSCLE_STATES + S_PRESSURE] - c[C_AMBIENT]
    blocks = len(total)
    delay = sensors[K_DELAY] / sample_time
    whole = math.floor(delay)
    share = delay - whole
    for k in range(samples):
        history[k] = y[Y_POSITION]
        at = min(k // block, blocks - 1)
        counted = k < blocks * block
        anew = window > 0 and k % window == 0
        if anew or window in (FOLLOW_MOTION, FOLLOW_BOTH):
            y[Y_POSITION] = restart[k, POSITION] - sensors[K_OFFSET]
            y[Y_VELOCITY] = restart[k, SPEED]
        if anew or window in (FOLLOW_PRESSURES, FOLLOW_BOTH):
            for i in range(2):
                o = Y_AGONIST + i * N_MUSCLE_STATES
                s = i * N_MUSCLE_SENSORS
                gain, bias = sensors[s + K_GAIN], sensors[s + K_BIAS]
                gauge = true_pressure(restart[k, AGONIST_PRESSURE + i], gain, bias)
                y[o + S_PRESSURE] = gauge + c[C_AMBIENT]
                y[o + S_VALVE_PRESSURE] = gauge + c[C_AMBIENT]
        if anew:
            shown0 = y[Y_AGONIST + S_PRESSURE] - c[C_AMBIENT]
            shown1 = y[Y_AGONIST + N_MUSCLE_STATES + S_PRESSURE] - c[C_AMBIENT]
        for i in range(2):
            o = Y_AGONIST + i * N_MUSCLE_STATES
            has_tube = c[AGONIST + i * N_MUSCLE_CONSTANTS + M_TUBE] > 0.0
            true = y[o + (S_VALVE_PRESSURE if has_tube else S_PRESSURE)] - c[C_AMBIENT]
            shown = true
            s = i * N_MUSCLE_SENSORS
            gain, bias, lag = sensors[s + K_GAIN], sensors[s + K_BIAS], sensors[s + K_LAG]
            channel = AGONIST_PRESSURE + i
            if lag > 0.0:
                shown = shown0 if i == 0 else shown1
            error = measured[k, channel] - pressure_reading(shown, gain, bias)
            if counted:
                total[at, channel] += error if known[k, channel] else np.nan
            if known[k, channel]:
                pull = gains[FADE] * error / gain
                y[o + S_PRESSURE] += pull
                if has_tube:
                    y[o + S_VALVE_PRESSURE] += pull
                if lag > 0.0:
                    true += pull
                    shown += pull
            if lag > 0.0:
                shown += (1.0 - math.exp(-sample_time / lag)) * (true - shown)
                if i == 0:
                    shown0 = shown
                else:
                    shown1 = shown
        late = max(k - whole, 0)
        later = max(late - 1, 0)
        position = (1.0 - share) * history[late] + share * history[later]
        position += sensors[K_OFFSET]
        error = measured[k, POSITION] - position
        if counted:
            total[at, POSITION] += error if known[k, POSITION] else np.nan
        # The joint may still swing when the recording begins, so its motion is corrected at first.
        early = k * sample_time < gains[CATCH_TIME] and window in (0, FOLLOW_PRESSURES)
        if known[k, POSITION] and (early or gains[HOLD_POSITION] > 0.0):
            y[Y_POSITION] += (gains[CATCH_POSITION] if early else gains[HOLD_POSITION]) * error
            y[Y_VELOCITY] += (gains[CATCH_SPEED] if early else gains[HOLD_SPEED]) * error
        if len(external) > 0:
            c[C_EXTERNAL] = external[k]
        run(
            c, tables, commands, k, nothing, no_pressures, shut, sample_time, step, y, work, row,
        )  # fmt: skip
        for i in range(2):
            pull = row[0, O_AGONIST + i * N_MUSCLE_OUTPUTS + O_FORCE]
            channel = AGONIST_FORCE + i
            if counted:
                total[at, channel] += measured[k, channel] - pull if known[k, channel] else np.nan


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
    shut: bool = False,
    block: int = 4,
    catch_time: float = 1.0,
    catch_bandwidth: float = 15.0,
    threads: int = 1,
) -> Array:
    """Prediction errors of several plants along one recording.

    Parameters
    ----------
    constants : ndarray, shape (lanes, N_CONSTANTS)
        Constants of each plant.
    sensors : ndarray, shape (lanes, N_SENSORS)
        Sensor constants of each plant, from `pam_model.plant.sensors.sensor_constants`.
    tables : sequence of two ndarrays
        Force tables in the form that the plant expects.
    commands : ndarray, shape (N, 2)
        Valve commands as logged; each is held for one sample.
    measured, known : ndarray, shape (N, N_CHANNELS)
        Measurements, and whether they are true samples.
    initial : ndarray, shape (lanes, N_STATES)
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
    restart : ndarray, shape (N, 4), optional
        Measured pressures [Pa], position [rad] and speed [rad/s] for such a reset.
    external : ndarray, shape (N,), optional
        External torque on the joint [N m].
    shut : bool
        Whether the valves are shut.
    block : int
        Number of samples averaged into one row of the result.
    catch_time, catch_bandwidth : float
        Time at the start in which the motion is corrected [s], and the bandwidth of this
        correction [rad/s].
    threads : int
        Number of lanes that are simulated in parallel.

    Returns
    -------
    ndarray, shape (lanes, N // block, N_CHANNELS)
        Mean prediction error of each block in the channel's unit; NaN where a sample is missing.
    """
    lanes = constants.shape[0]
    samples = commands.shape[0]
    blocks = samples // block
    total = np.zeros((lanes, blocks, N_CHANNELS))
    pull = 1.0 - math.exp(-sample_time / horizon)
    caught = max(position_bandwidth, catch_bandwidth)
    gains = np.empty(N_GAINS)
    gains[FADE] = pull
    gains[HOLD_POSITION] = min(2.0 * position_bandwidth * sample_time, 1.0)
    gains[HOLD_SPEED] = position_bandwidth**2 * sample_time
    gains[CATCH_POSITION] = min(2.0 * caught * sample_time, 1.0)
    gains[CATCH_SPEED] = caught**2 * sample_time
    gains[CATCH_TIME] = catch_time

    anew = np.zeros((1, 4)) if restart is None else restart
    every = 0 if restart is None else window

    def one(lane: int) -> None:
        _observe(
            constants[lane].copy(),
            sensors[lane],
            tables,
            commands,
            measured,
            known,
            np.zeros(0) if external is None else external,
            shut,
            sample_time,
            step,
            gains,
            every,
            anew,
            initial[lane].copy(),
            np.zeros((6, N_STATES)),
            np.zeros((1, N_OUTPUTS)),
            block,
            total[lane],
            np.zeros(samples),
            np.zeros(0),
            np.zeros((0, 2)),
        )

    if threads > 1 and lanes > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(one, range(lanes)))
    else:
        for lane in range(lanes):
            one(lane)
    total /= block
    return total
