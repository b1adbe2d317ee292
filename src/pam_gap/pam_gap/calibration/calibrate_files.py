"""`pam gap calibrate LOG... --rig RIG --out DIR`: from logs and a rough rig file to one that fits.

It writes calibrated.yaml, calibration.json and calibration.html. Where signs or hoses are exchanged
there is no calibrated rig file: such a robot must be put right first.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pam_gap.calibration.answer import (
    comments,
    sentence,
    table_lines,
    to_json,
    withheld_lines,
)
from pam_gap.calibration.bench import calibrate_bench_muscle
from pam_gap.calibration.calibration import KEPT, Calibration, calibrate_joint
from pam_gap.calibration.calibration_rules import DEFAULT
from pam_gap.calibration.free_numbers import Said
from pam_gap.calibration.known_rig import as_known
from pam_gap.calibration.page import write_page
from pam_gap.diagnose_recordings import joints_to_diagnose
from pam_gap.diagnosis_files import import_as_mounted, joint_progress
from pam_gap.prediction.bench_joint import bench_muscles_recorded, expected_channels
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.parts import part_of
from pam_gap.recordings.recording import TURNED_OVER, Recording, RecordingError
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.rig import Rig, save_rig
from pam_model.rig.partial import PartialRig, load_partial_rig
from pam_ros.program_name import PROGRAM

CALIBRATED_RIG = "calibrated.yaml"


def without_the_end(
    recordings: Sequence[Recording], share: float
) -> tuple[list[Recording], list[Recording]]:
    """The longest recording without its last part, and this part alone."""
    longest = max(range(len(recordings)), key=lambda k: recordings[k].duration)
    whole = recordings[longest]
    cut = round((1.0 - share) * whole.time.size)
    kept = list(recordings)
    kept[longest] = part_of(whole, 0, cut)
    return kept, [part_of(whole, cut, whole.time.size)]


def calibrate_files(
    logs: Sequence[str | Path],
    rig_path: str | Path,
    out: str | Path,
    *,
    withheld: Sequence[str | Path] = (),
    turned_over: Sequence[str | Path] = (),
    joint: str | None = None,
    said: Said,
    map_path: str | Path | None = None,
    threads: int = 0,
    show_progress: bool = True,
) -> list[Calibration]:
    """Calibrate every joint in the recordings, or one, and write the results to `out`.

    Parameters
    ----------
    logs : sequence of str or Path
        Recordings of one rig.
    rig_path : str or Path
        Its rig file, in which numbers may be missing or given as ranges.
    out : str or Path
        Folder of the results.
    withheld : sequence of str or Path
        Further recordings that take no part in the fit; by default the last part of the longest
        recording.
    turned_over : sequence of str or Path
        Further recordings with the joint mounted upside down.
    joint : str, optional
        Name of the only joint to calibrate.
    said : Said
        How far plain numbers of the rig file may be off.
    map_path : str or Path, optional
        Map of the columns of tables.
    threads : int
        Number of simulations that run in parallel; 0 for one per processor, at most 4.
    show_progress : bool
        Show a progress bar where standard error is a terminal.

    Raises
    ------
    PamError
        For a rig file or recording that cannot be used.
    """
    partial = load_partial_rig(rig_path)
    column_map = None if map_path is None else load_column_map(map_path)
    read = import_as_mounted(logs, partial.rig, {TURNED_OVER: turned_over}, column_map=column_map)
    tried = import_as_mounted(withheld, partial.rig, column_map=column_map)
    benches = [] if joint else bench_muscles_recorded(partial.rig, [*read, *tried])
    if not partial.rig.joints and not benches:
        raise RecordingError(
            f"{rig_path}: no joint, and no recording holds all channels of a muscle "
            f"on a bench; expected {expected_channels(partial.rig)}"
        )
    joints: list[int] = []
    if partial.rig.joints and not benches:
        joints = joints_to_diagnose(partial.rig, read, joint)
        if tried:
            joints_to_diagnose(partial.rig, tried, joint)
    words = "recordings that took no part in the fit"
    if not tried:
        read, tried = without_the_end(read, DEFAULT.withheld)
        words = f"the last {100 * DEFAULT.withheld:.0f} % of the recording, which were not fitted"
    subjects = [partial.rig.joint_names[number] for number in joints] + benches
    found = []
    rig: Rig = partial.rig
    notes: dict[str, str] = {}
    for name in subjects:
        with progress(1.0, name, wanted=show_progress) as bar:
            how: dict[str, Any] = {
                "said": said,
                "threads": max(threads, 1),
                "progress": joint_progress(bar, name),
            }
            one = (
                calibrate_bench_muscle(partial, name, read, tried, **how)
                if name in benches
                else calibrate_joint(partial, partial.rig.joint_number(name), read, tried, **how)
            )
        folder = Path(out) if len(subjects) == 1 else Path(out) / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "calibration.json").write_text(
            json.dumps(to_json(one), indent=1) + "\n", encoding="utf-8"
        )
        write_page(one, words, folder / "calibration.html")
        if one.rig is not None:
            rig = _merged(rig, one.rig, name)
            notes |= comments(one, are_ranges=True)
        found.append(one)
    if notes and not any(one.refused for one in found):
        made = f"Calibrated by {PROGRAM} gap calibrate. A comment says what is known of a number."
        numbers = [number for one in found for number in one.numbers]
        save_rig(
            as_known(rig, numbers, said), Path(out) / CALIBRATED_RIG, (made,), notes,
            left_open(partial, found),
        )  # fmt: skip
    return found


def left_open(
    partial: PartialRig, found: Sequence[Calibration]
) -> dict[str, tuple[float, float] | None]:
    """The numbers that stay a range, or stay missing (None), because nothing was found of them.

    Else the rig file would have guesses in it that nobody has stated.
    """
    known = {one.key for each in found for one in each.numbers if one.status != KEPT}
    written = dict.fromkeys(partial.missing) | dict(partial.ranges)
    return {key: ends for key, ends in written.items() if key not in known}


def _merged(rig: Rig, calibrated: Rig, name: str) -> Rig:
    """The rig with one joint and its muscles, or one muscle on a bench, as calibrated."""
    rig = replace(rig, supply_pressure=calibrated.supply_pressure)
    if name not in rig.joint_names:
        return rig.with_muscle(calibrated.muscle(name))
    joint = calibrated.joint(name)
    for muscle in joint.muscles:
        rig = rig.with_muscle(calibrated.muscle(muscle))
    return rig.with_joint(joint)


def run(given: Arguments) -> Outcome:
    """Calibrate and print what was found; the command of `pam_gap.__main__`."""
    found = calibrate_files(
        given.recordings,
        given.rig,
        given.out,
        withheld=given.withheld,
        turned_over=given.turned_over,
        joint=given.joint,
        said=Said(given.tolerance, given.length_tolerance),
        map_path=given.map,
        threads=given.threads,
        show_progress=not given.no_progress,
    )
    for one in found:
        print(f"{one.joint}: {sentence(one)}")
        for line in (*table_lines(one), *withheld_lines(one, "what was not fitted")):
            print(line)
    print(f"written: {given.out}")
    path = Path(given.out) / CALIBRATED_RIG
    if path.is_file() and load_partial_rig(path).is_rough:
        print(f"{CALIBRATED_RIG} is still rough: state what is open in it, or give more logs")
    return Outcome(
        {"out": given.out, "joints": [to_json(one) for one in found]},
        [f"{one.joint}: {text}" for one in found for text in one.refused],
    )
