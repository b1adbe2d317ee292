"""Calibrates and diagnoses drawn single muscles on a bench, from independent simulations of them.

A muscle with an ordinary background is put on a bench in one of four ways: the opposing muscle of
a joint moves it, it is held at three lengths, or it pulls against a weight or a spring. Its
pressure, length, force and commands are logged. The rig file has `bench_muscles` and no joint, and
its numbers are off by up to a third. It is calibrated while the muscle is healthy. Then the hidden
effect appears, and another log is diagnosed with the calibrated rig file. Every fourth muscle hides
nothing. All of it goes through files, as an owner would do it.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import yaml

from pam_check.blind.cases import written_rig
from pam_check.blind.draw import believed_rig, draw_excitation
from pam_check.blind.effect_cases import KNOWN
from pam_check.blind.plants import FIRST, PLANTS
from pam_check.blind.rough import (
    TOLERANCES,
    WEAKEST,
    BuriedError,
    DrawnRoughRig,
    draw_rough_rig,
)
from pam_check.blind.truth_plant import (
    Array,
    PressureExcitation,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
)
from pam_check.blind.variety import Variety
from pam_check.calibration.drawn_rig import LENGTHS, THIRD, written_numbers
from pam_gap.calibration.calibrate_files import CALIBRATED_RIG, calibrate_files
from pam_gap.calibration.free_numbers import Said
from pam_gap.diagnosis_files import diagnose_files
from pam_model.command_line import Arguments, Outcome
from pam_model.effects import EFFECTS

TRIES: Final = 40
HOW: Final = ("moving", "held", "weight", "spring")
HELD: Final = (0.99, 0.94, 0.89)
"""Lengths at which a muscle is held, over its rest length."""
SECONDS: Final = 15.0
"""At each of them."""
LOG_SECONDS: Final = 40.0
"""Of a log with a muscle that moves, from which it is calibrated."""
HEAVY: Final = 1e6
"""Inertia of a joint that does not move [kg m^2]."""
LARGER: Final = 4.0
"""Radius of the pulley of a load, over that of the joint."""
LOADING: Final = 2e5
"""Pressure at which the muscle at its longest would carry the largest load [Pa]."""
NONE_EVERY: Final = 4
ONLY_MOVING: Final = ("hysteresis", "creep")
"""Effects that a muscle of constant length does not show."""
SIDES: Final = ("elbow_flexor", "elbow_extensor")
_NO_BACKGROUND: Final = dict(TruthMuscle._field_defaults)


def hidden_effects() -> tuple[str, ...]:
    """The effects that a single muscle with its valve can have."""
    return tuple(
        name
        for name in KNOWN
        if EFFECTS[name].scope != "joint" and EFFECTS[name].search.shown_by != ("position",)
    )


def way_of(number: int, effect: str) -> str:
    """How a muscle is put on the bench: each way with each kind of effect in turn."""
    how = HOW[(number + number // len(HOW)) % len(HOW)]
    return "moving" if how == "held" and effect in ONLY_MOVING else how


@dataclass(frozen=True, slots=True)
class DrawnBench:
    """A drawn muscle on a bench.

    Attributes
    ----------
    effect, how : str
        What is hidden, empty for nothing; and one of `HOW`.
    muscle : str
        Its name.
    parameters : mapping
        The content of `ros__parameters` of its rig file.
    strength : float
        Of the effect in these logs, over the background; 0 for nothing.
    healthy, logs : tuple of pandas.DataFrame
        Recordings of the muscle before and after the effect appeared.
    """

    effect: str
    how: str
    muscle: str
    parameters: Mapping[str, object]
    strength: float
    healthy: tuple[pd.DataFrame, ...]
    logs: tuple[pd.DataFrame, ...]


def _side(effect: str, drawn: DrawnRoughRig) -> int:
    """The muscle that has most of the effect: some effects are drawn on one of both."""
    if not effect or not KNOWN[effect].magnitudes:
        return 0

    def size(side: int) -> float:
        pairs = [
            (getattr(drawn.muscles[side], name), getattr(drawn.healthy.muscles[side], name))
            for name in KNOWN[effect].magnitudes
            if hasattr(drawn.muscles[side], name)
        ]
        return math.fsum(abs(true - usual) for true, usual in pairs)

    return int(size(1) > size(0))


def _log(recording: TruthRecording, length: np.ndarray, side: int) -> pd.DataFrame:
    name = SIDES[side]
    return pd.DataFrame(
        {
            "time": recording.time,
            f"valve_commands.{name}": recording.commands[:, side],
            f"pressure_states.{name}": recording.pressures[:, side],
            f"muscle_states.{name}.position": length,
            f"muscle_states.{name}.effort": recording.forces[:, side],
        }
    )


def _loaded(how: str, joint: TruthJoint, muscle: TruthMuscle, side: int) -> TruthJoint:
    """The load of one muscle: an arm on a large pulley, so that it turns little.

    The torque of the arm is that of a weight where the arm is level, and that of a spring where it
    hangs down.
    """
    sign = 1.0 - 2.0 * side  # of the rotation by which the muscle gets shorter
    radius, reach = LARGER * joint.pulley_radius, joint.upper_limit / LARGER
    longest = muscle.neutral_length + radius * reach
    pull = LOADING * (3.0 * longest**2 - muscle.thread_length**2)
    pull /= 4.0 * math.pi * muscle.turns**2
    is_weight = how == "weight"
    return joint._replace(
        pulley_radius=radius,
        lower_limit=-reach,
        upper_limit=reach,
        inertia=LARGER**2 * joint.inertia,
        viscous_friction=LARGER**2 * joint.viscous_friction,
        gravity_torque=radius * pull / (1.0 if is_weight else 2.0 * reach),
        gravity_angle=-sign * (0.5 * math.pi if is_weight else reach),
    )


def _one_muscle(motion: PressureExcitation, side: int) -> PressureExcitation:
    """The motion of a pair as that of one muscle; the other one stays empty."""
    wave = motion.difference / max(float(np.max(np.abs(motion.difference))), 1.0)
    own = motion.level + 1.0e5 * wave
    return replace(
        motion, level=0.5 * own, difference=(0.5 - side) * own, position_gain=0.0
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Motion:
    """One motion of a bench, which can be played again on another muscle."""

    how: str
    side: int
    drawn: DrawnRoughRig
    excitation: PressureExcitation
    seed: int
    share: float = 0.0  # length at which the muscle is held, over its rest length

    def play(
        self, joint: TruthJoint, muscles: Sequence[TruthMuscle], commands: Array | None = None
    ) -> tuple[TruthRecording, np.ndarray]:
        """A recording and the length of the muscle in it, with given commands or its own."""
        pair, side = tuple(muscles), self.side
        if self.how == "held":
            pair = tuple(m._replace(neutral_length=self.share * m.rest_length) for m in muscles)
            joint = joint._replace(
                inertia=HEAVY, gravity_torque=0.0, coulomb_torque=0.0, static_torque=0.0
            )
        elif self.how != "moving":
            joint = _loaded(self.how, joint, self.drawn.healthy.muscles[side], side)
        recording = PLANTS[FIRST](
            joint, (pair[0], pair[1]), self.excitation, self.drawn.sensors,
            np.random.default_rng(self.seed), supply=self.drawn.supply, fixed_commands=commands,
        )  # fmt: skip
        if self.how == "held":
            return recording, np.full(recording.time.size, pair[side].neutral_length)
        turned = (1.0 - 2.0 * side) * joint.pulley_radius
        return recording, pair[side].neutral_length - turned * recording.position

    def strength(self, recording: TruthRecording) -> float:
        """How much the effects change the muscle's signals, over what its background changes.

        The same commands are given to the rig without its effects, and to one without background.
        """
        healthy = self.drawn.healthy
        plain = [muscle._replace(**_NO_BACKGROUND) for muscle in healthy.muscles]
        usual, _ = self.play(healthy.joint, healthy.muscles, recording.commands)
        ideal, _ = self.play(healthy.joint, plain, recording.commands)

        def apart(one: TruthRecording, other: TruthRecording, name: str) -> float:
            change = getattr(one, name)[:, self.side] - getattr(other, name)[:, self.side]
            return float(np.sqrt(np.mean(np.square(change))))

        signals = ("pressures", "forces")
        return max(apart(recording, usual, n) / apart(usual, ideal, n) for n in signals)


def _motions(
    how: str, side: int, drawn: DrawnRoughRig, random: np.random.Generator
) -> tuple[_Motion, ...]:
    """Motions for one log of each kind that this way needs."""
    step = float(drawn.recording.time[1] - drawn.recording.time[0])
    found = []
    for share in HELD if how == "held" else (0.0,):
        seconds = SECONDS if how == "held" else LOG_SECONDS
        excitation = draw_excitation(random, drawn.joint, step, seconds)
        if how == "held":
            excitation = replace(excitation, position_gain=0.0)
        elif how != "moving":
            excitation = _one_muscle(excitation, side)
        found.append(_Motion(how, side, drawn, excitation, int(random.integers(2**32)), share))
    return tuple(found)


def _written(
    random: np.random.Generator, joint: TruthJoint, muscles: Sequence[TruthMuscle], name: str
) -> dict[str, object]:
    """The rig file of one muscle, whose numbers are off by up to a third, lengths by 5 %."""
    tree = written_numbers(random, joint, muscles[0], muscles[1])
    for other in ("elbow", *SIDES):
        if other != name:
            tree.pop(other)
    return tree | {"joints": [], "bench_muscles": [name]}


def draw_bench(random: np.random.Generator, effect: str, how: str) -> DrawnBench:
    """Draw a muscle with a background and record it on a bench, healthy and with an effect.

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
        stated = written_rig(kind, believed, float(random.choice(TOLERANCES)))
        try:
            drawn = draw_rough_rig(believed, stated, [effect] if effect else [], random)
            side, before = _side(effect, drawn), drawn.healthy
            motions = _motions(how, side, drawn, random)
            healthy = [one.play(before.joint, before.muscles) for one in motions]
            motions = _motions(how, side, drawn, random)
            made = [one.play(drawn.joint, drawn.muscles) for one in motions]
            shown = max(one.strength(log) for one, (log, _) in zip(motions, made, strict=True))
        except (FloatingPointError, BuriedError):
            continue
        if effect and shown < WEAKEST:
            continue
        written = _written(random, before.joint, before.muscles, SIDES[side])
        return DrawnBench(
            effect, how, SIDES[side], written, shown if effect else 0.0,
            tuple(_log(*one, side) for one in healthy), tuple(_log(*one, side) for one in made),
        )  # fmt: skip
    raise RuntimeError(f"no muscle with {effect or 'nothing'} that can run in {TRIES} draws")


def _saved(tables: Sequence[pd.DataFrame], folder: Path, name: str) -> list[str | Path]:
    paths: list[str | Path] = []
    for number, table in enumerate(tables):
        paths.append(folder / f"{name}_{number}.csv")
        table.to_csv(paths[-1], index=False)
    return paths


def _diagnosed(bench: DrawnBench, folder: Path) -> dict[str, Any]:
    """Calibrate the healthy muscle and diagnose the other logs with its file: what was found."""
    folder.mkdir(parents=True, exist_ok=True)
    rig = folder / "rough.yaml"
    rig.write_text(yaml.safe_dump({"/**": {"ros__parameters": dict(bench.parameters)}}))
    found: dict[str, Any] = {
        "hidden": bench.effect or "none",
        "how": bench.how,
        "strength": bench.strength,
        "right": False,
    }
    began = time.process_time()
    (calibrated,) = calibrate_files(
        _saved(bench.healthy, folder, "healthy"), rig, folder / "calibration",
        said=Said(THIRD, LENGTHS), threads=1, show_progress=False,
    )  # fmt: skip
    found["calibration_seconds"] = time.process_time() - began
    if calibrated.refused:
        return found | {"verdict": "refused", "effects": [], "sentence": calibrated.refused[0]}
    began = time.process_time()
    (answer,) = diagnose_files(
        _saved(bench.logs, folder, "log"), folder / "calibration" / CALIBRATED_RIG,
        folder / "diagnosis", threads=1, show_progress=False,
    )  # fmt: skip
    named = {*answer.effects, *(e for group in answer.indistinguishable for e in group)}
    return found | {
        "verdict": answer.verdict,
        "effects": list(answer.effects),
        "right": bench.effect in named if bench.effect else answer.verdict == "none",
        "closed": None if answer.closed is None else answer.closed.value,
        "sentence": answer.sentence,
        "seconds": time.process_time() - began,
    }


def _of_folder(folder: Path, seed: int) -> list[dict[str, Any]]:
    """What was found of all muscles of one seed whose results are in a folder."""
    found = (json.loads(p.read_text("utf-8")) for p in sorted(folder.glob("*/result.json")))
    return [one["muscle"] for one in found if one["seed"] == seed]


def run(given: Arguments) -> Outcome:
    """Draw, calibrate, diagnose and count; the command of `pam_check.commands.calibration`.

    Each muscle has random draws of its own, so that several processes can share a campaign.
    """
    folder = Path(given.out)
    order = [str(name) for name in np.random.default_rng(given.seed).permutation(hidden_effects())]
    for number in range(given.first, given.first + given.rigs):
        effect = "" if number % NONE_EVERY == NONE_EVERY - 1 else order[number % len(order)]
        random = np.random.default_rng([given.seed, number])
        own = folder / f"{number:02d}"
        row = _diagnosed(draw_bench(random, effect, way_of(number, effect)), own)
        print(
            f"{number:2d} {row['hidden']:22s} {row['strength']:4.1f} {row['how']:7s} "
            f"{row['calibration_seconds']:4.0f} s + {row.get('seconds', 0.0):4.0f} s  "
            f"{'right' if row['right'] else 'WRONG'}  {row['verdict']} {', '.join(row['effects'])}",
            flush=True,
        )
        (own / "result.json").write_text(
            json.dumps({"seed": given.seed, "muscle": row}, indent=1), encoding="utf-8"
        )
    rows = _of_folder(folder, given.seed)
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
