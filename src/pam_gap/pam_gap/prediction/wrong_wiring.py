"""Recordings in which channels are swapped or have the wrong sign, found before any fit.

Two muscles that are swapped, or an encoder that counts the other way, cause no error in any
formula. Effects with large amounts are fitted instead, after a long search. The simulation as
written is therefore compared with the recording as it is, and with every such exchange undone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pam_gap.prediction.channel_order import BOTH_FORCES, BOTH_PRESSURES, POSITION
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.fit import mean_squares
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import LOCKED, SHUT


@dataclass(frozen=True, slots=True)
class Exchange:
    """A mistake in the wiring or in the log.

    Attributes
    ----------
    words : str
        What is exchanged, for the answer; `{0}` and `{1}` are the muscles and `{2}` the joint.
    commands : tuple of float
        Signs of both commands.
    swaps_commands, swaps_pressures, turns_position : bool
        What is swapped or reversed.
    """

    words: str
    commands: tuple[float, float] = (1.0, 1.0)
    swaps_commands: bool = False
    swaps_pressures: bool = False
    turns_position: bool = False

    def undone(self, data: Channels) -> Channels:
        """The channels without this mistake."""
        signed = data.commands * np.array(self.commands)
        commands = signed[:, ::-1] if self.swaps_commands else signed
        measured, known = data.measured.copy(), data.known.copy()
        deviation = (data.deviation.copy(), data.block_deviation.copy())
        if self.swaps_pressures:
            for values in (measured, known, *deviation):
                for pair in (BOTH_PRESSURES, BOTH_FORCES):
                    values[..., pair] = values[..., pair][..., ::-1].copy()
        if self.turns_position:
            measured[:, POSITION] *= -1.0
        return replace(
            data, commands=np.ascontiguousarray(commands), measured=measured, known=known,
            deviation=deviation[0], block_deviation=deviation[1],
        )  # fmt: skip


EXCHANGES = (
    Exchange(
        "the sign of joint {2} is reversed, or the muscles {0} and {1} are swapped",
        turns_position=True,
    ),
    Exchange("the pressures of {0} and {1} are swapped", swaps_pressures=True),
    Exchange("the valve commands of {0} and {1} are swapped", swaps_commands=True),
    Exchange("the sign of the valve command of {0} is reversed", commands=(-1.0, 1.0)),
    Exchange("the sign of the valve command of {1} is reversed", commands=(1.0, -1.0)),
    Exchange("the signs of both valve commands are reversed", commands=(-1.0, -1.0)),
)
POSITION_ONLY = EXCHANGES[:1]


def _possible(problem: PredictionProblem) -> Sequence[Exchange]:
    """The exchanges that the recorded channels can show."""
    moves = bool(problem.present[POSITION])
    if any(data.recording.mounting in (SHUT, LOCKED) for data in problem.data):
        return ()
    if not problem.has_commands:
        return POSITION_ONLY if moves else ()
    muscles = problem.rig.joints[problem.joint].muscles
    is_signed = any(problem.rig.muscle(name).valve.kind == "flow" for name in muscles)
    found = EXCHANGES if is_signed else EXCHANGES[:3]
    return found if moves else found[2:]


def wrong_wiring(problem: PredictionProblem) -> tuple[str, ...]:
    """What is swapped or reversed in the recordings, in full sentences; empty if nothing is.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    """
    present = problem.present
    if not present.any() or not problem.counted.any():
        return ()

    def level(change: Callable[[Channels], Channels] | None) -> float:
        one = problem if change is None else problem.with_data(change)
        square = mean_squares(one.errors(problem.base.values[None])[0], problem.counted)
        return float(np.log(np.maximum(square, 1.0))[present].sum())

    written = level(None)
    levels = [(level(one.undone), one) for one in _possible(problem)]
    least, best = min(levels, key=lambda pair: pair[0], default=(written, None))
    left = float(np.exp(0.5 * (least - written) / present.sum()))  # of the RMS error
    if best is None or 1.0 - left < problem.rules.recording.wrong_wiring:
        return ()
    joint = problem.rig.joints[problem.joint]
    what = best.words.format(*joint.muscles, joint.name)
    return (
        f"Wrong wiring: {what}. With this undone, {100.0 * (1.0 - left):.0f} % of the simulation's "
        "error disappear (mean over the channels). Check the cables and the names in the log, and "
        "record again, or correct the log with --map.",
    )
