"""Diagnoses drawn single muscles on a bench, from an independent simulation of them.

A muscle of a drawn joint with an ordinary background is put on a bench: it moves with the joint, or
it is held at three lengths, one after another. Its pressure, length, force and commands are logged,
and the rig file has `bench_muscles` and no joint. Every fourth muscle hides nothing.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from pam_check.blind.cases import written_rig
from pam_check.blind.draw import believed_rig, draw_excitation
from pam_check.blind.effect_cases import KNOWN
from pam_check.blind.plants import FIRST, PLANTS
from pam_check.blind.rough import TOLERANCES, BuriedError, DrawnRoughRig, draw_rough_rig
from pam_check.blind.truth_plant import TruthMuscle, TruthRecording
from pam_check.blind.variety import Variety
from pam_check.calibration.campaign import as_recording
from pam_gap.diagnose_recordings import diagnose
from pam_gap.recordings.recording import Recording
from pam_model.command_line import Arguments, Outcome
from pam_model.effects import EFFECTS
from pam_model.rig import Rig, save_rig

TRIES: Final = 40
HOW: Final = ("moving", "held")
HELD: Final = (0.99, 0.94, 0.89)
"""Lengths at which a muscle is held, over its rest length."""
SECONDS: Final = 15.0
"""At each of them."""
HEAVY: Final = 1e6
"""Inertia of a joint that does not move [kg m^2]."""
NONE_EVERY: Final = 4
ONLY_MOVING: Final = ("hysteresis", "creep")
"""Effects that a muscle of constant length does not show."""


def hidden_effects() -> tuple[str, ...]:
    """The effects that a single muscle with its valve can have."""
    return tuple(
        name
        for name in KNOWN
        if EFFECTS[name].scope != "joint" and EFFECTS[name].search.shown_by != ("position",)
    )


@dataclass(frozen=True, slots=True)
class DrawnBench:
    """A drawn muscle on a bench.

    Attributes
    ----------
    effect, how : str
        What is hidden, empty for nothing; and whether the muscle is moved or held.
    rig : Rig
        The rig file.
    logs : tuple of ndarray tables
        One table for each recording.
    """

    effect: str
    how: str
    rig: Rig
    logs: tuple[pd.DataFrame, ...]


def _side(effect: str, drawn: DrawnRoughRig, believed: Sequence[TruthMuscle]) -> int:
    """The muscle that has most of the effect: some effects are drawn on one of both."""
    if not effect or not KNOWN[effect].magnitudes:
        return 0

    def size(side: int) -> float:
        pairs = [
            (getattr(drawn.muscles[side], name), getattr(believed[side], name))
            for name in KNOWN[effect].magnitudes
            if hasattr(believed[side], name)
        ]
        return math.fsum(abs(true - usual) for true, usual in pairs)

    return int(size(1) > size(0))


def _log(recording: TruthRecording, side: int, name: str, length: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "time": recording.time,
            f"valve_commands.{name}": recording.commands[:, side],
            f"pressure_states.{name}": recording.pressures[:, side],
            f"muscle_states.{name}.position": length,
            f"muscle_states.{name}.effort": recording.forces[:, side],
        }
    )


def _held(
    drawn: DrawnRoughRig, side: int, name: str, random: np.random.Generator
) -> tuple[pd.DataFrame, ...]:
    """Logs of the muscle at each of the lengths, with the same supply and sensors."""
    joint = drawn.joint._replace(
        inertia=HEAVY, gravity_torque=0.0, coulomb_torque=0.0, static_torque=0.0
    )
    step = float(drawn.recording.time[1] - drawn.recording.time[0])
    logs = []
    for share in HELD:
        muscles = [m._replace(neutral_length=share * m.rest_length) for m in drawn.muscles]
        motion = replace(draw_excitation(random, joint, step, SECONDS), position_gain=0.0)
        recording = PLANTS[FIRST](
            joint, (muscles[0], muscles[1]), motion, drawn.sensors, random, supply=drawn.supply
        )
        length = np.full(recording.time.size, muscles[side].neutral_length)
        logs.append(_log(recording, side, name, length))
    return tuple(logs)


def draw_bench(random: np.random.Generator, effect: str, how: str) -> DrawnBench:
    """Draw a muscle with a background and record it on a bench.

    Parameters
    ----------
    random : numpy.random.Generator
        Source of every draw.
    effect : str
        What is hidden; empty for nothing.
    how : str
        One of `HOW`.

    Raises
    ------
    RuntimeError
        When no drawn rig can run.
    """
    for _ in range(TRIES):
        joint, muscle = believed_rig(random)
        kind = Variety()
        believed = kind.believed(joint, muscle)
        written = written_rig(kind, believed, float(random.choice(TOLERANCES)))
        try:
            drawn = draw_rough_rig(believed, written, [effect] if effect else [], random)
        except (FloatingPointError, BuriedError):
            continue
        side = _side(effect, drawn, believed[1])
        name = written.joints[0].muscles[side]
        rig = replace(written, joints=(), muscles=(written.muscle(name),))
        if how == "held":
            return DrawnBench(effect, how, rig, _held(drawn, side, name, random))
        turned = (1.0 - 2.0 * side) * drawn.joint.pulley_radius
        length = drawn.muscles[side].neutral_length - turned * drawn.recording.position
        return DrawnBench(effect, how, rig, (_log(drawn.recording, side, name, length),))
    raise RuntimeError(f"no muscle with {effect or 'nothing'} that can run in {TRIES} draws")


def _diagnosed(bench: DrawnBench, number: int, folder: Path) -> dict[str, Any]:
    """Diagnose one muscle: what was hidden, and what was found."""
    recordings: list[Recording] = [
        as_recording(log, f"{number:02d}_{place}") for place, log in enumerate(bench.logs)
    ]
    save_rig(bench.rig, folder / f"{number:02d}.yaml")
    began = time.process_time()
    (answer,) = diagnose(recordings, bench.rig, threads=1)
    found = {*answer.effects, *(e for group in answer.indistinguishable for e in group)}
    right = bench.effect in found if bench.effect else answer.verdict == "none"
    return {
        "hidden": bench.effect or "none",
        "how": bench.how,
        "verdict": answer.verdict,
        "effects": list(answer.effects),
        "right": right,
        "closed": None if answer.closed is None else answer.closed.value,
        "sentence": answer.sentence,
        "seconds": time.process_time() - began,
    }


def run(given: Arguments) -> Outcome:
    """Draw, diagnose and count; the command of `pam_check.commands.blind`."""
    random = np.random.default_rng(given.seed)
    folder = Path(given.out)
    folder.mkdir(parents=True, exist_ok=True)
    names = hidden_effects()
    order = [str(name) for name in random.permutation(names)]
    rows: list[dict[str, Any]] = []
    for number in range(given.rigs):
        effect = "" if number % NONE_EVERY == NONE_EVERY - 1 else order[number % len(order)]
        how = HOW[number % 2 if effect else number // 4 % 2]
        bench = draw_bench(random, effect, "moving" if effect in ONLY_MOVING else how)
        row = _diagnosed(bench, number, folder)
        rows.append(row)
        print(
            f"{number:2d} {row['hidden']:22s} {row['how']:7s} {row['seconds']:4.0f} s  "
            f"{'right' if row['right'] else 'WRONG'}  {row['verdict']} {', '.join(row['effects'])}",
            flush=True,
        )
        (folder / "score.json").write_text(
            json.dumps({"seed": given.seed, "muscles": rows}, indent=1), encoding="utf-8"
        )
    hidden = [row for row in rows if row["hidden"] != "none"]
    clean = [row for row in rows if row["hidden"] == "none"]
    right, quiet = (sum(row["right"] for row in some) for some in (hidden, clean))
    print(
        f"hidden effect named or in the set: {right} of {len(hidden)}; nothing hidden and none "
        f"found: {quiet} of {len(clean)}"
    )
    missed = len(rows) - right - quiet
    allowed = math.ceil(len(rows) / 12.0)
    return Outcome(
        {"out": str(folder), "right": right, "hidden": len(hidden), "none": quiet,
         "clean": len(clean)},
        [f"{missed} of {len(rows)} muscles wrong"] if missed > allowed else [],
    )  # fmt: skip
