"""First numbers of a joint and its valves, by linear regression on measured signals.

A fit of a simulation needs a start in the right valley. These regressions need none: every input is
measured, and the unknown numbers enter linearly. Both sides of each balance pass the same low-pass
filter, which does not change the balance and makes derivatives of measured signals usable (the
method of filtered equation errors; Ljung, System Identification, section 7.3 and 10.1). Small
relative changes of the lengths, which are stated with a tolerance, enter to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, lfilter, sosfiltfilt

from pam_model.errors import PamError
from pam_model.gas import GAS_CONSTANT
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig.types import Muscle, Rig
from pam_model.robot.compose import compose
from pam_model.views.gas_volume import gas_volume
from pam_model.views.muscle_path import path_length
from pam_model.views.pressure_rate import valve_mass_flow

Array = npt.NDArray[np.float64]
CORNER = 6.0  # Hz, of the low-pass filter; a share of the sample rate where that is low
FEWEST_PER_CORNER = 8.0  # samples per period of the corner
ROWS_PER_SECOND = 40.0  # of the regression
SETTLING = 1.0  # s at either end, where the filter has no neighbours
SMALL = 1e-3  # relative change of a length, for derivatives
LENGTHS = ("thread_length", "neutral_length", "turns")
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class MotionRecord:
    """Signals of one joint at a constant rate."""

    sample_time: float  # [s]
    commands: Array | None  # shape (N, 2): of the valves, agonist first
    pressures: Array  # shape (N, 2): [Pa gauge]
    position: Array  # shape (N,): [rad]
    turned: float = 0.0  # angle by which the joint is mounted differently from the rig file [rad]


def corner_of(sample_time: float) -> float:
    """Corner of the low-pass filter for signals of this sample time [Hz]."""
    return min(CORNER, 1.0 / (FEWEST_PER_CORNER * sample_time))


def smooth(values: Array, sample_time: float) -> Array:
    """Signals behind a low-pass filter without lag, along the first axis."""
    sections = butter(2, corner_of(sample_time), fs=1.0 / sample_time, output="sos")
    result: Array = sosfiltfilt(sections, values, axis=0)
    return result


def kept_rows(count: int, sample_time: float) -> slice:
    """The rows that a regression uses."""
    edge = min(round(SETTLING / sample_time), count // 4)
    return slice(edge, count - edge, max(1, round(1.0 / (ROWS_PER_SECOND * sample_time))))


def ridge(
    columns: Array, target: Array, spread: Sequence[float], zero: Array | None = None
) -> tuple[Array, float]:
    """Least squares in which some unknowns are known to be near 0.

    Parameters
    ----------
    columns, target : ndarray, shape (N, n) and (N,)
        Of the linear equations.
    spread : sequence of float
        Standard deviation of each unknown; infinite where nothing is known.
    zero : ndarray, shape (n,), optional
        Weights of a sum of unknowns that is 0.

    Returns
    -------
    unknowns : ndarray, shape (n,)
        The solution; the weight of what is known follows from the residuals.
    residual : float
        Their standard deviation, in the unit of `target`.
    """
    size = np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    scaled = columns / size
    weight = np.array([0.0 if np.isinf(s) else 1.0 / s for s in spread]) / size
    sigma = 0.05 * float(np.std(target)) + 1e-300
    found = np.zeros(columns.shape[1])
    tied = np.zeros((0, size.size)) if zero is None else (zero / size)[None]
    if (largest := np.abs(tied).max(initial=0.0)) > 0.0:
        tied *= 1e4 * float(np.std(target)) * np.sqrt(len(target)) / largest
    # neighbouring rows are correlated by the filter: they count once per period of its corner
    share = min(1.0, CORNER / ROWS_PER_SECOND)
    for _ in range(ROUNDS):
        left = np.vstack([scaled * np.sqrt(share), np.diag(weight * sigma), tied])
        right = np.concatenate([target * np.sqrt(share), np.zeros(weight.size + len(tied))])
        found = np.linalg.lstsq(left, right, rcond=1e-10)[0]
        sigma = max(float(np.std(target - scaled @ found)), 1e-6 * float(np.std(target)) + 1e-300)
    return found / size, sigma


def _tensions(rig: Rig, joint: int, pressures: Array, position: Array) -> Array:
    """Torque of either muscle alone, agonist and antagonist, shape (N, 2); NaN outside a model."""
    model = JointStatics.from_rig(rig, joint)
    torque = np.full((len(position), 2), np.nan)
    for k, (q, pair) in enumerate(
        zip(position.tolist(), np.maximum(pressures, 0.0).tolist(), strict=True)
    ):
        try:
            pulls = model.tensions(pair, q)
        except PamError:
            continue
        torque[k] = pulls[0], -pulls[1]
    return model.radius * torque


def body_regression(
    rig: Rig, joint: int, records: Sequence[MotionRecord], spread: Mapping[str, float]
) -> dict[str, float]:
    """Inertia, friction, gravity and small changes of the lengths, from the balance of torques.

    Parameters
    ----------
    rig : Rig
        Its inertia, friction and gravity are not used.
    joint : int
        Number of the joint.
    records : sequence of MotionRecord
        Recordings in which the joint moves freely.
    spread : mapping of str to float
        Standard deviation of the lengths, relative, by plant parameter.

    Returns
    -------
    dict of str to float
        Values by plant parameter; empty if the joint does not move within the muscles' models.
    """
    names = [n for n in _length_changes(rig, joint) if spread.get(n, 0.0) > 0.0]
    targets, blocks, pulls = [], [], []
    for record in records:
        step = record.sample_time
        angle = smooth(record.position, step)
        speed = np.gradient(angle, step)
        rows = kept_rows(angle.size, step)
        q = record.position
        # the balance holds for the signals themselves: nonlinear terms are filtered, not inputs
        fine = slice(None, None, max(1, rows.step // 4))
        thin = step * (fine.step or 1)
        pressures, position = record.pressures[fine], q[fine]

        def of(changed: Rig, p: Array = pressures, x: Array = position) -> Array:
            return _tensions(changed, joint, p, x)

        plain = of(rig)
        known = np.isfinite(plain).all(axis=1)
        if known.mean() < 0.5:
            continue
        columns = [
            np.interp(np.arange(position.size) * thin, np.arange(angle.size) * step, one)
            for one in (np.gradient(speed, step), speed)
        ]
        turned = position - record.turned
        raw = [np.sin(turned), -np.cos(turned), np.sign(columns[1]) * (np.abs(columns[1]) > 0.02)]
        size = np.nansum(np.abs(plain))
        growth = []
        for name in names:
            changed = of(_length_changes(rig, joint)[name](1.0 + SMALL))
            raw.append((plain.sum(axis=1) - changed.sum(axis=1)) / SMALL)
            growth.append((np.nansum(np.abs(changed)) / size - 1.0) / SMALL)
        pulls.append(growth)
        whole = np.column_stack([plain.sum(axis=1), *raw])
        whole = np.where(known[:, None], whole, 0.0)
        filtered = smooth(whole, thin)
        keep = kept_rows(position.size, thin)
        chosen = np.flatnonzero(smooth(known.astype(float), thin)[keep] > 0.99)
        block = np.column_stack([*columns, filtered[:, 1:]])[keep][chosen]
        blocks.append(block)
        targets.append(filtered[:, 0][keep][chosen])
    if not blocks or sum(map(len, blocks)) < 100:
        return {}
    known_by = [np.inf, np.inf, np.inf, np.inf, np.inf, *(spread[n] for n in names)]
    # All terms could shrink together, muscles included: the balance has no scale of its own. That
    # of the muscles as written is kept.
    scale = np.concatenate([np.zeros(5), np.mean(pulls, axis=0)]) if names else None
    found, _ = ridge(np.vstack(blocks), np.concatenate(targets), known_by, scale)
    inertia, friction, sine, cosine = (float(x) for x in found[:4])
    result = {
        "joint.inertia": inertia,
        "joint.viscous_friction": friction,
        "joint.gravity_torque": float(np.hypot(sine, cosine)),
        "joint.gravity_angle": float(np.arctan2(cosine, sine)),
        "coulomb_friction.torque": max(float(found[4]), 0.0),
    }
    base = {n: 1.0 + float(x) for n, x in zip(names, found[5:], strict=True)}
    return result | {f"factor {n}": x for n, x in base.items()}


def _length_changes(rig: Rig, joint: int) -> dict[str, Callable[[float], Rig]]:
    """For each length, by plant parameter, the rig with it multiplied by a factor."""
    entry = rig.joints[joint]

    def radius(factor: float) -> Rig:
        return rig.with_joint(replace(entry, pulley_radius=factor * entry.pulley_radius))

    def of(muscle: Muscle, key: str) -> Callable[[float], Rig]:
        def change(factor: float) -> Rig:
            return rig.with_muscle(replace(muscle, **{key: factor * getattr(muscle, key)}))

        return change

    found: dict[str, Callable[[float], Rig]] = {"joint.pulley_radius": radius}
    for side, name in zip(("agonist", "antagonist"), entry.muscles, strict=True):
        muscle = rig.muscle(name)
        found |= {f"{side}.{key}": of(muscle, key) for key in LENGTHS}
    return found


def valve_regression(
    rig: Rig, joint: int, side: int, records: Sequence[MotionRecord]
) -> dict[str, float]:
    """Conductance and dead volume from the balance of gas, or the lag of a regulator.

    Parameters
    ----------
    rig : Rig
        Its conductance and dead volume are not used.
    joint, side : int
        Number of the joint, and 0 for its agonist, 1 for its antagonist.
    records : sequence of MotionRecord
        Recordings with commands.

    Returns
    -------
    dict of str to float
        By key of the muscle's section, as `valve.sonic_conductance`; empty without commands.
    """
    muscle = rig.muscle(rig.joints[joint].muscles[side])
    usable = [record for record in records if record.commands is not None]
    if not usable:
        return {}
    if muscle.valve.kind == "pressure_regulator":
        return _regulator_lag(side, usable)
    return _gas_balance(rig, joint, muscle, side, usable)


def _regulator_lag(side: int, records: Sequence[MotionRecord]) -> dict[str, float]:
    """p(t) = u(t - 2 tau) for slow signals: two equal lags in a row."""
    above, below = 0.0, 0.0
    for record in records:
        assert record.commands is not None
        both = smooth(
            np.column_stack([record.commands[:, side], record.pressures[:, side]]),
            record.sample_time,
        )
        rate = np.gradient(both[:, 0], record.sample_time)
        keep = kept_rows(len(both), record.sample_time)
        behind = (both[:, 0] - both[:, 1])[keep]
        behind = behind - np.median(behind)
        above += float(behind @ rate[keep])
        below += float(rate[keep] @ rate[keep])
    return {"valve.time_constant": 0.5 * above / below} if below > 0.0 else {}


def _gas_balance(
    rig: Rig, joint: int, muscle: Muscle, side: int, records: Sequence[MotionRecord]
) -> dict[str, float]:
    """V dP/dt + k P dV/dt = k R T mdot, linear in the conductance and the dead volume."""
    robot = compose(rig)
    built = next(m for m in robot.muscles if m.name == muscle.name)
    exponent = rig.gas.polytropic_exponent
    columns, targets = [], []
    for record in records:
        assert record.commands is not None
        step = record.sample_time
        share = 1.0 - np.exp(-step / built.valve.time_constant)
        spool = lfilter([share], [1.0, share - 1.0], record.commands[:, side])
        absolute = np.maximum(record.pressures[:, side], 0.0) + rig.gas.ambient_pressure
        flow = np.array(
            [
                valve_mass_flow(robot, built, min(max(x, -1.0), 1.0), p)
                for x, p in zip(spool.tolist(), absolute.tolist(), strict=True)
            ]
        )
        heat = exponent * GAS_CONSTANT * rig.gas.temperature  # J/kg
        try:
            knots = np.linspace(record.position.min(), record.position.max(), 33)
            lengths = [path_length(built, {joint: q}) for q in knots.tolist()]
            braid = [gas_volume(built, length) - built.dead_volume for length in lengths]
        except PamError:
            continue
        volume = smooth(np.interp(record.position, knots, braid), step)
        pressure = smooth(absolute, step)
        keep = kept_rows(pressure.size, step)
        rate = np.gradient(pressure, step)
        targets.append((volume * rate + exponent * pressure * np.gradient(volume, step))[keep])
        columns.append(np.column_stack([heat * smooth(flow, step), -rate])[keep])
    if not targets:
        return {}
    found, _ = ridge(np.vstack(columns), np.concatenate(targets), [np.inf, np.inf])
    return {
        "valve.sonic_conductance": float(found[0]) * muscle.valve.sonic_conductance,
        "dead_volume": float(found[1]),
    }
