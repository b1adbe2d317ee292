"""The Model Confidence Set: figures of another implementation, and what it promises."""

from __future__ import annotations

import numpy as np
import pytest

from pam_gap.inference.model_confidence_set import circular_blocks, mcs_p_values


def correlated(generator: np.random.Generator, count: int, models: int) -> np.ndarray:
    """Losses whose neighbours are alike, all models of one mean."""
    noise = generator.standard_normal((count, models))
    for row in range(1, count):
        noise[row] += 0.5 * noise[row - 1]
    return noise


def test_p_values_are_those_of_the_arch_package() -> None:
    generator = np.random.default_rng(20)
    common = np.exp(generator.standard_normal((36, 1)))
    worse = np.array([0.0, 0.1, 0.25, 0.4, 0.6, 1.0])
    losses = common + 0.6 * generator.standard_normal((36, 6)) + worse
    # arch 8.0.0: MCS(losses, 0.1, reps=1000, block_size=4, method="R", bootstrap="circular", 11)
    expected = [0.818, 1.0, 0.366, 0.002, 0.0, 0.0]
    found = mcs_p_values(losses, block_length=4, draws=1000, seed=11)
    np.testing.assert_allclose(found, expected, atol=0.03)
    assert (found > 0.1).tolist() == [True, True, True, False, False, False]


def test_the_best_model_is_in_the_set_as_often_as_promised() -> None:
    generator = np.random.default_rng(4)
    kept = 0
    for _ in range(200):
        losses = correlated(generator, 80, 4) + np.array([0.0, 0.0, 0.5, 2.0])
        kept += mcs_p_values(losses, block_length=6, draws=200)[0] > 0.1
    assert kept >= 170  # 90 % promised


def test_models_leave_in_the_order_of_their_losses() -> None:
    generator = np.random.default_rng(5)
    losses = 0.1 * generator.standard_normal((60, 4)) + np.array([3.0, 0.0, 2.0, 1.0])
    p_values = mcs_p_values(losses, block_length=3, draws=300)
    assert p_values[1] == 1.0
    assert (p_values[[0, 2, 3]] < 0.02).all()
    close = np.array([0.08, 0.0, 0.05, 0.02]) + 0.1 * generator.standard_normal((60, 4))
    order = np.argsort(close.mean(axis=0))
    ranked = mcs_p_values(close, block_length=3, draws=300)[order]
    assert (np.diff(ranked) <= 0.0).all()  # a later elimination never has the smaller p-value


def test_equal_losses_are_equally_good() -> None:
    one = np.random.default_rng(6).standard_normal((40, 1))
    p_values = mcs_p_values(np.hstack([one, one, one + 9.0]), block_length=4, draws=100)
    assert p_values.tolist() == [1.0, 1.0, 0.0]


def test_one_model_alone_is_the_set() -> None:
    assert mcs_p_values(np.ones((10, 1)), block_length=2, draws=10).tolist() == [1.0]


def test_a_loss_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        mcs_p_values(np.array([[1.0, np.nan], [1.0, 2.0]]), block_length=1, draws=10)


def test_blocks_go_round_and_keep_their_order() -> None:
    generator = np.random.default_rng(0)
    samples = np.array([circular_blocks(10, 4, generator) for _ in range(300)])
    assert samples.shape == (300, 10)
    blocks = np.stack([samples[:, :4], samples[:, 4:8]])
    assert (np.diff(blocks, axis=-1) % 10 == 1).all()
    assert np.unique(blocks[..., 0]).size == 10  # every observation begins some block
