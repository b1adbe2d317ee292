"""What more feedback brings, and what it costs in work of the valves and in air.

`pam check feedback-cost` designs the gains of the model-based law with several leads, with one set
of gains for the whole range of the stiffness, with smaller margins, with a shorter unknown delay
and with faster filters of the derivative. It prints how well each rejects disturbances in the
linear model, and how much the valves work in the arm's motion on the independent plant that is its
rig file.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar, Final

import numpy as np

from pam_check.blind.truth_plant import TruthMuscle
from pam_check.control.closed_loop import PERIOD, TOLD, RunTrace, play, true_rig
from pam_check.control.rough_control import NOTHING, RoughControl
from pam_control.controller import Controller
from pam_control.feedback.gain_design import DesignTask, PidCost
from pam_control.feedback.linear_joint import response_parts
from pam_control.feedback.margins import pid_response
from pam_control.laws.position_stiffness import PositionStiffness
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.rig import Rig, load_rig

DISTURBED_AT: Final = (0.5, 1.0, 2.0)  # Hz
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


VARIANTS: Final = (
    Variant("one set, lead 0", {"feedback_lead": 0.0}, scheduled=False),
    *(Variant(f"lead {lead:g}", {"feedback_lead": lead}) for lead in (0.0, 0.25)),
    Variant("default"),
    *(Variant(f"lead {lead:g}", {"feedback_lead": lead}) for lead in (0.75, 1.0)),
    _margins(45.0, 1.7),
    _margins(42.0, 1.8),
    _margins(38.0, 2.0),
    Variant("unknown delay 5 ms", {"extra_delay": 5e-3}),
    *(
        Variant(
            f"filter {1e3 * filtered:g} ms, lead {lead:g}",
            {"derivative_filter": filtered, "feedback_lead": lead},
        )
        for filtered in (7e-3, 5e-3, 3e-3)
        for lead in (0.25, 0.5)
    ),
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


def measured(rough: RoughControl, variant: Variant, seed: int) -> FeedbackCost:
    """Design the gains in one way, and play the motion with them."""
    law = PositionStiffness() if variant.scheduled else OneSet()
    controller = Controller(rough.rig, TOLD.replace(**variant.changes), rough.designs, law)
    models, settings, design = controller.channels[0].models, controller.settings, controller.design
    schedule = settings.gains[models.name]
    timing = design.timing(models, settings)
    worst = 0.0
    for case in design.cases(models, settings):
        gains = schedule.at(case.scheduled)
        task = DesignTask((case,), timing, 0.0, math.inf, gains.derivative_filter, lead=gains.lead)
        worst = max(worst, PidCost(task).of(gains))
    told = settings.replace(extra_delay=0.0)
    stiffness = models.scale.complete(settings).default_stiffness
    omega = 2.0 * math.pi * np.array(DISTURBED_AT)
    yielding, timing_now = np.zeros(omega.size), design.timing(models, told)
    for case in design.cases(models, told.replace(stiffness_grid=(stiffness,))):
        drive, spring, late = response_parts(case.point, case.loop, timing_now, omega)
        fed_back = drive * late * pid_response(schedule.at(stiffness), omega)
        yielding = np.maximum(yielding, np.abs(1.0 / (spring + fed_back)))
    joint, muscles = rough.hidden(NOTHING)
    played, trace = play(controller, joint, muscles, rough.motions[MOTION], seed)
    return FeedbackCost(
        variant.name,
        worst,
        tuple(yielding.tolist()),
        played.rms,
        played.activity,
        air_taken(trace, true_rig(rough.rig)[1], rough.rig),
    )


HEADER: Final = (
    f"{'gains':22s} {'|S|':>5s}   mrad/(N m) at "
    + ", ".join(f"{hertz:g}" for hertz in DISTURBED_AT)
    + " Hz   error  spool/s  air l/s"
)


def _row(found: FeedbackCost) -> str:
    yielding = " ".join(f"{1e3 * each:8.1f}" for each in found.compliance)
    return (
        f"{found.name:22s} {found.sensitivity:5.2f} {yielding} {1e3 * found.error:12.2f} "
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
