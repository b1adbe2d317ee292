"""Prediction errors of a rig's plant along its recordings, as a function of a few parameters.

One `PredictionProblem` holds what never changes during a diagnosis: recordings as arrays, noise,
written parameters. `predictor` turns a list of parameters into the function a fit calls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from pam_gap.prediction.fit import Array, Predictor
from pam_gap.prediction.observer import (
    FOLLOW_BOTH,
    FOLLOW_MOTION,
    FOLLOW_PRESSURES,
    N_CHANNELS,
    observe,
)
from pam_gap.recordings.noise_floor import ChannelNoise, noise_floor
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    LOCKED,
    MUSCLES,
    PRESSURES,
    SHUT,
    TURNED_OVER,
    Recording,
    RecordingError,
)
from pam_model.plant.compiled import for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.layout import (
    AGONIST,
    C_AMBIENT,
    C_SUPPLY,
    C_TEMPERATURE,
    M_REGULATOR,
    N_MUSCLE_CONSTANTS,
    N_MUSCLE_STATES,
    N_STATES,
    S_PRESSURE,
    S_SPOOL,
    S_TEMPERATURE,
    S_VALVE_PRESSURE,
    Y_AGONIST,
    Y_POSITION,
    Y_RESERVOIR,
)
from pam_model.plant.parameters import INDEX, PlantParameters
from pam_model.plant.sensors import sensor_constants
from pam_model.rig import Rig

STEP = 2e-3  # s, longest of the integration; 0.5 ms gives the same errors to 1e-4 of their size
HORIZON = 0.3  # s, in which a pressure error fades
SETTLING = 1.5  # s at the start that no score counts: what the plant remembers is not known yet
BLOCK = 4  # samples averaged into one row
LOCKED_INERTIA = 1e9  # kg m^2, of a joint that does not move
LOCKED_DECAY = 100.0  # 1/s, of the speed that catching its position leaves


@dataclass(frozen=True, slots=True)
class Channels:
    """One recording as the observer takes it.

    Attributes
    ----------
    recording : Recording
        Where it came from.
    commands : ndarray, shape (N, 2)
        Valve commands, 0 where the recording has none.
    measured, known : ndarray, shape (N, N_CHANNELS)
        Pressures, position, pulls; whether each is a true sample.
    deviation : ndarray, shape (N_CHANNELS,)
        White noise of one sample, channel's unit; NaN for a channel that is not there.
    block_deviation : ndarray, shape (N_CHANNELS,)
        Noise of a block's mean: quantisation does not average out at rest.
    has_commands : bool
        Whether valve commands were recorded, or are known since the valves were shut.
    external : ndarray, shape (N,) or None
        Torque on the joint from outside [N m], where recorded.
    """

    recording: Recording
    commands: Array
    measured: Array
    known: npt.NDArray[np.bool_]
    deviation: Array
    block_deviation: Array
    has_commands: bool
    external: Array | None = None


@dataclass(frozen=True, slots=True)
class PredictionSettings:
    """How far a prediction is held to the measurements; as a fit sees it by default.

    Attributes
    ----------
    horizon : float or None
        Time in which a pressure error fades [s]; infinite for a free run, None for the problem's.
    position_bandwidth : float
        Above 0 the motion follows the measured one [rad/s].
    window_time : float
        Above 0 the state starts anew from the measurements after this time [s].
    follow_motion, follow_pressures : bool
        The motion, the pressures are the measured ones; pressures always where no commands tell
        what they should do.
    noise_seed : int or None
        Adds one more draw of the channels' noise to the measurements.
    """

    horizon: float | None = None
    position_bandwidth: float = 0.0
    window_time: float = 0.0
    follow_motion: bool = False
    follow_pressures: bool = False
    noise_seed: int | None = None


AS_FITTED = PredictionSettings()


def channel_names(rig: Rig, joint: int) -> tuple[str, ...]:
    """The N_CHANNELS channels of one joint by contract name, in the observer's order."""
    entry = rig.joints[joint]
    return (
        *(f"{PRESSURES}{m}" for m in entry.muscles),
        f"{JOINTS}{entry.name}.position",
        *(f"{MUSCLES}{m}.effort" for m in entry.muscles),
    )


def joint_channels(recording: Recording, rig: Rig, joint: int) -> Channels:
    """Pick one joint's channels out of a recording.

    Raises
    ------
    RecordingError
        When the pressures are missing.
    """
    names = channel_names(rig, joint)
    missing = [name for name in names[:2] if not recording.has(name)]
    if missing:
        raise RecordingError(
            f"{recording.source}: no channel {', '.join(missing)} [Pa gauge]; a diagnosis needs "
            "both pressures"
        )
    count = recording.time.size
    measured = np.zeros((count, N_CHANNELS))
    known = np.zeros((count, N_CHANNELS), dtype=np.bool_)
    noise: dict[str, ChannelNoise] = dict(noise_floor(recording))
    deviation = np.full(N_CHANNELS, np.nan)
    block_deviation = np.full(N_CHANNELS, np.nan)
    for i, name in enumerate(names):
        if recording.has(name):
            measured[:, i] = recording.values[name]
            known[:, i] = recording.valid[name]
            deviation[i] = noise[name].deviation
            block_deviation[i] = np.sqrt(
                noise[name].deviation ** 2 / BLOCK + noise[name].resolution ** 2 / 12.0
            )
    commands = np.zeros((count, 2))
    command_names = [f"{COMMANDS}{m}" for m in rig.joints[joint].muscles]
    torque = recording.values.get(f"{JOINTS}{rig.joints[joint].name}.effort")
    is_shut = recording.mounting == SHUT
    has_commands = is_shut or all(recording.has(name) for name in command_names)
    if has_commands and not is_shut:
        for i, name in enumerate(command_names):
            commands[:, i] = recording.values[name]
    return Channels(
        recording, commands, measured, known, deviation, block_deviation, has_commands, torque
    )


def as_mounted(values: Array, mounting: str) -> Array:
    """Parameter vectors (lanes, n_parameters) of a rig mounted for one recording."""
    if not mounting:
        return values
    mounted: Array = np.array(values)
    if mounting == TURNED_OVER:
        mounted[:, INDEX["joint.gravity_angle"]] += np.pi
    elif mounting == LOCKED:
        mounted[:, INDEX["joint.inertia"]] = LOCKED_INERTIA
        mounted[:, INDEX["joint.viscous_friction"]] = LOCKED_DECAY * LOCKED_INERTIA
    return mounted


def initial_state(constants: Array, sensors: Array, tables: object, data: Channels) -> Array:
    """The plant's state at the first sample: at rest, creep relaxed, thread friction free."""
    start = slice(0, min(10, len(data.measured)))
    y = np.zeros(N_STATES)
    y[Y_RESERVOIR] = constants[C_SUPPLY]
    y[Y_POSITION] = (
        float(data.measured[start, 2].mean()) - sensors[6] if data.known[:, 2].any() else 0.0
    )
    for i in range(2):
        m = AGONIST + i * N_MUSCLE_CONSTANTS
        o = Y_AGONIST + i * N_MUSCLE_STATES
        gauge = (float(data.measured[start, i].mean()) - sensors[3 * i + 1]) / sensors[3 * i]
        y[o + S_PRESSURE] = y[o + S_VALVE_PRESSURE] = max(gauge + constants[C_AMBIENT], 1.0)
        y[o + S_SPOOL] = gauge if constants[m + M_REGULATOR] > 0.0 else data.commands[0, i]
        y[o + S_TEMPERATURE] = constants[C_TEMPERATURE]
    return y


def restart_values(measured: Array, sample_time: float) -> Array:
    """Pressures, position and its rate at every sample by local polynomials, shape (N, 4)."""
    width = max(3, round(0.012 / sample_time) // 2 * 2 + 1)
    wide = 3 * width
    pressures = savgol_filter(measured[:, :2], wide, 2, axis=0)
    position = savgol_filter(measured[:, 2:3], width, 1, axis=0)
    rate = savgol_filter(measured[:, 2:3], 2 * width + 1, 2, deriv=1, delta=sample_time, axis=0)
    result: Array = np.concatenate([pressures, position, rate], axis=1)
    return result


class PredictionProblem:
    """One joint of a rig, with one or more recordings of it.

    Parameters
    ----------
    rig : Rig
        As written.
    joint : int
        Which of its joints.
    recordings : sequence of Recording
        Of the same rig.
    horizon : float
        Time in which a pressure error fades [s].
    threads : int
        Lanes run at once.
    """

    def __init__(
        self,
        rig: Rig,
        joint: int,
        recordings: Sequence[Recording],
        *,
        horizon: float = HORIZON,
        threads: int = 1,
    ) -> None:
        self.rig = rig
        self.joint = joint
        self.names = channel_names(rig, joint)
        self.data = tuple(joint_channels(recording, rig, joint) for recording in recordings)
        self.base = PlantParameters.from_rig(rig, joint)
        self.horizon = horizon
        self.threads = threads
        self.has_commands = all(data.has_commands for data in self.data)
        self.tables = tuple(for_kernel(table) for table in self.base.tables)
        self.present = np.array(
            [all(np.isfinite(data.deviation[i]) for data in self.data) for i in range(N_CHANNELS)]
        )
        self.recorded = self.present.copy()
        if not self.has_commands:
            # Without commands the pressures are inputs: they follow the measured ones.
            self.present[:2] = False
        rows = [len(data.measured) // BLOCK for data in self.data]
        self.offsets = np.concatenate(([0], np.cumsum(rows)))
        self.row_time = np.concatenate(
            [
                (np.arange(count) + 0.5) * BLOCK * data.recording.sample_time
                for count, data in zip(rows, self.data, strict=True)
            ]
        )
        self.counted = self.row_time > SETTLING
        self.simulations = 0.0

    @property
    def n_rows(self) -> int:
        """Rows of the error array."""
        return int(self.offsets[-1])

    def errors(
        self,
        values: Array,
        settings: PredictionSettings = AS_FITTED,
    ) -> Array:
        """Whitened prediction errors of plants given as full parameter vectors.

        Parameters
        ----------
        values : ndarray, shape (lanes, n_parameters)
            In the order of `plant_parameters.NAMES`.
        settings : PredictionSettings
            How far the predictions are held to the measurements.

        Returns
        -------
        ndarray, shape (lanes, n_rows, N_CHANNELS)
            In units of the block's noise; NaN where nothing is known, infinite never.
        """
        parts = []
        followed = settings.follow_pressures or not self.has_commands
        horizon = self.horizon if settings.horizon is None else settings.horizon
        window = 0
        if followed:
            window = FOLLOW_BOTH if settings.follow_motion else FOLLOW_PRESSURES
        elif settings.follow_motion:
            window = FOLLOW_MOTION
        for data in self.data:
            mounted = as_mounted(values, data.recording.mounting)
            constants = np.array([derive_constants(v) for v in mounted])
            sensors = np.array([sensor_constants(v) for v in mounted])
            measured = data.measured
            if settings.noise_seed is not None:
                generator = np.random.default_rng(settings.noise_seed)
                scale = np.nan_to_num(data.deviation)
                measured = measured + scale * generator.standard_normal(measured.shape)
            sample_time = data.recording.sample_time
            initial = np.array(
                [
                    initial_state(c, s, self.tables, data)
                    for c, s in zip(constants, sensors, strict=True)
                ]
            )
            error = observe(
                constants,
                sensors,
                self.tables,
                data.commands,
                measured,
                data.known,
                initial,
                sample_time=sample_time,
                step=STEP,
                horizon=np.inf if followed else horizon,
                position_bandwidth=settings.position_bandwidth,
                window=window if window else round(settings.window_time / sample_time),
                restart=restart_values(measured, sample_time)
                if settings.window_time > 0.0 or window
                else None,
                external=data.external,
                shut=followed or data.recording.mounting == SHUT,
                block=BLOCK,
                threads=self.threads,
            )
            parts.append(error / data.block_deviation)
        self.simulations += len(values)
        result = np.concatenate(parts, axis=1)
        return np.clip(result, -1e6, 1e6)

    def predictor(
        self, base: Array, targets: Sequence[Sequence[str]], is_factor: Sequence[bool]
    ) -> Predictor:
        """A function from lanes of free parameters to whitened errors.

        Parameters
        ----------
        base : ndarray, shape (n_parameters,)
            Full vector that the free parameters are written into.
        targets : sequence of sequence of str
            Plant parameters of each free one.
        is_factor : sequence of bool
            Whether it multiplies the base's value instead of replacing it.
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
        """Full parameter vectors of lanes of free parameters."""
        values = np.repeat(base[None, :], len(lanes), axis=0)
        for column, (place, factor) in enumerate(zip(places, is_factor, strict=True)):
            if factor:
                values[:, place] *= lanes[:, column : column + 1]
            else:
                values[:, place] = lanes[:, column : column + 1]
        return values
