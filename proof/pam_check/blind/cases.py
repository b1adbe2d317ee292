"""The generator process: draws cases, writes recordings and rig files, and seals the labels.

Run as `python -m pam_check.blind.cases`; the diagnosis never imports this module. The labels are
written to a folder that no diagnosis knows. Their SHA-256 is printed, so that it can be shown later
that the opened labels are the drawn ones.
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import hashlib
import json
import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from pam_check.blind.background import LENGTHS_BETTER
from pam_check.blind.draw import (
    Draw,
    believed_rig,
    draw_excitation,
    draw_sensors,
    perturbed,
)
from pam_check.blind.effect_cases import KNOWN, OUTSIDE, case_of, stage_of
from pam_check.blind.plants import FIRST, PLANTS
from pam_check.blind.rough import TOLERANCES, BuriedError, draw_rough_rig, uneven
from pam_check.blind.strength import channels
from pam_check.blind.truth_plant import (
    Array,
    Sensors,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
)
from pam_check.blind.variety import Variety, draw_variety
from pam_model.argument_types import count, output_folder
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.rig import Rig, rig_from_parameters, save_rig

MAX_TRIES = 20
type Write = Callable[[pd.DataFrame, Path], object]
LABELS = "labels.json"


@dataclass
class Label:
    """The hidden effects of a case, which are sealed."""

    case: str
    kind: str  # none, one, two, outside
    effects: list[str]
    stages: list[str]
    gap_over_floor: float
    """Largest RMS change of a channel due to the effects, in multiples of its noise."""
    joint: dict[str, float]
    muscles: list[dict[str, float]]
    sensors: dict[str, float]
    load_cells: bool
    strength: float = 0.0
    """Strength of the effects above the background; 0 without effects or without a background."""
    strengths: list[float] = field(default_factory=list)
    """Strength of each effect alone."""
    supply: dict[str, float] = field(default_factory=dict)
    variety: dict[str, float] = field(default_factory=dict)
    """Kind of the rig; empty if all rigs are of one kind."""


def _muscle_parameters(muscle: TruthMuscle) -> dict[str, object]:
    return {
        "model": "chou_hannaford",
        "thread_length": muscle.thread_length,
        "turns": muscle.turns,
        "wall_thickness": 0.0,
        "rest_length": muscle.rest_length,
        "neutral_length": muscle.neutral_length,
        "dead_volume": muscle.dead_volume,
        "valve": {
            "kind": "pressure_regulator" if muscle.regulator > 0.0 else "flow",
            "sonic_conductance": muscle.sonic_conductance,
            "critical_ratio": muscle.critical_ratio,
            "time_constant": muscle.time_constant,
        },
    }


def rig_parameters(
    joint: TruthJoint,
    muscle: TruthMuscle,
    tolerance: float,
    length_tolerance: float | None = None,
    other: TruthMuscle | None = None,
) -> dict[str, object]:
    """The nominal rig as keys of a rig file; `other` is the second muscle if it is another one."""
    return {
        "gas": {
            "temperature": joint.temperature,
            "ambient_pressure": joint.ambient_pressure,
            "polytropic_exponent": 1.0,
        },
        "supply_pressure": joint.supply_pressure,
        "parameter_tolerance": tolerance,
        **({} if length_tolerance is None else {"length_tolerance": length_tolerance}),
        "joints": ["elbow"],
        "elbow": {
            "muscles": ["elbow_flexor", "elbow_extensor"],
            "pulley_radius": joint.pulley_radius,
            "inertia": joint.inertia,
            "viscous_friction": joint.viscous_friction,
            "gravity_torque": joint.gravity_torque,
            "gravity_angle": joint.gravity_angle,
            "position_limits": [joint.lower_limit, joint.upper_limit],
        },
        "elbow_flexor": _muscle_parameters(muscle),
        "elbow_extensor": _muscle_parameters(other or muscle),
    }


def written_rig(
    kind: Variety, believed: tuple[TruthJoint, tuple[TruthMuscle, TruthMuscle]], tolerance: float
) -> Rig:
    """The rig file of a believed rig with a background, whose lengths are measured better."""
    first, second = map(kind.muscle, believed[1])
    stated = rig_parameters(
        kind.joint(believed[0]), first, tolerance, LENGTHS_BETTER * tolerance, second
    )
    return rig_from_parameters(stated)


def to_table(recording: TruthRecording, load_cells: bool) -> pd.DataFrame:
    """The channels with the names that a recording uses."""
    table = channels(recording)
    if load_cells:
        table["muscle_states.elbow_flexor.effort"] = recording.forces[:, 0]
        table["muscle_states.elbow_extensor.effort"] = recording.forces[:, 1]
    return pd.DataFrame(table)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write a recording as a compressed CSV file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(path, index=False, float_format="%.7g")


def drawn_effects(random: np.random.Generator, kind: str) -> list[str]:
    """Names of the effects of a case of a kind, such as "one"."""
    known = list(KNOWN)
    if kind == "none":
        return []
    if kind == "outside":
        return [str(random.choice(list(OUTSIDE)))]
    if kind == "one":
        return [str(random.choice(known))]
    first = str(random.choice(known))
    others = [k for k in known if k != first]
    return [first, str(random.choice(others))]


def _rms(difference: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(np.square(difference), axis=0)))


def _moves_well(recording: TruthRecording, joint: TruthJoint) -> bool:
    """Whether the joint moves, and is hardly ever at its end stops."""
    travel = float(np.ptp(recording.true_position))
    stopped = np.mean(np.abs(recording.true_position) > 0.98 * joint.upper_limit)
    return bool(travel >= 0.15 and stopped <= 0.02)


def _over_floor(recording: TruthRecording, without: TruthRecording, sensors: Sensors) -> float:
    """Largest RMS change of a channel by the hidden effects, in multiples of its noise."""
    floor_p = float(np.hypot(sensors.pressure_noise, sensors.pressure_step / 12**0.5))
    floor_q = float(np.hypot(sensors.position_noise, sensors.position_step / 12**0.5))
    change_p = _rms(recording.pressures - without.true_pressures).max() / floor_p
    change_q = float(_rms(recording.position - without.true_position)) / floor_q
    return float(max(change_p, change_q))


def make_case(
    name: str,
    kind: str,
    folder: Path,
    sealed: Path,
    random: np.random.Generator,
    plant: str = FIRST,
    write: Write = write_table,
) -> Label:
    """Draw one case, write rig.yaml and recording.csv.gz, and return its label.

    A second recording of the same rig with another motion is written to the sealed folder. It
    shows later how much the improved rig closes the gap.

    Raises
    ------
    RuntimeError
        When MAX_TRIES draws give no rig that can run.
    """
    effects, run = drawn_effects(random, kind), PLANTS[plant]
    for _ in range(MAX_TRIES):
        joint, muscle = believed_rig(random)
        tolerance = float(random.choice([0.0, 0.01, 0.02]))
        draw = Draw(random, joint, [muscle, muscle])
        perturbed(draw, tolerance)
        plain_joint, plain = draw.joint, (draw.muscles[0], draw.muscles[1])
        for effect in effects:
            case_of(effect).draw(draw)
        excitation = draw_excitation(random, joint, float(random.choice([0.002, 0.002, 0.0025])))
        sensors = draw_sensors(random)
        hidden = (draw.muscles[0], draw.muscles[1])
        try:
            recording = run(draw.joint, hidden, excitation, sensors, random)
            check_motion = draw_excitation(random, joint, excitation.sample_time)
            check = run(draw.joint, hidden, check_motion, sensors, random)
            without = run(
                plain_joint, plain, excitation, sensors, random, fixed_commands=recording.commands
            )
        except FloatingPointError:
            continue
        if not _moves_well(recording, joint):
            continue
        target = folder / name
        target.mkdir(parents=True)
        save_rig(rig_from_parameters(rig_parameters(joint, muscle, tolerance)), target / "rig.yaml")
        load_cells = bool(random.random() < 0.25)
        for made, place in ((recording, target), (check, sealed / name)):
            write(to_table(made, load_cells), place / "recording.csv.gz")
        return Label(
            case=name,
            kind=kind,
            effects=effects,
            stages=[stage_of(e) for e in effects],
            gap_over_floor=_over_floor(recording, without, sensors),
            joint={k: float(v) for k, v in draw.joint._asdict().items()},
            muscles=[{k: float(v) for k, v in m._asdict().items()} for m in draw.muscles],
            sensors=asdict(sensors),
            load_cells=load_cells,
        )
    raise RuntimeError(f"no rig with {effects} that can run in {MAX_TRIES} draws")


def make_rough_case(
    name: str,
    kind: str,
    folder: Path,
    sealed: Path,
    random: np.random.Generator,
    plant: str = FIRST,
    write: Write = write_table,
    varied: bool = False,
) -> Label:
    """Draw one case with an ordinary background, as `make_case` draws one without.

    With `varied`, the rig is of a kind that is drawn, too (`variety.Variety`).

    Raises
    ------
    RuntimeError
        When MAX_TRIES draws give no rig that can run.
    """
    effects = drawn_effects(random, kind)
    for _ in range(MAX_TRIES):
        variety = draw_variety(random, regulators=plant == FIRST) if varied else None
        rig = variety or Variety()
        if rig.hidden.intersection(effects):
            continue
        joint, muscle = believed_rig(random)
        tolerance = float(random.choice(TOLERANCES))
        believed = rig.believed(joint, muscle)
        written = written_rig(rig, believed, tolerance)
        try:
            drawn = draw_rough_rig(believed, written, effects, random, plant, variety)
        except (FloatingPointError, BuriedError):
            continue
        if not _moves_well(drawn.recording, joint):
            continue
        load_cells = bool(random.random() < 0.25)
        target = folder / name
        target.mkdir(parents=True)
        save_rig(written, target / "rig.yaml")
        for made, place in ((drawn.recording, target), (drawn.check, sealed / name)):
            table = uneven(rig.logged(to_table(made, load_cells)), random)
            write(table, place / "recording.csv.gz")
        return Label(
            case=name,
            kind=kind,
            effects=effects,
            stages=[stage_of(e) for e in effects],
            gap_over_floor=_over_floor(drawn.recording, drawn.without, drawn.sensors),
            joint={k: float(v) for k, v in drawn.joint._asdict().items()},
            muscles=[{k: float(v) for k, v in m._asdict().items()} for m in drawn.muscles],
            sensors=asdict(drawn.sensors),
            load_cells=load_cells,
            strength=drawn.strength,
            strengths=list(drawn.strengths),
            supply={k: float(v) for k, v in drawn.supply._asdict().items()},
            variety={k: float(v) for k, v in asdict(variety).items()} if variety else {},
        )
    raise RuntimeError(f"no rig with {effects} that can run in {MAX_TRIES} draws")


def make_cases(
    count: int,
    seed: int,
    folder: Path,
    sealed: Path,
    background: bool = False,
    plant: str = FIRST,
    varied: bool = False,
) -> str:
    """Write `count` cases into `folder`, their labels into `sealed`; return the labels' SHA-256.

    Half of the cases hide one effect. The others hide none, two, or one outside the table, in equal
    shares. With `background`, every rig has an ordinary background besides; with `varied`, rigs
    with a background are of many sizes and kinds. Every plant gets the same draws from the same
    seed, as long as the drawn rigs can run on it.
    """
    random = np.random.default_rng(seed)
    kinds = random.permutation(
        [("one", "none", "one", "two", "one", "outside")[k % 6] for k in range(count)]
    )
    make = partial(make_rough_case, varied=varied) if background or varied else make_case
    with ThreadPoolExecutor(1) as writer:  # the plants are simulated meanwhile
        written: list[Future[None]] = []

        def write(table: pd.DataFrame, path: Path) -> None:
            written.append(writer.submit(write_table, table, path))

        labels = [
            make(f"{k:03d}", str(kind), folder, sealed, random, plant, write)
            for k, kind in enumerate(kinds)
        ]
        for one in written:
            one.result()
    text = json.dumps([asdict(label) for label in labels], indent=1)
    (sealed / LABELS).write_text(text)
    return hashlib.sha256(text.encode()).hexdigest()


def _declare(parser: Parser) -> None:
    parser.add_argument("--cases", type=count(), required=True, metavar="N")
    parser.add_argument("--seed", type=count(0), required=True, metavar="N")
    parser.add_argument("--folder", type=output_folder, required=True, help="folder for the cases")
    parser.add_argument(
        "--sealed",
        type=output_folder,
        required=True,
        help="folder for labels and second recordings",
    )
    parser.add_argument("--background", action="store_true", help="rigs with a background")
    parser.add_argument("--varied", action="store_true", help="rigs of many sizes and kinds")
    parser.add_argument(
        "--plant", choices=list(PLANTS), default=FIRST, help="plant that makes the recordings"
    )


def _run(given: Arguments) -> Outcome:
    digest = make_cases(
        given.cases, given.seed, given.folder, given.sealed, given.background, given.plant,
        given.varied,
    )  # fmt: skip
    print(digest)
    return Outcome({"labels_sha256": digest})


def main() -> int:
    """Draw cases from the command line and print only the digest of the labels."""
    command = Command(
        "cases", "draw rigs with hidden effects and seal their labels", _declare, _run
    )
    return run_command(command, "python -m pam_check.blind.cases")


if __name__ == "__main__":
    sys.exit(main())
