"""Which contacts hold: the one consistent answer, against other ways to it."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pam_model.body.contact import AT_HIGH, AT_LOW, FREE, HELD, settle_contacts


def drawn(n: int, draw: np.random.Generator) -> tuple[np.ndarray, ...]:
    """A mass matrix, torques, and bounds of friction, end stops, both or none."""
    root = draw.normal(size=(n, n))
    mass = root @ root.T + 0.05 * np.eye(n)
    grip = draw.uniform(0.0, 2.0, n) * (draw.uniform(size=n) < 0.7)
    low, high = -grip, grip.copy()
    low[draw.uniform(size=n) < 0.2] = -1e300
    high[draw.uniform(size=n) < 0.2] = 1e300
    return mass, draw.normal(size=n), low, high


def settled(mass: np.ndarray, right: np.ndarray, low: np.ndarray, high: np.ndarray):
    n = len(mass)
    state = np.where(low < high, HELD, FREE).astype(float)
    x, torque = np.zeros(n), np.zeros(n)
    settle_contacts(
        mass, right, low, high, state, np.zeros((n, n)), np.zeros(n), x, torque
    )  # fmt: skip
    return x, torque, state


@pytest.mark.parametrize("n", [1, 2, 4, 7])
def test_contacts_are_consistent_and_of_least_constraint(n: int) -> None:
    """Gauss: the contacts minimise (M x - b) M^-1 (M x - b) / 2 + ... as a bounded least square."""
    draw = np.random.default_rng(n)
    seen = set()
    for _ in range(100):
        mass, right, low, high = drawn(n, draw)
        x, torque, state = settled(mass, right, low, high)
        np.testing.assert_allclose(mass @ x, right + torque, atol=1e-9)
        assert np.all((torque >= low - 1e-12) & (torque <= high + 1e-12))
        assert np.all(x[state == HELD] == 0.0)
        assert np.all(x[state == AT_LOW] >= 0.0)
        assert np.all(x[state == AT_HIGH] <= 0.0)
        seen.update(state)
        root = np.linalg.inv(np.linalg.cholesky(mass))
        bounds = (low - 1e-300, np.maximum(high, low + 1e-9))
        other = lsq_linear(root, -root @ right, bounds, method="bvls", tol=1e-14)
        np.testing.assert_allclose(torque, other.x, atol=1e-6 * (1.0 + np.abs(torque).max()))
    assert seen >= {HELD, AT_LOW, AT_HIGH}


def test_only_one_choice_of_held_joints_is_consistent() -> None:
    """All choices, one by one: the bounds hold for the found one only."""
    draw = np.random.default_rng(11)
    for _ in range(30):
        mass, right, low, high = drawn(3, draw)
        _, _, state = settled(mass, right, low, high)
        fits = []
        choices = [
            (HELD, AT_LOW, AT_HIGH) if a < b else (FREE,) for a, b in zip(low, high, strict=True)
        ]
        for choice in product(*choices):
            guess = np.array(choice, dtype=float)
            torque = np.where(guess == AT_LOW, low, np.where(guess == AT_HIGH, high, 0.0))
            if np.abs(torque).max() > 1e299:
                continue
            moves = guess != HELD
            x = np.zeros(3)
            x[moves] = np.linalg.solve(mass[np.ix_(moves, moves)], (right + torque)[moves])
            torque = np.where(moves, torque, mass @ x - right)
            right_way = np.where(guess == AT_LOW, x >= 0, np.where(guess == AT_HIGH, x <= 0, True))
            if np.all(right_way) and np.all((torque >= low) & (torque <= high)):
                fits.append(choice)
        assert fits == [tuple(state)]


def test_a_joint_is_held_by_what_another_one_does() -> None:
    """Alone each would slide; together, the free one relieves the other one."""
    mass = np.array([[1.0, 0.9], [0.9, 1.0]])
    right = np.array([1.0, 1.0])
    x, torque, state = settled(mass, right, np.array([-0.5, 0.0]), np.array([0.5, 0.0]))
    assert state.tolist() == [HELD, FREE]
    assert x.tolist() == [0.0, 1.0]
    assert torque[0] == pytest.approx(-0.1)
