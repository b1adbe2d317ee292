"""Prediction errors of a rig's plant along its recordings, as a function of a few parameters.

A `PredictionProblem` holds what does not change during a diagnosis: the recordings as arrays, their
noise, and the parameters of the rig file. Its method `predictor` returns the function that a fit
calls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.channel_order import AGONIST_PRESSURE, BOTH_PRESSURES, N_CHANNELS, POSITION
from pam_gap.prediction.channels import (
    Channels,
    beginning_of,
    channel_names,
    joint_channels,
)
from pam_gap.prediction.fit import Array, Predictor
from pam_gap.prediction.half_flow import half_flow
from pam_gap.prediction.local_polynomial import local_polynomial
from pam_gap.prediction.observer import FOLLOW_BOTH, FOLLOW_MOTION, FOLLOW_PRESSURES, observe
from pam_gap.recordings.recording import (
    LOCKED,
    SHUT,
    TURNED_OVER,
    Recording,
)
from pam_gap.rules import DEFAULT, Rules
from pam_model.physics.pressure_sensor import true_pressure
from pam_model.plant.compiled import for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.layout import (
    C_AMBIENT,
    C_SUPPLY,
    C_TEMPERATURE,
    M_REGULATOR,
    S_PRESSURE,
    S_SPOOL,
    S_TEMPERATURE,
    S_VALVE_PRESSURE,
    Y_POSITION,
    Y_RESERVOIR,
    constants_of,
    states_of,
)
from pam_model.plant.mounting import locked, turned_over
from pam_model.plant.muscle_arms import SIDES
from pam_model.plant.parameters import INDEX, PlantParameters
from pam_model.plant.sensors import K_BIAS, K_GAIN, K_OFFSET, N_MUSCLE_SENSORS, sensor_constants
from pam_model.rig import Rig

DIVERGED = 1e6
"""Largest error of a prediction in units of the noise, and that of a simulation that diverges."""


@dataclass(frozen=True, slots=True)
class PredictionSettings:
    """How strongly a prediction is corrected by the measurements; the default is that of a fit."""

    # time constant of the correction of the pressures [s]; infinite for a free run, None for the
    # horizon of the problem's rules
    horizon: float | None = None
    # if above 0, the motion is corrected towards the measured one with this bandwidth [rad/s]
    position_bandwidth: float = 0.0
    # if above 0, the state is reset to the measurements each time this time has passed [s]
    window_time: float = 0.0
    # follow_motion, follow_pressures: Whether the motion or the pressures are set to the measured
    # ones in every sample. The pressures always are where no valve commands were recorded.
    follow_motion: bool = False
    follow_pressures: bool = False
    # whether the pressures are predicted along the measured motion, and motion and forces along the
    # measured pressures, so that no error of one passes on to the other; it needs valve commands
    apart: bool = False
    # if given, one more draw of the channels' noise is added to the measurements
    noise_seed: int | None = None


AS_FITTED = PredictionSettings()


def as_mounted(values: Array, mounting: str) -> Array:
    """Parameter vectors (lanes, n_parameters), changed for the mounting during one recording."""
    if mounting == TURNED_OVER:
        return turned_over(values)
    return locked(values) if mounting == LOCKED else values


def initial_states(constants: Array, sensors: Array, data: Channels) -> Array:
    """The plants' states at the first sample: at rest, without creep and thread friction.

    Parameters
    ----------
    constants, sensors : ndarray, shape (lanes, n_constants) and (lanes, n_sensors)
        Of each plant.
    data : Channels
        The recording.
    """
    first = data.measured[: min(10, len(data.measured))].mean(axis=0)
    y = np.zeros((len(constants), states_of(len(SIDES))))
    y[:, Y_RESERVOIR] = constants[:, C_SUPPLY]
    if data.known[:, POSITION].any():
        y[:, Y_POSITION] = first[POSITION] - sensors[:, K_OFFSET]
    for i in range(2):
        m, o = constants_of(i), states_of(i)
        s = i * N_MUSCLE_SENSORS
        reading = first[AGONIST_PRESSURE + i]
        gauge = true_pressure(reading, sensors[:, s + K_GAIN], sensors[:, s + K_BIAS])
        inside = np.maximum(gauge + constants[:, C_AMBIENT], 1.0)
        y[:, o + S_PRESSURE] = y[:, o + S_VALVE_PRESSURE] = inside
        is_regulator = constants[:, m + M_REGULATOR] > 0.0
        y[:, o + S_SPOOL] = np.where(is_regulator, gauge, data.commands[0, i])
        y[:, o + S_TEMPERATURE] = constants[:, C_TEMPERATURE]
    return y


def restart_values(measured: Array, sample_time: float) -> Array:
    """Pressures, position and speed at every sample from local polynomials, shape (N, 4)."""
    width = max(3, round(0.012 / sample_time) // 2 * 2 + 1)
    wide = 3 * width
    pressures = local_polynomial(measured[:, BOTH_PRESSURES], wide, 2)
    angle = measured[:, POSITION : POSITION + 1]
    position = local_polynomial(angle, width, 1)
    rate = local_polynomial(angle, 2 * width + 1, 2, derivative=1, step=sample_time)
    result: Array = np.concatenate([pressures, position, rate], axis=1)
    return result


def whiten(errors: Array, deviation: Array, compared: npt.NDArray[np.bool_]) -> None:
    """Write errors in units of their noise over errors in the channels' units.

    Parameters
    ----------
    errors : ndarray, shape (lanes, blocks, N_CHANNELS)
        Errors; a simulation that diverges is off by `DIVERGED`.
    deviation : ndarray, shape (N_CHANNELS,)
        Noise of the mean of a block.
    compared : ndarray of bool, shape (blocks, N_CHANNELS)
        What was measured; the rest becomes NaN.
    """
    for error in errors:  # one by one, because copies of all of them need much memory
        np.divide(error, deviation, out=error)
        diverged = ~np.isfinite(error)
        np.clip(error, -DIVERGED, DIVERGED, out=error)
        error[diverged] = DIVERGED
        error[~compared] = np.nan


class PredictionProblem:
    """One joint of a rig, with one or more recordings of it.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    joint : int
        Number of the joint.
    rules : Rules
        Hand-set constants of the diagnosis.
    threads : int
        Number of lanes that are simulated in parallel.
    usual : PredictionSettings
        How strongly predictions are corrected where nothing else is said.
    sides : int
        Number of muscles that exist: 1 for a muscle on a bench, whose joint is invented
        (`pam_gap.prediction.bench_joint`).
    """

    def __init__(
        self,
        rig: Rig,
        joint: int,
        recordings: Sequence[Recording],
        *,
        rules: Rules = DEFAULT,
        threads: int = 1,
        usual: PredictionSettings = AS_FITTED,
        sides: int = 2,
    ) -> None:
        self.rig = rig
        self.usual = usual
        self.sides = SIDES[:sides]
        self.joint = joint
        self.names = channel_names(rig, joint)
        self.rules = rules
        self.data = tuple(joint_channels(r, rig, joint, rules) for r in recordings)
        self.base = PlantParameters.from_rig(rig, joint)
        self.threads = threads
        self.has_commands = all(data.has_commands for data in self.data)
        self.tables = tuple(for_kernel(table) for table in self.base.tables)
        self.recorded = np.array(
            [all(np.isfinite(data.deviation[i]) for data in self.data) for i in range(N_CHANNELS)]
        )
        votes = np.array([data.votes for data in self.data])
        self.present = np.logical_and(self.recorded, votes.any(axis=0))
        if not self.has_commands:
            # Without commands the measured pressures are inputs, so they have no prediction error.
            self.present[BOTH_PRESSURES] = False
        self._set_rows()
        self.simulations = 0.0

    @property
    def is_bench(self) -> bool:
        """Whether the joint is invented, and nothing of it is known but one muscle."""
        return len(self.sides) == 1

    @property
    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles that exist."""
        return self.rig.joints[self.joint].muscles[: len(self.sides)]

    @property
    def n_rows(self) -> int:
        """Number of rows of the error array."""
        return int(self.offsets[-1])

    def errors(self, values: Array, settings: PredictionSettings | None = None) -> Array:
        """Whitened prediction errors of plants that are given as full parameter vectors.

        Parameters
        ----------
        values : ndarray, shape (lanes, n_parameters)
            In the order of `pam_model.plant.parameters.NAMES`.
        settings : PredictionSettings, optional
            How strongly the predictions are corrected by the measurements; by default as `usual`.

        Returns
        -------
        ndarray, shape (lanes, n_rows, N_CHANNELS)
            In units of the block's noise; NaN where nothing was measured, and only there. A
            simulation that diverges is off by `DIVERGED`.
        """
        parts = []
        settings = self.usual if settings is None else settings
        if settings.apart and self.has_commands:
            alone = replace(settings, apart=False)
            found = self.errors(values, replace(alone, follow_motion=True))
            body = self.errors(values, replace(alone, follow_pressures=True))
            others = np.delete(np.arange(N_CHANNELS), BOTH_PRESSURES)
            found[..., others] = body[..., others]
            return found
        followed = settings.follow_pressures or not self.has_commands
        rules = self.rules.prediction
        horizon = rules.horizon if settings.horizon is None else settings.horizon
        window = 0
        if followed:
            window = FOLLOW_BOTH if settings.follow_motion else FOLLOW_PRESSURES
        elif settings.follow_motion:
            window = FOLLOW_MOTION
        for data, compared in zip(self.data, self.compared, strict=True):
            mounted = as_mounted(values, data.recording.mounting)
            constants = derive_constants(mounted)
            data.arm.apply(constants)
            sensors = sensor_constants(mounted)
            measured = data.measured
            if settings.noise_seed is not None:
                generator = np.random.default_rng(settings.noise_seed)
                scale = np.nan_to_num(data.deviation)
                measured = measured + scale * generator.standard_normal(measured.shape)
            sample_time = data.recording.sample_time
            initial = initial_states(constants, sensors, data)
            restart = None
            if settings.window_time > 0.0 or window:
                restart = restart_values(measured, sample_time)
            if restart is not None and window == FOLLOW_PRESSURES:
                restart = np.hstack([restart, half_flow(self.rig, self.joint, restart)])
            error = observe(
                constants,
                sensors,
                self.tables,
                data.commands,
                measured,
                data.known,
                initial,
                sample_time=sample_time,
                step=rules.step,
                horizon=np.inf if followed else horizon,
                position_bandwidth=settings.position_bandwidth,
                window=window if window else round(settings.window_time / sample_time),
                restart=restart,
                external=data.external,
                drawn=data.drawn,
                shut=followed or data.recording.mounting == SHUT,
                block=data.block,
                catch_time=rules.catch_time,
                catch_bandwidth=rules.catch_bandwidth,
                threads=self.threads,
            )
            whiten(error, data.block_deviation, compared)
            parts.append(error)
        self.simulations += len(values)
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)

    def _set_rows(self) -> None:
        """Number the rows of the errors of all recordings, and find out what each compares."""
        self.compared = tuple(self._compared(data) for data in self.data)
        rows = [len(data.measured) // data.block for data in self.data]
        self.offsets = np.concatenate(([0], np.cumsum(rows)))
        self.row_time = np.concatenate(
            [
                (np.arange(count) + 0.5) * data.row_time
                for count, data in zip(rows, self.data, strict=True)
            ]
        )
        self.counted = self.row_time > self.rules.prediction.settling

    def _compared(self, data: Channels) -> npt.NDArray[np.bool_]:
        """Whether a row of the errors of one recording compares each channel."""
        rows = len(data.measured) // data.block
        known = data.known[: rows * data.block].reshape(rows, data.block, N_CHANNELS).all(axis=1)
        compared: npt.NDArray[np.bool_] = known & data.votes & np.isfinite(data.block_deviation)
        return compared

    def with_data(self, change: Callable[[Channels], Channels]) -> PredictionProblem:
        """The same problem with other commands or measurements."""
        other = copy(self)
        other.data = tuple(change(data) for data in self.data)
        other.compared = tuple(other._compared(data) for data in other.data)
        return other

    def beginning(self, seconds: float) -> PredictionProblem:
        """The same problem with the beginning of each recording, which needs less time.

        Noise and channels are those of whole recordings. The errors of a plant are the first rows
        of those along the whole recording.
        """
        other = copy(self)
        other.data = tuple(beginning_of(data, seconds) for data in self.data)
        other._set_rows()
        other.simulations = 0.0
        return other

    def based_on(self, changes: Mapping[str, float]) -> PredictionProblem:
        """The same problem with other numbers of the rig file, by plant parameter."""
        other = copy(self)
        other.base = self.base.forced(changes)
        return other

    def with_usual(self, usual: PredictionSettings) -> PredictionProblem:
        """The same problem with predictions that are corrected in another way."""
        other = copy(self)
        other.usual = usual
        return other

    def with_step(self, step: float) -> PredictionProblem:
        """The same problem with another longest step of the integration [s]."""
        other = copy(self)
        other.rules = replace(self.rules, prediction=replace(self.rules.prediction, step=step))
        return other

    def predictor(
        self, base: Array, targets: Sequence[Sequence[str]], is_factor: Sequence[bool]
    ) -> Predictor:
        """Return a function from lanes of free parameters to whitened errors.

        Parameters
        ----------
        base : ndarray, shape (n_parameters,)
            Full vector into which the free parameters are written.
        targets : sequence of sequence of str
            Names of the plant parameters that each free parameter sets.
        is_factor : sequence of bool
            Whether a free parameter multiplies the value in `base` instead of replacing it.
        """
        places = [np.array([INDEX[name] for name in group]) for group in targets]

        def predict(lanes: Array) -> Array:
            return self.errors(self.vectors(base, places, is_factor, lanes))

        return predict

    @staticmethod
    def vectors(
        base: Array,
        places: Sequence[npt.NDArray[np.int64]],
        is_factor: Sequence[bool],
        lanes: Array,
    ) -> Array:
        """Full parameter vectors for lanes of free parameters."""
        values = np.repeat(base[None, :], len(lanes), axis=0)
        for column, (place, factor) in enumerate(zip(places, is_factor, strict=True)):
            if factor:
                values[:, place] *= lanes[:, column : column + 1]
            else:
                values[:, place] = lanes[:, column : column + 1]
        return values
