"""How far a joint yields to what pushes it: a figure beside that of tracking.

`pam check disturbances` lets the controller hold the joint of the independent plant, which is its
rig file, while an outside torque swings at 0.5 and 1 Hz or a load is put on, and play both motions
while the supply sags by 2 bar. Beside the controller with its default parameters stand one without
adaptation and, for the swinging torque, the muscles alone at the same stiffness.

The outside torque is that of a force on the limb. The plant gets it as a turn of its gravity.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from pam_check.blind.truth_plant import Array, Sensors, TruthJoint
from pam_check.control.closed_loop import PERIOD, SETTLED, START_PRESSURE, TOLD
from pam_check.control.hidden_rigs import NOTHING
from pam_check.control.rough_control import RoughControl
from pam_check.control.running_truth import RunningTruth
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.references.trajectory import TrajectoryPoint
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.rig import load_rig

SWINGS_AT: Final = (0.5, 1.0)  # Hz
SWING: Final = 0.3  # N m, amplitude; the joint moves by some milliradians
SWINGS_FOR: Final = 8.0  # s, of which the second half is judged
LOAD: Final = 1.0  # N m
LEFT_AFTER: Final = 1.0  # s
SAG: Final = 2e5  # Pa; with 3e5 the pressures of the motions are out of reach of the elbow
SAGS: Final = (1 / 3, 0.2)  # share of the motion at which the supply begins to sag; s, how long


@dataclass(frozen=True, slots=True)
class Yielding:
    """How far a joint yields.

    Attributes
    ----------
    compliance : tuple of float
        Angle per outside torque at `SWINGS_AT` [rad/(N m)].
    peak, left : float
        Largest error after a load is put on, and that `LEFT_AFTER` later [rad]; NaN without a
        controller.
    sag : tuple of float
        RMS error of each motion from the sag of the supply on [rad]; empty without a controller.
    """

    compliance: tuple[float, ...]
    peak: float = math.nan
    left: float = math.nan
    sag: tuple[float, ...] = ()


def pushed(joint: TruthJoint, torque: float) -> TruthJoint:
    """A joint with an outside torque [N m], which is that of a force on its limb."""
    return joint._replace(
        gravity_torque=math.hypot(joint.gravity_torque, torque),
        gravity_angle=joint.gravity_angle + math.atan2(torque, joint.gravity_torque),
    )


def _errors(
    rough: RoughControl,
    controller: Controller,
    seconds: float,
    seed: int,
    push: Callable[[float], float] | None = None,
    points: Sequence[TrajectoryPoint] = (),
    supply: Array | None = None,
) -> Array:
    """Error of the true angle [rad] after the joint has settled; times for `push` begin there."""
    joint, muscles = rough.hidden(NOTHING)
    count, begin = round((SETTLED + seconds) / PERIOD), round(SETTLED / PERIOD)
    plant = RunningTruth(
        joint,
        muscles,
        Sensors(),
        np.random.default_rng(seed),
        period=PERIOD,
        count=count,
        pressure=START_PRESSURE,
        supply=supply,
    )
    controller.drop_commands()
    controller.forget_adaptation()
    name, commands, errors = controller.rig.joints[0].name, (0.0, 0.0), np.zeros(count)
    for k in range(count):
        now = k * PERIOD
        if push is not None and k >= begin:
            plant.becomes(pushed(joint, push(now - SETTLED)), muscles)
        shown = plant.advance(commands)
        if k == begin and points:
            controller.references.follow([name], points, start=None, now=now)
        output = controller.step(now, Measurement([shown[2]], [shown[0], shown[1]], now, now))
        if output.commands is None:
            errors[k:] = math.inf
            break
        commands = (output.commands[0], output.commands[1])
        errors[k] = controller.references.sample(name, now).position - plant.truth[k, 2]
    return errors[begin:]


def _swinging(hertz: float) -> Callable[[float], float]:
    """An outside torque that swings with a frequency."""
    omega = 2.0 * math.pi * hertz
    return lambda time: SWING * math.sin(omega * time)


def amplitude(errors: Array, hertz: float) -> float:
    """Of the part of a signal that has a frequency, in its unit."""
    phases = 2.0 * math.pi * hertz * PERIOD * np.arange(errors.size)
    functions = np.stack([np.cos(phases), np.sin(phases), np.ones(errors.size)], axis=1)
    found: Array = np.linalg.lstsq(functions, errors, rcond=None)[0]
    return math.hypot(float(found[0]), float(found[1]))


def yielding(rough: RoughControl, controller: Controller, seed: int) -> Yielding:
    """Push a joint under control, and let the supply sag."""
    compliance = []
    for hertz in SWINGS_AT:
        errors = _errors(rough, controller, SWINGS_FOR, seed, _swinging(hertz))
        compliance.append(amplitude(errors[errors.size // 2 :], hertz) / SWING)
    loaded = np.abs(_errors(rough, controller, 2.0 * LEFT_AFTER, seed, lambda _: LOAD))
    sag = [sagging(rough, controller, motion, seed) for motion in rough.motions]
    left = float(loaded[round(LEFT_AFTER / PERIOD) :].max())
    return Yielding(tuple(compliance), float(loaded.max()), left, tuple(sag))


def sagging(rough: RoughControl, controller: Controller, motion: str, seed: int) -> float:
    """RMS error of a motion from the sag of the supply on [rad]."""
    points = rough.motions[motion]
    duration, (share, lasts) = points[-1].time_from_start, SAGS
    times = PERIOD * np.arange(round((SETTLED + duration) / PERIOD))
    sagged = np.clip((times - SETTLED - share * duration) / lasts, 0.0, 1.0)
    supply = 1.0 - sagged * SAG / rough.rig.supply_pressure
    errors = _errors(rough, controller, duration, seed, None, points, supply)
    after = errors[round(share * duration / PERIOD) :]
    return float(np.sqrt(np.mean(after**2)))


def muscles_alone(controller: Controller) -> Yielding:
    """The same of a joint at its default stiffness without feedback, by its linear model."""
    models, settings = controller.channels[0].models, controller.settings
    stiffness = models.scale.complete(settings).default_stiffness
    cases = controller.design.cases(models, settings.replace(stiffness_grid=(stiffness,)))
    omega = 2.0 * math.pi * np.array(SWINGS_AT)
    largest = np.zeros(omega.size)
    for case in cases:
        point = case.point
        swing = point.spring - point.inertia * omega**2 + 1j * omega * point.damping
        largest = np.maximum(largest, np.abs(1.0 / swing))
    return Yielding(tuple(largest.tolist()))


HEADER: Final = (
    f"{'':20s} mrad/(N m) at {', '.join(f'{hertz:g}' for hertz in SWINGS_AT)} Hz   "
    "load: peak  after 1 s   sag: arm  chirp [mrad]"
)


def _row(name: str, found: Yielding) -> str:
    cells = " ".join(f"{1e3 * each:12.1f}" for each in found.compliance)
    if not found.sag:
        return f"{name:20s} {cells}"
    sag = " ".join(f"{1e3 * each:8.2f}" for each in found.sag)
    return f"{name:20s} {cells} {1e3 * found.peak:15.1f} {1e3 * found.left:10.1f} {sag}"


def run(given: Arguments) -> Outcome:
    """Measure and print the table; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig that cannot be used.
    """
    rough = RoughControl(load_rig(chosen_rig(given)), TOLD, given.seed)
    plain = Controller(rough.rig, TOLD.replace(adaptation=False), rough.designs)
    print(HEADER)
    found = {
        "default": yielding(rough, rough.controller, given.seed),
        "without adaptation": yielding(rough, plain, given.seed),
        "muscles alone": muscles_alone(rough.controller),
    }
    for name, each in found.items():
        print(_row(name, each))
    return Outcome({name: asdict(each) for name, each in found.items()}, [])
