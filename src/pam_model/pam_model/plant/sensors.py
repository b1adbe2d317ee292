"""The sensors: readings from the true quantities, by gain, bias, lag, offset and delay.

A pressure passes gain, bias and then the first-order lag; a position passes offset and delay.
Between samples a signal is linear, and for this the lag is solved exactly. At neutral values a
reading equals the true quantity.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_model.physics.pressure_sensor import pressure_reading
from pam_model.plant.constants import adjusted_numbers
from pam_model.plant.muscle_arms import PAIR, MuscleArms, names_of
from pam_model.plant.numbers_of_lanes import Numbers, rows_of

Array = npt.NDArray[np.float64]


# Constants of the sensors: two of the encoder, then three of the pressure sensor of muscle i, each
# at its place + i * N_MUSCLE_SENSORS.
K_OFFSET, K_DELAY, K_GAIN, K_BIAS, K_LAG = range(5)
N_MUSCLE_SENSORS = 3


def sensors_of(muscles: int) -> int:
    """Number of the constants of the sensors of a joint with so many muscles."""
    return K_GAIN + muscles * N_MUSCLE_SENSORS


def sensor_constants(values: Array, muscles: MuscleArms = PAIR) -> Array:
    """The constants of the sensors, indexed by the K_* above.

    Parameters
    ----------
    values : (n_parameters,) or (n_plant, n_parameters) array
        Plant parameters.
    muscles : tuple of MuscleArm, optional
        Those of the joint.

    Returns
    -------
    (n_sensors,) or (n_plant, n_sensors) array
        Offset [rad] and delay [s] of the position sensor; gain [-], bias [Pa] and lag [s] of each
        pressure sensor.
    """
    number = adjusted_numbers(values, muscles)
    sensors: list[Numbers] = [0.0] * sensors_of(len(muscles))
    for i, muscle in enumerate(names_of(muscles)):
        k = i * N_MUSCLE_SENSORS
        sensors[k + K_GAIN] = number[f"{muscle}.pressure_sensor.gain"]
        sensors[k + K_BIAS] = number[f"{muscle}.pressure_sensor.bias"]
        sensors[k + K_LAG] = number[f"{muscle}.pressure_sensor.lag"]
    sensors[K_OFFSET] = number["position_sensor.offset"]
    sensors[K_DELAY] = number["position_sensor.delay"]
    return rows_of(sensors, values)


@dataclass(frozen=True, eq=False)
class Measured:
    """The measured channels."""

    position: Array  # [rad]
    pressures: Array  # gauge [Pa]


def lag_weights(time_constant: float, duration: float) -> tuple[float, float, float]:
    """Weights of a first-order lag with linear input: y1 = keep y0 + before u0 + after u1."""
    if time_constant <= 0.0:
        return 0.0, 0.0, 1.0
    x = duration / time_constant
    keep = math.exp(-x)
    mean = -math.expm1(-x) / x
    return keep, mean - keep, 1.0 - mean


def measure(
    values: Array, time: Array, position: Array, pressures: Array, muscles: MuscleArms = PAIR
) -> Measured:
    """Pass true signals through the sensors.

    Parameters
    ----------
    values : (n_parameters,) or (n_lane, n_parameters) array
        Plant parameters.
    time : (n,) array
        Equally spaced [s].
    position : (..., n) array
        [rad].
    pressures : (..., n, n_muscles) array
        Gauge pressure at the sensors [Pa].
    muscles : tuple of MuscleArm, optional
        Those of the joint.
    """
    if values.ndim == 2:
        lanes = [
            measure(one, time, position[i], pressures[i], muscles) for i, one in enumerate(values)
        ]
        return Measured(
            np.stack([lane.position for lane in lanes]),
            np.stack([lane.pressures for lane in lanes]),
        )
    sample_time = float(time[1] - time[0]) if len(time) > 1 else 1.0
    sensors = sensor_constants(values, muscles)
    seen = position + sensors[K_OFFSET]
    delay = float(sensors[K_DELAY])
    if delay > 0.0:
        seen = np.interp(time - delay, time, seen)
    shown = np.empty_like(pressures)
    from scipy.signal import lfilter  # noqa: PLC0415  (costs every node a second)

    for i in range(len(muscles)):
        k = i * N_MUSCLE_SENSORS
        lag = float(sensors[k + K_LAG])
        signal = pressure_reading(pressures[:, i], sensors[k + K_GAIN], sensors[k + K_BIAS])
        if lag > 0.0 and len(signal) > 1:
            keep, before, after = lag_weights(lag, sample_time)
            # The filter starts in steady state at the first sample.
            start = [(1.0 - after) * signal[0]]
            signal = lfilter([after, before], [1.0, -keep], signal, zi=start)[0]
        shown[:, i] = signal
    return Measured(seen, shown)


class SensorFilter:
    """The same sensors as `measure`, one sample at a time.

    Parameters
    ----------
    values : (n_parameters,) array
        Plant parameters.
    muscles : tuple of MuscleArm, optional
        Those of the joint.
    """

    def __init__(self, values: Array, muscles: MuscleArms = PAIR) -> None:
        sensors: list[float] = sensor_constants(values, muscles).tolist()
        of_muscles = range(0, len(muscles) * N_MUSCLE_SENSORS, N_MUSCLE_SENSORS)
        self._offset, self._delay = sensors[K_OFFSET], sensors[K_DELAY]
        self._gain = [sensors[k + K_GAIN] for k in of_muscles]
        self._bias = [sensors[k + K_BIAS] for k in of_muscles]
        self._lag = [sensors[k + K_LAG] for k in of_muscles]
        self._last_time: float | None = None
        self._last_input = [0.0] * len(muscles)
        self._last_output = [0.0] * len(muscles)
        self._times: deque[float] = deque()
        self._positions: deque[float] = deque()

    def update(self, time: float, position: float, pressures: Sequence[float]) -> tuple[float, ...]:
        """Readings of position [rad] and all gauge pressures [Pa] at `time` [s]."""
        shown = []
        for i, pressure in enumerate(pressures):
            signal = pressure_reading(pressure, self._gain[i], self._bias[i])
            output = signal
            if self._lag[i] > 0.0 and self._last_time is not None:
                keep, before, after = lag_weights(self._lag[i], time - self._last_time)
                output = keep * self._last_output[i] + before * self._last_input[i] + after * signal
            self._last_input[i], self._last_output[i] = signal, output
            shown.append(output)
        self._last_time = time
        return self._late(time, position + self._offset), *shown

    def _late(self, time: float, position: float) -> float:
        if self._delay <= 0.0:
            return position
        self._times.append(time)
        self._positions.append(position)
        then = time - self._delay
        while len(self._times) > 2 and self._times[1] <= then:
            self._times.popleft()
            self._positions.popleft()
        at = bisect_right(self._times, then)
        if at == 0:
            return self._positions[0]
        if at == len(self._times):
            return self._positions[-1]
        t0, t1 = self._times[at - 1], self._times[at]
        q0, q1 = self._positions[at - 1], self._positions[at]
        return q0 + (q1 - q0) * (then - t0) / (t1 - t0)


class SensorBank:
    """The sensors of many joints, one sample of a constant period at a time.

    Parameters
    ----------
    values : (n, n_parameters) array
        Plant parameters of each joint.
    period : float
        Between two samples [s].
    """

    def __init__(self, values: Array, period: float, muscles: MuscleArms = PAIR) -> None:
        n = len(values)
        self._period, self._muscles = period, muscles
        self._k = sensor_constants(values, muscles)
        self._weights = np.zeros((n, len(muscles), 3))
        self._fresh = np.full(n, True)
        self._last_input = np.zeros((n, len(muscles)))
        self._last_output = np.zeros((n, len(muscles)))
        self._positions = np.zeros((n, 1))
        self._prepare()

    def _prepare(self) -> None:
        lags = self._k[:, K_LAG::N_MUSCLE_SENSORS]
        self._gain = self._k[:, K_GAIN::N_MUSCLE_SENSORS]
        self._bias = self._k[:, K_BIAS::N_MUSCLE_SENSORS]
        self._weights = np.array([[lag_weights(lag, self._period) for lag in row] for row in lags])
        self._is_prompt = not (lags.any() or self._k[:, K_DELAY].any())
        late = self._k[:, K_DELAY] / self._period
        whole = np.floor(late).astype(int)
        self._share = late - whole
        rows = int(whole.max()) + 2
        kept = self._positions[:, -rows:]
        self._positions = np.concatenate(
            [np.repeat(kept[:, :1], rows - kept.shape[1], axis=1), kept], axis=1
        )
        self._newer = rows - 1 - whole

    def restart(self, chosen: npt.NDArray[np.bool_], values: Array) -> None:
        """Sensors of other joints, `chosen` (n,) among all; parameters as for the constructor."""
        self._k[chosen] = sensor_constants(values, self._muscles)
        self._fresh[chosen] = True
        self._prepare()

    def update(self, chosen: npt.NDArray[np.bool_], position: Array, pressures: Array) -> Array:
        """Readings of the next sample of the chosen joints.

        Parameters
        ----------
        chosen : (n,) array of bool
            The joints whose sample it is.
        position, pressures : (n,), (n, n_muscles) array
            True position [rad] and gauge pressures [Pa] of all joints.

        Returns
        -------
        (n, 1 + n_muscles) array
            Position [rad] and all gauge pressures [Pa]; only those of the chosen joints count.
        """
        signal = pressure_reading(pressures, self._gain, self._bias)
        seen = position + self._k[:, K_OFFSET]
        if self._is_prompt:
            return np.concatenate([seen[:, None], signal], axis=1)
        keep, before, after = np.moveaxis(self._weights, -1, 0)
        output = keep * self._last_output + before * self._last_input + after * signal
        first = (self._fresh & chosen)[:, None]
        output = np.where(first, signal, output)
        moved = np.concatenate([self._positions[:, 1:], seen[:, None]], axis=1)
        moved = np.where(first, seen[:, None], moved)
        at = chosen[:, None]
        self._last_input = np.where(at, signal, self._last_input)
        self._last_output = np.where(at, output, self._last_output)
        self._positions = np.where(at, moved, self._positions)
        self._fresh &= ~chosen
        lanes = np.arange(len(chosen))
        newer, older = self._positions[lanes, self._newer], self._positions[lanes, self._newer - 1]
        shown = newer + (older - newer) * self._share
        return np.concatenate([shown[:, None], output], axis=1)
