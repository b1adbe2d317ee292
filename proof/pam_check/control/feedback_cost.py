"""What more feedback brings, and what it costs in work of the valves and in air.

`pam check feedback-cost` designs the gains of the model-based law with derivatives that are
filtered or observed, with several leads, with one set of gains for the whole range of the
stiffness, with smaller margins and with a shorter unknown delay. It prints how well each rejects
disturbances and which unstated delay it survives in the linear model, and how much the valves work
in the arm's motion on the independent plant that is its rig file.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt

from pam_check.blind.truth_plant import TruthMuscle
from pam_check.control.closed_loop import PERIOD, TOLD, RunTrace, play, true_rig
from pam_check.control.hidden_rigs import NOTHING
from pam_check.control.rough_control import RoughControl
from pam_control.controller import Controller
from pam_control.feedback.gain_design import OMEGA, TRACKING_BAND
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.linear_joint import LoopTiming, frequency_response, response_parts
from pam_control.feedback.loop_shape import encloses_nothing
from pam_control.feedback.margins import LoopCase, pid_response
from pam_control.feedback.pid import PidGains
from pam_control.laws.position_stiffness import PositionStiffness
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.rig import Rig, load_rig

DISTURBED_AT: Final = (0.5, 1.0, 2.0)  # Hz
BAND_POINTS: Final = 100
LONGEST: Final = 0.04  # s, of a delay; with a longer one the pressure loops are not stable
RESOLUTION: Final = 1e-4  # s
MOTION: Final = "arm"
REFERENCE_DENSITY: Final = 1.185  # kg/m^3 of ISO 8778
LITRES: Final = 1e3  # per m^3


class OneSet(PositionStiffness):
    """The law as it would be with one set of gains."""

    is_scheduled: ClassVar[bool] = False


@dataclass(frozen=True, slots=True)
class Variant:
    """A way to design the gains.

    Attributes
    ----------
    name : str
        What differs from the default.
    changes : dict
        Settings by name.
    scheduled : bool
        Whether the gains follow the stiffness.
    """

    name: str
    changes: dict[str, Any] = field(default_factory=dict)
    scheduled: bool = True


def _margins(degrees: float, sensitivity: float) -> Variant:
    changes = {"phase_margin": math.radians(degrees), "sensitivity": sensitivity}
    return Variant(f"margins {degrees:g} deg, {sensitivity:g}", changes)


def _observed(bandwidth: float, lead: float) -> Variant:
    changes = {"motion_observer": bandwidth, "feedback_lead": lead}
    return Variant(f"observed {bandwidth:g}, lead {lead:g}", changes)


def _filtered(milliseconds: float, lead: float) -> Variant:
    changes = {
        "motion_observer": 0.0,
        "derivative_filter": 1e-3 * milliseconds,
        "feedback_lead": lead,
    }
    return Variant(f"filter {milliseconds:g} ms, lead {lead:g}", changes)


VARIANTS: Final = (
    Variant("one set, filtered", {"feedback_lead": 0.0, "motion_observer": 0.0}, scheduled=False),
    *(_filtered(10.0, lead) for lead in (0.0, 0.5, 1.0)),
    *(_filtered(filtered, 0.5) for filtered in (5.0, 3.0)),
    Variant("default"),
    *(_observed(bandwidth, 0.4) for bandwidth in (100.0, 130.0, 200.0, 300.0)),
    *(_observed(160.0, lead) for lead in (0.0, 0.2, 0.3, 0.5)),
    _margins(45.0, 1.7),
    _margins(42.0, 1.8),
    Variant("unknown delay 5 ms", {"extra_delay": 5e-3}),
)


@dataclass(frozen=True, slots=True)
class FeedbackCost:
    """One design.

    Attributes
    ----------
    name : str
        Of its variant.
    sensitivity : float
        RMS of |S| over the tracking band at the worst operating point [-].
    compliance : tuple of float
        Angle per outside torque at the frequencies `DISTURBED_AT`, the largest over the range of
        the joint at its default stiffness [rad/(N m)].
    longest_delay : float
        Longest unstated delay of the commands with which all loops are stable [s].
    error : float
        RMS error of the motion [rad].
    strokes : float
        Change of the spool commands per second of the motion [1/s].
    air : float
        Air taken from the supply in a second [dm^3/s ANR].
    """

    name: str
    sensitivity: float
    compliance: tuple[float, ...]
    longest_delay: float
    error: float
    strokes: float
    air: float


def air_taken(trace: RunTrace, muscles: tuple[TruthMuscle, TruthMuscle], rig: Rig) -> float:
    """Volume of air at reference conditions that the valves let in per second [dm^3/s].

    The flow is that of ISO 6358 through the opening that is commanded.
    """
    volume = 0.0
    for side, muscle in enumerate(muscles):
        inside = trace.pressures[:, side] + rig.gas.ambient_pressure
        supply = rig.supply_pressure
        ratio = np.clip((inside / supply - muscle.critical_ratio), 0.0, None)
        flow = np.sqrt(np.clip(1.0 - (ratio / (1.0 - muscle.critical_ratio)) ** 2, 0.0, None))
        opening = np.clip(trace.commands[:, side], 0.0, None)
        volume += muscle.sonic_conductance * supply * float(np.nansum(opening * flow)) * PERIOD
    return LITRES * volume / (trace.position.size * PERIOD)


def sensitivity(case: LoopCase, timing: LoopTiming, gains: PidGains) -> float:
    """RMS of |S| over the tracking band [-]."""
    omega = 2.0 * math.pi * np.geomspace(*TRACKING_BAND, BAND_POINTS)
    plant = frequency_response(case.point, case.loop, timing, omega)
    returned = 1.0 + plant * pid_response(gains, timing, omega)
    return math.sqrt(float(np.mean(np.abs(returned) ** -2.0)))


def compliance(case: LoopCase, timing: LoopTiming, gains: PidGains) -> npt.NDArray[np.float64]:
    """Angle per outside torque at the frequencies `DISTURBED_AT` [rad/(N m)].

    A motion observer sees the acceleration by the muscles, which the outside torque is not part of.
    """
    omega = 2.0 * math.pi * np.array(DISTURBED_AT)
    drive, spring, late = response_parts(case.point, case.loop, timing, omega)
    unseen = np.full(omega.shape, -case.point.accelerations(1.0)[0], dtype=np.complex128)
    pushed = 1.0 - drive * late * pid_response(gains, timing, omega, 0.0, unseen)
    held = spring + drive * late * pid_response(gains, timing, omega)
    result: npt.NDArray[np.float64] = np.abs(pushed / held)
    return result


def longest_delay(cases: Sequence[LoopCase], timing: LoopTiming, gains: GainSchedule) -> float:
    """Longest delay of the commands, beside that of the timing, with stable loops [s]."""
    low, high = 0.0, LONGEST
    while high - low > RESOLUTION:
        delay = 0.5 * (low + high)
        late = dataclasses.replace(timing, transport_delay=timing.transport_delay + delay)
        returned = np.array(
            [
                1.0
                + frequency_response(case.point, case.loop, late, OMEGA)
                * pid_response(gains.at(case.scheduled), late, OMEGA)
                for case in cases
            ]
        )
        parts = np.ascontiguousarray(returned.real), np.ascontiguousarray(returned.imag)
        low, high = (delay, high) if encloses_nothing(*parts) else (low, delay)
    return low


def measured(rough: RoughControl, variant: Variant, seed: int) -> FeedbackCost:
    """Design the gains in one way, and play the motion with them."""
    law = PositionStiffness() if variant.scheduled else OneSet()
    controller = Controller(rough.rig, TOLD.replace(**variant.changes), rough.designs, law)
    models, settings, design = controller.channels[0].models, controller.settings, controller.design
    schedule = settings.gains[models.name]
    timing = design.timing(models, settings)
    worst = max(
        sensitivity(case, timing, schedule.at(case.scheduled))
        for case in design.cases(models, settings)
    )
    told = settings.replace(extra_delay=0.0)
    stiffness = models.scale.complete(settings).default_stiffness
    cases = design.cases(models, told.replace(stiffness_grid=(stiffness,)))
    now, gains = design.timing(models, told), schedule.at(stiffness)
    yielding = np.max([compliance(case, now, gains) for case in cases], axis=0)
    joint, muscles = rough.hidden(NOTHING)
    played, trace = play(controller, joint, muscles, rough.motions[MOTION], seed)
    return FeedbackCost(
        variant.name,
        worst,
        tuple(yielding.tolist()),
        longest_delay(design.cases(models, told), now, schedule),
        played.rms,
        played.activity,
        air_taken(trace, true_rig(rough.rig)[1], rough.rig),
    )


HEADER: Final = (
    f"{'gains':22s} {'|S|':>5s}   mrad/(N m) at "
    + ", ".join(f"{hertz:g}" for hertz in DISTURBED_AT)
    + " Hz  delay ms   error  spool/s  air l/s"
)


def _row(found: FeedbackCost) -> str:
    yielding = " ".join(f"{1e3 * each:8.1f}" for each in found.compliance)
    return (
        f"{found.name:22s} {found.sensitivity:5.2f} {yielding} {1e3 * found.longest_delay:9.0f} "
        f"{1e3 * found.error:7.2f} "
        f"{found.strokes:8.1f} {found.air:8.3f}"
    )


def run(given: Arguments) -> Outcome:
    """Design and play each variant and print the table.

    Raises
    ------
    PamError
        For a rig that cannot be used.
    """
    rough = RoughControl(load_rig(chosen_rig(given)), TOLD, given.seed)
    found = []
    print(HEADER)
    with progress(len(VARIANTS), "designs") as bar:
        for done, variant in enumerate(VARIANTS, start=1):
            found.append(measured(rough, variant, given.seed))
            print(_row(found[-1]), flush=True)
            bar.show(done, variant.name)
    return Outcome({"seed": given.seed, "designs": [asdict(each) for each in found]}, [])
