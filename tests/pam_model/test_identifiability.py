"""What data tell apart: by rounding and by noise, alike on every processor."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pam_model.identify.identifiability import DEPENDENT, imitated, measurement_noise, told_numbers

RANDOM = np.random.default_rng(7)
COLUMNS = RANDOM.normal(size=(60, 3))
EQUAL = np.ones(5)
PLATFORM = Path(__file__).parents[1] / "data" / "festo_platform"


def test_columns_that_others_imitate_are_not_told() -> None:
    a, b, c = COLUMNS.T
    slopes = np.stack([a, b, 3.0 * a - 0.2 * b, c, np.zeros(60)], axis=1)
    told = told_numbers(slopes, 0.0, EQUAL)
    assert sorted([*told.told, *told.silent]) != sorted(range(5))
    assert len(told.told) == 3
    assert told.silent == (4,)
    assert imitated(slopes).tolist() == [True, True, True, False, True]


@pytest.mark.parametrize(("share", "number"), [(DEPENDENT / 30.0, 1), (DEPENDENT * 30.0, 2)])
def test_dependence_is_decided_far_from_rounding(share: float, number: int) -> None:
    a, b, _ = COLUMNS.T
    slopes = np.stack([a, a + share * b], axis=1)
    assert len(told_numbers(slopes, 0.0, np.ones(2)).told) == number
    # a change of the slopes by rounding changes nothing
    for _ in range(20):
        shaken = slopes * (1.0 + 1e-15 * RANDOM.normal(size=slopes.shape))
        assert len(told_numbers(shaken, 0.0, np.ones(2)).told) == number


def test_a_column_of_rounding_is_silent_and_imitates_nothing() -> None:
    a, b, _ = COLUMNS.T
    slopes = np.stack([a, a + 1e-3 * b, 1e-15 * b], axis=1)
    assert told_numbers(slopes, 0.0, np.ones(3)).silent == (2,)
    assert imitated(slopes[:, :2]).tolist() == [False, False]
    assert imitated(slopes).tolist() == [False, False, True]


def test_equal_candidates_are_taken_in_their_order() -> None:
    a, b, _ = COLUMNS.T
    for _ in range(20):
        shaken = np.stack([b, a, a, a], axis=1) * (1.0 + 1e-15 * RANDOM.normal(size=(60, 4)))
        told = told_numbers(10.0 * shaken, 0.0, np.array([1.0, 5.0, 5.0, 5.0])).told
        assert told == (1, 0)


def test_noise_hides_small_effects() -> None:
    a, b, c = COLUMNS.T
    slopes = np.stack([a, 1e-3 * b, 1e-3 * a + c], axis=1)
    assert set(told_numbers(slopes, 0.1, np.ones(3)).told) == {0, 2}
    assert told_numbers(slopes, 0.1, np.ones(3)).lost == (1,)
    assert set(told_numbers(slopes, 1e-4, np.ones(3)).told) == {0, 1, 2}


def test_noise_is_found_from_repeats_and_without() -> None:
    x = np.linspace(0.0, 1.0, 400)
    noise = RANDOM.normal(0.0, 0.05, 400)
    assert measurement_noise(x + 2.0 * x**3 + noise, [x]) == pytest.approx(0.05, rel=0.15)
    steps = np.round(10.0 * x)
    assert measurement_noise(np.sin(9.0 * steps) + noise, [steps]) == pytest.approx(0.05, rel=0.15)


SCRIPT = """
import sys
from pam_model.identify.fit import fit
from pam_model.identify.measurements import load_measurements
data = load_measurements(sys.argv[1]).branches()["pressure falling"]
for name in ("tondu_lopez", "tondu_lopez_friction", "sarosi", "caldwell_cells", "wickramatunge"):
    r = fit(name, data, fit_geometry=True, residual="length", starts=2)
    fitted = [k for k, p in r.parameters.items() if p.fitted and not p.note]
    print(name, *fitted, f"{1e3 * r.training_error:.4f} {1e3 * r.held_out_error:.4f}")
"""


@pytest.mark.long("repeats a fit in processes with other BLAS kernels")
def test_a_fit_is_the_same_under_every_blas_kernel() -> None:
    # OpenBLAS takes its kernel from the processor or from this variable; others ignore it.
    answers = set()
    for kernel in ("Haswell", "Prescott", "SkylakeX"):
        environment = {**os.environ, "OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(PLATFORM / "PtoD_40.csv")],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode < 0:
            continue  # a kernel with instructions that this processor has not
        assert done.returncode == 0, done.stderr
        answers.add(done.stdout)
    assert len(answers) == 1, answers
