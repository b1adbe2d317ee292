"""Diagnose measured recordings of others, and compare with what is known of them.

`python benchmarks/real_recordings.py --out out/real_recordings` prints the first rows of the table
of docs/how_often_right.md, with `--clones FOLDER` all of them. With `--check` it ends with exit
code 1 if an answer is sure and wrong.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import pandas as pd
import public_logs
import yaml

from pam_gap.diagnosis_files import diagnose_files
from pam_model.argument_types import input_folder, output_folder
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.effects.registry import EFFECTS
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig, save_rig

DATA = Path(__file__).parents[1] / "tests" / "data" / "closed_pair"
ARM, PLATFORM = DATA.parent / "four_joint_arm", DATA.parent / "festo_platform"
EPISODE = 1.3  # s
ARM_RATE = 100.0  # Hz; an assumption, the origin states none
ARM_FULL_SCALE = 5e5  # Pa; an assumption, the origin normalised its pressures
REFUSED = "refused"
TABLES = (".csv", ".gz", ".parquet", ".mat", ".json", ".txt", ".mcap")

OF_A_MUSCLE = frozenset(e.name for e in EFFECTS.values() if e.stage == "muscle")


@dataclass(frozen=True, slots=True)
class Measured:
    """A measured recording.

    Attributes
    ----------
    name, known : str
        What it is, and what is known of it.
    possible : frozenset of str or None
        Effects that may be named; None if nothing is known of them.
    answer : callable
        Makes the diagnosis in a folder: verdict, effects and sentence.
    """

    name: str
    known: str
    possible: frozenset[str] | None
    answer: Callable[[Path], tuple[str, tuple[str, ...], str]]


def _pair_table() -> pd.DataFrame:
    """The measured pair with the channels of the rig contract."""
    rig, table = load_rig(DATA / "rig.yaml"), pd.read_csv(DATA / "recording.csv.gz")
    joint = rig.joints[0]
    columns = {"time": table["time_s"]}
    for muscle, place in zip(joint.muscles, (1, 2), strict=True):
        columns[f"pressure_states.{muscle}"] = 1e3 * table[f"pressure_{place}_kPa"]
    columns[f"joint_states.{joint.name}.position"] = table["displacement_m"] / joint.pulley_radius
    columns[f"joint_states.{joint.name}.effort"] = table["motor_force_N"] * joint.pulley_radius
    return pd.DataFrame(columns)


def _diagnosed(
    recordings: list[Path],
    rig: Path,
    out: Path,
    *,
    shut: bool = False,
    column_map: Path | None = None,
) -> tuple[str, tuple[str, ...], str]:
    try:
        answers = diagnose_files(
            [] if shut else recordings, rig, out, shut=recordings if shut else [],
            map_path=column_map, show_progress=False,
        )  # fmt: skip
    except PamError as error:
        return REFUSED, (), str(error)
    effects = tuple(dict.fromkeys(effect for a in answers for effect in a.effects))
    verdicts = ", ".join(dict.fromkeys(a.verdict for a in answers))
    return verdicts, effects, answers[0].sentence


def _pair(out: Path) -> tuple[str, tuple[str, ...], str]:
    table = out / "recording.csv"
    _pair_table().to_csv(table, index=False)
    return _diagnosed([table], DATA / "rig.yaml", out, shut=True)


def _pair_in_kpa(out: Path) -> tuple[str, tuple[str, ...], str]:
    made = _pair_table()
    for name in list(made):
        if str(name).startswith("pressure_states"):
            made[name] = 1e-3 * made[name]
    made.to_csv(out / "recording.csv", index=False)
    return _diagnosed([out / "recording.csv"], DATA / "rig.yaml", out, shut=True)


def _pair_in_episodes(out: Path) -> tuple[str, tuple[str, ...], str]:
    made = _pair_table()
    tables = []
    for number, start in enumerate((0.0, 2.0, 4.0, 6.0)):
        rows = made[(made["time"] >= start) & (made["time"] < start + EPISODE)]
        tables.append(out / f"episode_{number}.csv")
        rows.to_csv(tables[-1], index=False)
    return _diagnosed(tables, DATA / "rig.yaml", out, shut=True)


def arm_rig() -> Rig:
    """A rig of four joints with the muscles of the pair; those of the arm are not known."""
    pair = load_rig(DATA / "rig.yaml")
    joints = tuple(
        replace(
            pair.joints[0], name=f"joint_{k}", muscles=(f"muscle_{2 * k}", f"muscle_{2 * k + 1}")
        )
        for k in range(4)
    )
    limits = (-3.0, 3.0)
    muscles = tuple(
        replace(
            pair.muscles[0], name=f"muscle_{k}",
            valve=replace(pair.muscles[0].valve, kind="pressure_regulator"),
        )
        for k in range(8)
    )  # fmt: skip
    return replace(
        pair, joints=tuple(replace(j, position_limits=limits) for j in joints), muscles=muscles
    )


def _arm(out: Path, scale: float) -> tuple[str, tuple[str, ...], str]:
    save_rig(arm_rig(), out / "rig.yaml")
    channels: dict[str, object] = {
        f"pressure_states.muscle_{k}": {"column": f"pressure_{k}", "scale": scale} for k in range(8)
    }
    channels |= {f"joint_states.joint_{k}.position": f"angle_{k}" for k in range(4)}
    (out / "map.yaml").write_text(yaml.safe_dump({"rate": ARM_RATE, "channels": channels}))
    episodes = sorted(ARM.glob("episode_*.csv"))
    return _diagnosed(episodes, out / "rig.yaml", out, column_map=out / "map.yaml")


def _platform(_: Path) -> tuple[str, tuple[str, ...], str]:
    return _diagnosed([PLATFORM / "PtoD_40.csv"], DATA / "rig.yaml", _)


RECORDINGS = (
    Measured(
        "pair of shut muscles, pushed by a motor",
        "hysteresis; dry friction at the joint looks the same in this motion",
        frozenset({"hysteresis", "coulomb_friction", "stribeck_friction"}),
        _pair,
    ),
    Measured(
        "the same, with its pressures in kPa, as logged", "wrong unit", frozenset(), _pair_in_kpa
    ),
    Measured(
        "four parts of it of 1.3 s", "too short for any answer", frozenset(), _pair_in_episodes
    ),
    Measured(
        "arm of four joints, episodes of a second, normalised pressures",
        "geometry, rate and scale are not published",
        frozenset(),
        lambda out: _arm(out, 1.0),
    ),
    Measured(
        "the same, with an assumed scale of 5 bar and 100 Hz",
        "too short for any answer",
        frozenset(),
        lambda out: _arm(out, ARM_FULL_SCALE),
    ),
    Measured(
        "six muscles on a platform, steps of pressure",
        "no time was recorded; hysteresis",
        frozenset(),
        _platform,
    ),
)


def _prepared(log: public_logs.Prepared, out: Path) -> tuple[str, tuple[str, ...], str]:
    recordings, rig, column_map = log
    return _diagnosed(recordings, rig, out, column_map=column_map)


def _joint_of_arm(clones: Path, out: Path, sign: float) -> tuple[str, tuple[str, ...], str]:
    rig = arm_rig()
    joint = rig.joints[0]
    rig = replace(rig, joints=(joint,), muscles=rig.muscles[:2])
    save_rig(rig, out / "rig.yaml")
    table = public_logs.arm_table(clones)
    public_logs.as_channels(table, joint.name, joint.muscles, sign).to_csv(
        out / "recording.csv", index=False
    )
    return _diagnosed([out / "recording.csv"], out / "rig.yaml", out)


def of_clones(clones: Path) -> tuple[Measured, ...]:
    """The logs that are not part of this repository."""
    return (
        Measured(
            "Festo muscle of 10 mm, held at four lengths (12 recordings)",
            "bladder, ends and threshold pressure that an ideal braid does not have",
            OF_A_MUSCLE - {"braid_extensibility", "cable_compliance"},  # nothing there stretches
            lambda out: _prepared(public_logs.held_muscle(clones, out), out),
        ),
        Measured(
            "Festo muscle of 10 mm and 15 cm: force models, held-out tests",
            "-",
            frozenset(),
            lambda out: ("-", (), public_logs.held_out_errors(clones, out)),
        ),
        Measured(
            "joint of an arm with regulators, 100 Hz",
            "the sign of the angle is reversed; geometry and unit are not published",
            frozenset(),
            lambda out: _joint_of_arm(clones, out, 1.0),
        ),
        Measured(
            "the same with the sign turned",
            "geometry and unit are not published",
            frozenset(),
            lambda out: _joint_of_arm(clones, out, -1.0),
        ),
        Measured(
            "regulator of a soft robot, 50 Hz",
            "neither length nor force was recorded",
            frozenset(),
            lambda out: _prepared(public_logs.regulator(clones, out), out),
        ),
    )


def of_folder(cases: Path) -> tuple[Measured, ...]:
    """One row for each subfolder that holds a rig.yaml, tables and perhaps a map.yaml."""
    found = []
    for rig in sorted(cases.glob("*/rig.yaml")):
        tables = [path for path in sorted(rig.parent.iterdir()) if path.suffix in TABLES]
        column_map = rig.parent / "map.yaml"
        log = tables, rig, column_map if column_map.exists() else None
        if tables:
            found.append(Measured(rig.parent.name, "-", None, partial(_prepared, log)))
    return tuple(found)


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--clones",
        type=input_folder,
        metavar="FOLDER",
        help="folder with clones of the repositories on the page, which are not part of this one",
    )
    parser.add_argument(
        "--cases",
        type=input_folder,
        metavar="FOLDER",
        help="folder with logs of your own: in each subfolder rig.yaml, tables, perhaps map.yaml",
    )
    parser.add_argument(
        "--out",
        type=output_folder,
        default="out/real_recordings",
        help="folder (default: %(default)s)",
    )


def _run(given: Arguments) -> Outcome:
    rows, wrong = [], []
    recordings: tuple[Measured, ...] = RECORDINGS
    if given.clones is not None:
        recordings += of_clones(given.clones)
    if given.cases is not None:
        recordings += of_folder(given.cases)
    for number, measured in enumerate(recordings):
        out = given.out / str(number)
        out.mkdir(parents=True, exist_ok=True)
        began = time.process_time()
        try:
            verdict, effects, sentence = measured.answer(out)
        except PamError as error:
            verdict, effects, sentence = REFUSED, (), str(error)
        seconds = time.process_time() - began
        rows.append(
            {
                "recording": measured.name, "known": measured.known, "verdict": verdict,
                "effects": ", ".join(effects), "seconds": round(seconds, 1), "sentence": sentence,
            }
        )  # fmt: skip
        text = f"{measured.name} ({measured.known}): {verdict}, {seconds:.0f} s"
        print(f"{text}\n    {sentence}", flush=True)
        if measured.possible is None:
            continue
        strangers = set(effects) - measured.possible
        if strangers or "none" in verdict.split(", "):
            wrong.append(f"{measured.name}: {verdict} {', '.join(sorted(strangers))}".rstrip())
    return Outcome(rows, wrong)


BENCH = Command(
    "real_recordings",
    "diagnose measured recordings of others and compare with what is known of them",
    _declare,
    _run,
    bad_news="if an answer is sure and wrong",
)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/real_recordings.py"))
