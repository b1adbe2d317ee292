"""Tracking errors and loop timing of the demo, computed from its recording alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console, JustifyMethod
from rich.table import Table

from pam_control.joint_scale import JointScale
from pam_control.settings import ControlSettings
from pam_demo.loop_rate import RATES
from pam_demo.motions import DemoMotion
from pam_demo.recording import Array, Series, read_loop_counts, read_series
from pam_demo.tracking import MEASURED, TRUE, FollowedAngle
from pam_gap.answer.user_units import told
from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.gravity import gravity_torque
from pam_ros.valve_command import FLOW

LATE = 0.5  # of the period; a cycle that begins so much too late is a late one
AVERAGED = 0.05  # s, averaging time of the stiffness
SETTLING = 0.25  # s, wait after the stiffness reference has reached a new level
REACHED = 0.01  # largest relative deviation of a stiffness that counts as reachable
SETTLED = 0.02  # rad
NAMES = {
    "full": "full controller",
    "no_feedforward": "feedforward off",
    "pressure_ratio_pid": "pressure-ratio PID",
}
TIMING = ("controller_late", "driver_late")


@dataclass(frozen=True, slots=True)
class Figure:
    """One number with its target.

    Attributes
    ----------
    key, text, unit : str
        Name for programs, text for people, "-" for a number without unit.
    value : float
        In `unit`.
    target : float or None
        None: the number is shown for information.
    at_least : bool
        The target is a lower bound, not an upper one.
    reason : str
        Why the target is missed, one sentence; empty if it is not.
    """

    key: str
    text: str
    value: float
    unit: str
    target: float | None = None
    at_least: bool = False
    reason: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without a target."""
        if self.target is None:
            return None
        return self.value >= self.target if self.at_least else self.value <= self.target


@dataclass(frozen=True, slots=True)
class Play:
    """One motion played by one control law; times count from its first waypoint."""

    law: str  # a key of NAMES
    motion: DemoMotion  # the commanded motion
    joint: FollowedAngle  # as measured
    # pressures, valves, stiffness: pressures [Pa] and valve commands of each muscle, stiffness
    # [N m/rad]
    pressures: tuple[Series, ...]
    valves: tuple[Series, ...]
    stiffness: Series


@dataclass(frozen=True, slots=True)
class Results:
    """All that the page and the JSON file show."""

    figures: list[Figure]  # in order of interest
    plays: list[Play]  # in the order played
    periods: dict[str, Array]  # by topic, time between stamps [s]
    rate: float  # of the loops [Hz]
    # remarks that a reader needs to interpret the figures
    notes: list[str] = field(default_factory=list)

    def as_json(self) -> dict[str, Any]:
        """Figures and notes as plain data."""
        return {
            "figures": [{**asdict(figure), "met": figure.met} for figure in self.figures],
            "notes": self.notes,
            "rate": self.rate,
        }


def asked_stiffness(motion: DemoMotion, times: Array) -> Array:
    """Reference stiffness [N m/rad] of a motion at `times` [s]."""
    starts = [entry[0] for entry in motion.stiffness]
    index = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 1)
    return np.asarray([entry[1] for entry in motion.stiffness])[index]


@dataclass(frozen=True, slots=True)
class _Columns:
    """Where a recording has what is shown of a joint."""

    angle: str
    true_angle: str
    stiffness: str
    pressures: tuple[str, ...]  # of each muscle
    valves: tuple[str, ...]  # of each muscle

    @classmethod
    def of(cls, rig: Rig, joint: str) -> _Columns:
        """Of a joint of the rig."""
        muscles = rig.joint(joint).muscles
        fields = ["position" if rig.valve_kinds[name] == FLOW else "effort" for name in muscles]
        return cls(
            MEASURED.format(joint),
            TRUE.format(joint),
            f"/joint_stiffness.data.{rig.joint_names.index(joint)}",
            tuple(f"/pressure_states.effort.{name}" for name in muscles),
            tuple(
                f"/valve_commands.{field}.{name}"
                for field, name in zip(fields, muscles, strict=True)
            ),
        )

    @property
    def needed(self) -> tuple[str, ...]:
        """All but the true angle, which only a simulated rig has."""
        return (self.angle, self.stiffness, *self.pressures, *self.valves)


def _play(
    law: str, motion: DemoMotion, start: float, data: Mapping[str, Series], columns: _Columns
) -> Play:
    def part(column: str) -> Series:
        series = data[column].during(start, motion.duration)
        if not len(series.times):
            raise PamError(f"{column}: nothing was recorded during {motion.title!r} ({law})")
        return series

    return Play(
        law,
        motion,
        FollowedAngle.of(motion, part(columns.angle)),
        tuple(map(part, columns.pressures)),
        tuple(map(part, columns.valves)),
        part(columns.stiffness),
    )


def _means(series: Series) -> Array:
    """Moving mean over AVERAGED seconds."""
    count = max(round(AVERAGED / float(np.median(np.diff(series.times)))), 1)
    return np.convolve(series.values, np.full(count, 1.0 / count), "valid")


def _stiffness_figures(play: Play, rig: Rig, moved: str) -> tuple[list[Figure], list[str]]:
    """Worst deviation of the settled levels, and notes on levels that cannot be reached."""
    robot = compose(rig)
    joint = JointStatics.from_robot(robot, robot.joint(moved))
    position = float(np.mean(play.joint.angle))
    torque = -gravity_torque(robot.joint(moved), position)
    worst, notes = 0.0, []
    scale = JointScale.of(robot.joint(moved), joint)
    rate = scale.complete(ControlSettings()).stiffness_rate
    ends = [entry[0] for entry in play.motion.stiffness[1:]] + [play.motion.duration]
    before = play.motion.stiffness[0][1]
    for (start, level), end in zip(play.motion.stiffness, ends, strict=True):
        ramp, before = abs(level - before) / rate, level
        reach = joint.pressures_for(torque, level, position).stiffness
        if abs(reach - level) > REACHED * level:
            notes.append(
                f"{level:g} N m/rad cannot be reached at {position:.2f} rad (the pressures "
                f"allow {reach:.1f}), so this level is not scored."
            )
            continue
        settled = _means(play.stiffness.between(start + ramp + SETTLING, end))
        worst = max(worst, float(np.max(np.abs(settled - level))) / level)
    text = f"Stiffness: worst deviation (50 ms mean) on {len(ends) - len(notes)} levels"
    return [Figure("stiffness_deviation", text, 100.0 * worst, "%", 5.0)], notes


def _step_figures(play: Play) -> list[Figure]:
    """Overshoot and settling time over all steps."""
    jumps = np.flatnonzero(np.diff(play.motion.positions)) + 1
    starts = [0.0, *play.motion.times[jumps]]
    times, angle = play.joint.times, play.joint.angle
    overshoot, settling = 0.0, 0.0
    for index in range(1, len(starts)):
        begin = starts[index]
        end = starts[index + 1] if index + 1 < len(starts) else play.motion.duration
        inside = (times >= begin) & (times < end)
        target = float(play.motion.positions[jumps[index - 1]])
        height = target - float(play.motion.positions[jumps[index - 1] - 1])
        past = (angle[inside] - target) / height
        overshoot = max(overshoot, float(np.max(past)))
        outside = np.flatnonzero(np.abs(angle[inside] - target) > SETTLED)
        if len(outside):
            settling = max(settling, float(times[inside][outside[-1]]) - begin)
    text = f"Steps: longest settling time to within {SETTLED:g} rad"
    return [
        Figure("step_overshoot", "Steps: maximum overshoot", 100.0 * overshoot, "%"),
        Figure("step_settling", text, settling, "s"),
    ]


def _periods(plays: list[tuple[float, DemoMotion]], series: Series) -> Array:
    parts = [
        np.diff(series.between(start, start + motion.duration).times) for start, motion in plays
    ]
    return np.concatenate(parts) if parts else np.empty(0)


def _truth_figures(
    runs: list[dict[str, Any]], motions: Mapping[str, DemoMotion], angle: Series | None
) -> list[Figure]:
    """Error of the arm's motion by the plant's true angle, which has no sensor errors."""
    if angle is None:
        return []
    run = next(run for run in runs if (run["law"], run["motion"]) == ("full", "arm"))
    motion = motions["arm"]
    true = angle.during(run["start"], motion.duration)
    rms = FollowedAngle.of(motion, true).rms(motion.windows)
    return [Figure("arm_rms_truth", f"{motion.title}: RMS error of the true angle", rms, "rad")]


def _loop_figures(
    periods: Array, counts: Series, full: list[tuple[float, DemoMotion]], rate: float
) -> list[Figure]:
    """Timing of the controller and driver loops during the runs with the full controller."""
    late = 100.0 * float(np.mean(periods > (1.0 + LATE) / rate))
    allowed = f"{1e3 * LATE / rate:g} ms late"
    figures = [
        Figure(
            "controller_late",
            f"Controller loop: periods more than {allowed}",
            late,
            "%",
            1.0,
        ),
        Figure(
            "controller_rate", "Controller loop: mean rate", 1.0 / float(np.mean(periods)), "Hz"
        ),
    ]
    start, motion = full[-1]
    counted = counts.between(full[0][0], start + motion.duration)
    if len(counted.times) > 1:
        cycles, behind, skipped = counted.values[-1] - counted.values[0]
        share = 100.0 * float((behind + skipped) / (cycles + skipped))
        text = f"Driver loop: cycles more than {allowed}"
        figures.append(Figure("driver_late", text, share, "%", 1.0))
        mean_rate = float(cycles / (counted.times[-1] - counted.times[0]))
        figures.append(Figure("driver_rate", "Driver loop: mean rate", mean_rate, "Hz"))
    return figures


def explained(figures: list[Figure], rate: float) -> list[Figure]:
    """The figures, those that miss their target with the reason.

    Parameters
    ----------
    figures : list of Figure
        All figures of the demo.
    rate : float
        Of the loops [Hz].
    """
    late = any(figure.met is False for figure in figures if figure.key in TIMING)
    if late:
        cause = (
            "the loops were late, which adds to the error; run the demo while no other program "
            "uses the processors"
        )
    elif rate < RATES[0]:
        cause = f"the target is for {RATES[0]:g} Hz, and at {rate:g} Hz the feedback is slower"
    else:
        cause = (
            "the loops kept their time, so this is the control itself; the targets are set for "
            "config/elbow.yaml without hidden effects"
        )
    busy = "this computer is too slow or too busy for this rate; the control is not the cause"
    return [
        replace(figure, reason=busy if figure.key in TIMING else cause)
        if figure.met is False
        else figure
        for figure in figures
    ]


def evaluate(
    bag: Path, runs: list[dict[str, Any]], motions: Mapping[str, DemoMotion], rig: Rig, joint: str
) -> Results:
    """Read the recording and compute everything.

    Parameters
    ----------
    runs : list of dict
        The runs: "law", "motion", "start" [s since the epoch], "rate" [Hz].
    motions : mapping of str to DemoMotion
        The motions by name.
    rig : Rig
        The controlled rig.
    joint : str
        The joint that moved.

    Raises
    ------
    PamError
        If a topic or a part of the recording is missing.
    """
    columns = _Columns.of(rig, joint)
    data = read_series(bag, (*columns.needed, columns.true_angle))
    for column in columns.needed:
        if column not in data:
            raise PamError(f"{bag}: nothing was recorded of {column}")
    plays = [_play(run["law"], motions[run["motion"]], run["start"], data, columns) for run in runs]
    by = {(play.law, play.motion.name): play for play in plays}
    full = [(run["start"], motions[run["motion"]]) for run in runs if run["law"] == "full"]
    notes: list[str] = []

    arm, chirp = by["full", "arm"], by["full", "chirp"]
    to_1, to_2 = (chirp.motion.windows[:1], chirp.motion.windows[1:])
    figures = [
        Figure(
            "arm_rms",
            f"{arm.motion.title}: RMS error",
            arm.joint.rms(arm.motion.windows),
            "rad",
            0.01,
        ),
        Figure("chirp_1hz_rms", "Chirp to 1 Hz: RMS error", chirp.joint.rms(to_1), "rad", 0.015),
        Figure("chirp_2hz_rms", "Chirp to 2 Hz: RMS error", chirp.joint.rms(to_2), "rad"),
    ]
    if ("full", "staircase") in by:
        more, notes_here = _stiffness_figures(by["full", "staircase"], rig, joint)
        figures += more
        notes += notes_here
    for law in ("no_feedforward", "pressure_ratio_pid"):
        for name, windows in (("arm", arm.motion.windows), ("chirp", to_2)):
            if (law, name) not in by:
                continue
            rms = by[law, name].joint.rms(windows)
            text = f"{by[law, name].motion.title}, {NAMES[law]}: RMS error"
            ratio = rms / by["full", name].joint.rms(windows)
            figures.append(Figure(f"{name}_rms_{law}", text, rms, "rad"))
            text = (
                f"{by[law, name].motion.title}, {NAMES[law]}: error in multiples of the full "
                "controller's"
            )
            figures.append(Figure(f"{name}_ratio_{law}", text, ratio, "-", 3.0, True))
    if ("full", "steps") in by:
        figures += _step_figures(by["full", "steps"])
    if ("full", "staircase") in by:
        held = by["full", "staircase"]
        figures.append(
            Figure(
                "staircase_rms", "Held angle: RMS error", held.joint.rms(held.motion.windows), "rad"
            )
        )
    figures += _truth_figures(runs, motions, data.get(columns.true_angle))
    periods = {"/valve_commands": _periods(full, data[columns.valves[0]])}
    rate = float(runs[0]["rate"])
    counts = read_loop_counts(bag, "pam_driver")
    figures += _loop_figures(periods["/valve_commands"], counts, full, rate)
    for run in runs:
        title = motions[run["motion"]].title
        for reason in run.get("repeats", []):
            notes.append(
                f"{title}, {NAMES[run['law']]}: this run was repeated, because it was interrupted "
                f"({reason}). This happens on a busy host."
            )
    notes.append(
        "The data of the arm's motion have no time stamps; a rate of 20 samples per second is "
        "assumed. The angles are neither scaled nor shifted."
    )
    return Results(explained(figures, rate), plays, periods, rate, notes)


def target_text(figure: Figure) -> str:
    """The target as text; empty if there is none."""
    if figure.target is None:
        return ""
    bound = "at least" if figure.at_least else "at most"
    return f"{bound} {told(figure.target, figure.unit)}"


def show(results: Results, console: Console) -> None:
    """Print the table of figures."""
    table = Table(title="Results of the demo")
    columns: tuple[tuple[str, JustifyMethod], ...]
    columns = ("", "left"), ("value", "right"), ("target", "left")
    for name, justify in columns:
        table.add_column(name, justify=justify)
    for figure in results.figures:
        style = {None: "", True: "green", False: "red"}[figure.met]
        table.add_row(
            figure.text, told(figure.value, figure.unit, 3), target_text(figure), style=style
        )
    console.print(table)
    for figure in results.figures:
        if figure.reason:
            console.print(f"- {figure.text}: {figure.reason}", highlight=False)
    for note in results.notes:
        console.print(f"- {note}", highlight=False)
