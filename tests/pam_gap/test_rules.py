"""The table of hand-set constants: complete, in use, and the only place that has any."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

import pam_gap
from pam_gap.inference.candidates import transport_time
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.noise_floor import channel_noise
from pam_gap.rules import DEFAULT, changed, table
from pam_gap.rules.rule import DECISION, DIAGNOSIS, PROPOSAL
from pam_model.errors import PamError
from pam_model.rig import Rig

from .conftest import Maker

HOME = Path(pam_gap.__file__).parent
DECIDING = (
    "diagnosis_engine.py",
    "inference/*.py",
    "prediction/*.py",
    "recordings/noise_floor.py",
    "recordings/computed_channels.py",
    "fleet/change_points.py",
    "fleet/follow_all.py",
    "fleet/tracking.py",
    "experiments/next_experiment.py",
    "answer/write_answer.py",
)
NO_RULES = {
    "FORMAT": "version of a file",
    "LOW": "90 % interval",
    "HIGH": "90 % interval",
    "NORMAL_90": "90 % interval",
    "PROFILE_90": "90 % interval",
    "HARMONICS": "regressors of a law of any form",
    "MEMORY": "regressors of a law of any form",
    "SMOOTHING": "regressors of a law of any form",
    "PARTS": "accuracy of a cross-validation",
    "N_CHANNELS": "layout",
    "N_GAINS": "layout",
    "SPEED": "layout",
    "FOLLOW_MOTION": "code of a mode",
    "FOLLOW_PRESSURES": "code of a mode",
    "FOLLOW_BOTH": "code of a mode",
    "ONE_STEP_BANDWIDTH": "horizon of a reported figure",
    "DIVERGED": "stands for infinite",
    "LOCKED_INERTIA": "stands for infinite",
    "LOCKED_DECAY": "stands for at once",
    "SIDE_BY_SIDE": "memory of fits, which changes no result",
    "FEWEST_SIDE_BY_SIDE": "memory of fits, which changes no result",
    "MOST_ACTIVE_SETS": "after which another method finds the same minimum",
    "MOST_BOUNDS": "more than a minimum in a box needs",
    "MOST_KEPT": "memory, which changes no result",
    "HEADROOM": "sizes of real sensors",
    "ECCENTRIC_ROUNDS": "after which the angle no longer changes",
    "LARGEST": "stands for no bound",
    "ROUNDS": "of weights that no longer change, for a choice of what is simulated",
    "STOP_UNIT": "unit of an amount, which changes no result",
    "MOST_SAMPLES": "work of a regression of a few numbers",
    "FIRST_STEP": "difference step, which changes no result",
    "MOST_LATE": "half of a limit of stability",
    "AT_THE_END": "accuracy with which a fit finds a bound",
    "RADIUS": "unit of an invented joint, which changes no result",
    "HEAVY": "stands for infinite",
    "LONG": "of an invented muscle that is not compared",
    "LITTLE": "stands for no air",
    "KNOTS": "accuracy of an interpolation",
    "WORTH": "work for which a kernel is compiled, which changes no result",
    "SWITCH_INTERVAL": "time, which changes no result",
    "K_LAST_READING": "layout",
    "UNKNOWN_SIZES": "accuracy of a sum",
    "LAW_ERRORS": "accuracy of a sum",
    "LEAST_KEPT": "accuracy of a sum",
    "CONSIDERED": "work for an answer: less probable sets of causes cannot be in it",
    "MOST_ALTERNATIVES": "of an answer that people read",
}


def constants(source: str) -> set[str]:
    """Names of a module's own constants that hold plain numbers."""
    found: set[str] = set()
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        try:
            value = ast.literal_eval(node.value)
        except ValueError:
            continue
        values = value if isinstance(value, tuple) else (value,)
        if values and all(isinstance(v, int | float) for v in values):
            names = [n for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]
            found |= {name.id for name in names}
    return found


def test_no_hand_set_constant_stands_outside_the_table() -> None:
    for pattern in DECIDING:
        for path in HOME.glob(pattern):
            left = constants(path.read_text()) - NO_RULES.keys()
            assert not left, f"{path.name}: {', '.join(sorted(left))} belong into pam_gap.rules"


def test_a_planted_constant_is_found() -> None:
    assert constants("NO_GAP = 0.35\nA, B = 1, -2.0\nNAME = 'x'\n") == {"NO_GAP", "A", "B"}


def test_every_row_says_what_it_is_and_where_it_came_from() -> None:
    entries = table()
    assert len({entry.path for entry in entries}) == len(entries) > 70
    for entry in entries:
        assert entry.value > 0, entry.path
        assert entry.unit, entry.path
        assert entry.acts in (DECISION, DIAGNOSIS, PROPOSAL), entry.path
        for text in (entry.decides, entry.trades, entry.origin):
            assert text.endswith("."), f"{entry.path}: {text!r} is no sentence"


def test_a_change_moves_one_value_and_leaves_the_table_alone() -> None:
    for entry in table():
        for factor in (0.7, 1.3):
            other = changed(entry.path, entry.scaled(factor))
            off = [e.path for e, f in zip(table(other), table(), strict=True) if e != f]
            assert off in ([entry.path], []), entry.path
            # 1 is the least whole number
            assert off or (entry.value == 1 and factor < 1.0), entry.path
    assert table() == table(DEFAULT)


def test_whole_numbers_stay_whole_and_change() -> None:
    entries = {entry.path: entry for entry in table()}
    few = entries["search.fold_steps"]
    assert [few.scaled(f) for f in (0.7, 1.3)] == [1, 3]
    assert isinstance(entries["decision.bootstraps"].scaled(1.3), int)


def test_an_unknown_constant_is_named() -> None:
    with pytest.raises(PamError, match=r"decision\.material.*mean decision\.material_share"):
        changed("decision.material", 1.0)


def test_changed_constants_reach_the_code(rig: Rig, record: Maker) -> None:
    recording = record(duration=4.0)
    rules = changed("prediction.settling", 0.5)
    rules = changed("prediction.block_time", 5.0 * recording.sample_time, rules)
    problem = PredictionProblem(rig, 0, [recording], rules=rules)
    plain = PredictionProblem(rig, 0, [recording])
    assert problem.n_rows == len(recording.time) // 5
    first, plain_first = (p.row_time[p.counted].min() for p in (problem, plain))
    assert 0.5 < first < 0.6
    assert plain_first > 1.5
    steady = 5.0 + 1e-7 * np.random.default_rng(0).standard_normal(2000)
    steady += np.linspace(0.0, 1.0, 2000)
    quiet, strict = (
        channel_noise(steady, rules=r.recording).is_smoothed
        for r in (DEFAULT, changed("recording.cleanest_share", 1e-9))
    )
    assert (quiet, strict) == (True, False)
    wide = changed("search.tolerance_size", 0.6).search
    assert transport_time(0.01, 0.0, wide).free.size == 2.0 * transport_time(0.01, 0.0).free.size
