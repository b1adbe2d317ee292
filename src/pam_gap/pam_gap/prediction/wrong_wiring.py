"""Recordings in which channels are swapped or have the wrong sign, found before any fit.

Two hoses that are exchanged, or an encoder that counts the other way, cause no error in any
formula. Effects with large amounts are fitted instead, after a long search. Two kinds of evidence
are used. The phases of `directions` need no numbers of the rig, but cannot tell every exchange from
every other. The simulation as written is compared with the recording as it is, and with every
exchange undone that the phases allow, over the channels that this exchange can change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.channel_order import (
    AGONIST_FORCE,
    ANTAGONIST_FORCE,
    BOTH_FORCES,
    BOTH_PRESSURES,
    POSITION,
)
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.directions import (
    Direction,
    Directions,
    directions,
    show_one_muscle,
)
from pam_gap.prediction.fit import Array, mean_squares
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import LOCKED, SHUT
from pam_model.rig.rewiring import crossed_hoses, turned_encoder

CABLES = "Check the cables and the names in the log, or correct the log with --map."


@dataclass(frozen=True, slots=True)
class Exchange:
    """A mistake in the wiring or in the log."""

    # what is exchanged, for the answer; `{0}` and `{1}` are the muscles and `{2}` the joint
    words: str
    # what to change, as a full sentence; `{3}` and `{4}` say it of the rig file (`rewiring`)
    remedy: str
    commands: tuple[float, float] = (1.0, 1.0)  # signs of both commands
    # swaps_commands, swaps_pressures, swaps_forces, turns_position: what is swapped or reversed
    swaps_commands: bool = False
    swaps_pressures: bool = False
    swaps_forces: bool = False
    turns_position: bool = False

    def undone(self, data: Channels) -> Channels:
        """The channels without this mistake."""
        signed = data.commands * np.array(self.commands)
        commands = signed[:, ::-1] if self.swaps_commands else signed
        measured, known = data.measured.copy(), data.known.copy()
        deviation = (data.deviation.copy(), data.block_deviation.copy())
        swapped = [(self.swaps_pressures, BOTH_PRESSURES), (self.swaps_forces, BOTH_FORCES)]
        for values in (measured, known, *deviation):
            for pair in (pair for is_swapped, pair in swapped if is_swapped):
                values[..., pair] = values[..., pair][..., ::-1].copy()
        if self.turns_position:
            measured[:, POSITION] *= -1.0
        return replace(
            data, commands=np.ascontiguousarray(commands), measured=measured, known=known,
            deviation=deviation[0], block_deviation=deviation[1],
        )  # fmt: skip

    @property
    def turns_motion(self) -> bool:
        """Whether it turns the direction in which the joint follows the measured pressures."""
        return self.turns_position != self.swaps_pressures

    @property
    def turns_drive(self) -> bool | None:
        """Whether it turns that in which the pressures follow the commands; None if for one."""
        if self.commands[0] != self.commands[1]:
            return None
        return (self.swaps_commands != self.swaps_pressures) != (self.commands[0] < 0.0)

    def fits(self, found: Directions) -> bool:
        """Whether this exchange turns what the phases show as turned, and nothing else."""
        drive, motion = found.drive.direction, found.motion.direction
        if motion != Direction.UNDECIDED and self.turns_motion != (motion == Direction.OPPOSED):
            return False
        if drive == Direction.UNDECIDED or self.turns_drive is None:
            return drive != Direction.AGREES or self.turns_drive is not None
        return self.turns_drive == (drive == Direction.OPPOSED)

    def changed(self, present: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Of the compared channels, those whose error this exchange can change."""
        if self.turns_drive is not False:
            return present
        moving = np.zeros_like(present)
        moving[[POSITION, AGONIST_FORCE, ANTAGONIST_FORCE]] = True
        result: npt.NDArray[np.bool_] = present & moving
        return result


REVERSED = Exchange(
    "the sign of joint {2} is reversed",
    "Reverse the sign of the encoder (with --map or on the board); or, in the rig file, {3}.",
    turns_position=True,
)
HOSES = Exchange(
    "the hoses of the muscles {0} and {1} are exchanged",
    "Exchange the hoses; or, in the rig file, {4}.",
    swaps_commands=True,
    swaps_pressures=True,
)
IF_IT_IS = {REVERSED.words: "If it is the sign", HOSES.words: "If it is the hoses"}
EXCHANGES = (
    REVERSED,
    HOSES,
    Exchange("the pressures of {0} and {1} are swapped", CABLES, swaps_pressures=True),
    Exchange("the valve commands of {0} and {1} are swapped", CABLES, swaps_commands=True),
    Exchange("the signs of both valve commands are reversed", CABLES, commands=(-1.0, -1.0)),
    Exchange("the sign of the valve command of {0} is reversed", CABLES, commands=(-1.0, 1.0)),
    Exchange("the sign of the valve command of {1} is reversed", CABLES, commands=(1.0, -1.0)),
)


def _possible(problem: PredictionProblem) -> Sequence[Exchange]:
    """The exchanges that the recorded channels can show."""
    moves = bool(problem.present[POSITION])
    if any(data.recording.mounting in (SHUT, LOCKED) for data in problem.data):
        return ()
    if not problem.has_commands:
        return EXCHANGES[:2] if moves else ()
    muscles = problem.rig.joints[problem.joint].muscles
    is_signed = any(problem.rig.muscle(name).valve.kind == "flow" for name in muscles)
    found = EXCHANGES if is_signed else EXCHANGES[:4]
    return found if moves else found[2:]


def _evidence(found: Directions, joint: str) -> str:
    """What the phases show as turned, as a sentence; empty if nothing."""
    shown = []
    if found.motion.direction == Direction.OPPOSED:
        shown.append(found.motion.words("the torque of the pressures", f"the angle of {joint}"))
    if found.drive.direction == Direction.OPPOSED:
        shown.append(found.drive.words("the commands", "the pressures"))
    if not shown:
        return ""
    text = ", and ".join(shown)
    return f" {text[0].upper()}{text[1:]}; they should agree, at a phase near 0."


def wrong_wiring(problem: PredictionProblem) -> tuple[str, ...]:
    """What is swapped or reversed in the recordings, in full sentences; empty if nothing is."""
    present, rules = problem.present, problem.rules.recording
    if not present.any() or not problem.counted.any():
        return ()
    entry = problem.rig.joints[problem.joint]
    if show_one_muscle(problem):
        first, second = entry.muscles
        return (
            f"Wrong wiring: the pressure sensors of {first} and {second} show the same pressure, "
            f"although {entry.name} moves. One of them is connected to the muscle of the other, or "
            f"the log holds one of them twice. {CABLES}",
        )

    def levels(change: Callable[[Channels], Channels] | None) -> Array:
        one = problem if change is None else problem.with_data(change)
        square = mean_squares(one.errors(problem.base.values[None])[0], problem.counted)
        result: Array = np.log(np.maximum(square, 1.0))
        return result

    found = directions(problem)
    is_turned = Direction.OPPOSED in (found.motion.direction, found.drive.direction)
    written = levels(None)
    tried: list[tuple[float, Exchange]] = []
    for one in _possible(problem):
        if one.fits(found):
            gained = levels(one.undone) - written
            over = one.changed(present) & (gained != 0.0) if is_turned else present
            tried.append((float(np.exp(0.5 * gained[over].mean())) if over.any() else 1.0, one))
    left, best = min(tried, key=lambda pair: pair[0], default=(1.0, None))  # of the RMS error
    if best is None or 1.0 - left < (rules.direction_gain if is_turned else rules.wrong_wiring):
        return ()
    same = [one for rest, one in tried if rest * (1.0 - rules.wrong_wiring) <= left]
    named = [one for one in same if one is best or {one, best} == {REVERSED, HOSES}]
    names = (
        *entry.muscles, entry.name, turned_encoder(problem.rig, entry),
        crossed_hoses(problem.rig, entry),
    )  # fmt: skip
    what = ", or ".join(one.words for one in named).format(*names)
    remedies = dict.fromkeys(one.remedy for one in named)
    if len(named) > 1:
        remedies = dict.fromkeys(
            f"{IF_IT_IS[one.words]}, {one.remedy[0].lower()}{one.remedy[1:]}" for one in named
        )
    remedy = " ".join(remedies).format(*names)
    return (
        f"Wrong wiring: {what}.{_evidence(found, entry.name)} With this undone, "
        f"{100.0 * (1.0 - left):.0f} % of the simulation's error disappears (mean over the "
        f"channels that it changes). {_tell_apart(named, entry.muscles, entry.name)}{remedy}",
    )


def _tell_apart(named: Sequence[Exchange], muscles: Sequence[str], joint: str) -> str:
    """How to find out by hand which of two exchanges it is; empty for one."""
    if len(named) < 2:
        return ""
    return (
        f"Move {joint} by hand, without air, in the direction in which {muscles[0]} pulls: if its "
        "angle falls, it is the sign, else the hoses. "
    )
