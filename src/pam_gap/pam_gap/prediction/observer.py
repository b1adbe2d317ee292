"""The plant run along a recording: commands in, measured pressures pulling the state back.

A Luenberger observer with one small, fixed gain on the pressures and none on the motion. A muscle
behind a shut valve integrates, so that a free run from the commands drifts away with any error;
with the pull the prediction forgets within `horizon` and its errors show what the model does not
know of the last fraction of a second, whatever the length of the recording. States that nothing
measures (spool, creep, thread friction, gas temperature, reservoir) evolve by the model along the
true history. Prediction errors of such an observer are what the diagnosis fits: the prediction
error method, Ljung, System Identification, chapters 4 and 7; multiple shooting with exponentially
fading windows.
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
# Gains towards the measurement: of the pressures, of the motion, of a motion that is caught first;
# and the time for that [s].
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
    """One lane; block sums of prediction errors go to `total`, NaN where a block has gaps."""
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
        # A joint still swinging when the recording begins is caught first.
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
        Of each plant.
    sensors : ndarray, shape (lanes, N_SENSORS)
        Of each plant, as pam_model.plant.sensors.sensor_constants gives them.
    tables : sequence of two ndarrays
        Force tables, as the plant takes them.
    commands : ndarray, shape (N, 2)
        As logged, each held for one sample.
    measured, known : ndarray, shape (N, N_CHANNELS)
        Measurements, and whether they are true samples.
    initial : ndarray, shape (lanes, N_STATES)
        States at the first sample.
    sample_time, step : float
        Of the recording and of the integration [s].
    horizon : float
        Time in which the pressures' pull fades an error [s]; infinite for none.
    position_bandwidth : float
        Above 0 the motion is pulled to the measured one too, with this bandwidth [rad/s].
    window : int
        Samples after which the state starts anew from `restart`; 0 for never; or one of
        FOLLOW_MOTION, FOLLOW_PRESSURES, FOLLOW_BOTH: these are the measured ones at all times.
    restart : ndarray, shape (N, 4), optional
        Measured pressures [Pa], position [rad] and its rate [rad/s] to start anew from.
    external : ndarray, shape (N,), optional
        Torque on the joint from outside [N m].
    shut : bool
        Valves are shut.
    block : int
        Samples averaged into one row of the result.
    catch_time, catch_bandwidth : float
        Time at the start in which the motion is pulled to the measured one [s], and the
        bandwidth of this pull [rad/s].
    threads : int
        Lanes run at once.

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
