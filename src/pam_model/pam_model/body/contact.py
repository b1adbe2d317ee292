"""Dry friction and end stops of coupled hinges: which of them hold, and with what torque.

A contact adds a torque u_i within bounds to joint i. It holds the joint (x_i = 0) while the torque
that this needs is within the bounds; otherwise it is at a bound and does not hinder the motion:

    M x = b + u,  u_i = low_i if x_i > 0,  u_i = high_i if x_i < 0,  else low_i <= u_i <= high_i

With the acceleration as x, dry friction has the bounds -T_s, T_s, and an end stop 0, infinity. A
held joint is thus a row and a column that are left out of the mass matrix, and u_i is the residual
of its row. With the velocity after an impulse as x, and M times that before it as b, u is the
impulse of a stop or of friction. As M is positive definite, there is exactly one solution, however
many joints hold each other.

Source: Gauss's principle of least constraint; boxed linear complementarity problem, J. J. Judice
and F. M. Pires, "Basic-set algorithm for a generalized linear complementarity problem", Journal of
Optimization Theory and Applications 74(3), 1992; the least-index rule, which cannot cycle: K. G.
Murty, Linear Complementarity, Linear and Nonlinear Programming, 1988.
"""

from __future__ import annotations

from typing import Any, Final

FREE: Final = 0
HELD: Final = 2
AT_LOW: Final = 1
"""The contact is at its lower bound: the joint moves forward."""
AT_HIGH: Final = -1
"""The contact is at its upper bound: the joint moves back."""
TURNS: Final = 200
"""Changes of the set of held joints after which the last set is kept; rounding alone gets there."""


def factor_moving(mass: Any, state: Any, factor: Any) -> None:
    """Factor the rows and columns of M whose joints are not held as L D L^T, into `factor`."""
    for i in range(len(mass)):
        if state[i] == HELD:
            continue
        for j in range(i + 1):
            if state[j] == HELD:
                continue
            entry = mass[i][j]
            for k in range(j):
                if state[k] != HELD:
                    entry -= factor[i][k] * factor[j][k] * factor[k][k]
            factor[i][j] = entry if i == j else entry / factor[j][j]


def solve_moving(mass: Any, state: Any, right: Any, factor: Any, x: Any) -> None:
    """Solve M x = right for the joints that are not held; x is 0 for those that are.

    The rows and columns of held joints are left out.
    """
    n = len(mass)
    factor_moving(mass, state, factor)
    for i in range(n):
        x[i] = 0.0
        if state[i] != HELD:
            x[i] = right[i]
            for k in range(i):
                if state[k] != HELD:
                    x[i] -= factor[i][k] * x[k]
    for back in range(n):
        i = n - 1 - back
        if state[i] != HELD:
            x[i] /= factor[i][i]
            for k in range(i + 1, n):
                if state[k] != HELD:
                    x[i] -= factor[k][i] * x[k]


def settle_contacts(
    mass: Any,
    right: Any,
    low: Any,
    high: Any,
    state: Any,
    factor: Any,
    given: Any,
    x: Any,
    torque: Any,
) -> None:
    """Find the contacts that hold, by changing one joint at a time.

    Parameters
    ----------
    mass : (n, n) array
        M, symmetric and positive definite.
    right : (n,) array
        b.
    low, high : (n,) array
        Bounds of the contacts; both 0 for a joint that nothing can hold.
    state : (n,) array
        HELD, AT_LOW, AT_HIGH, or FREE where both bounds are 0: at first a guess, then the result.
    factor : (n, n) array
        Scratch memory.
    given : (n,) array
        Scratch memory.
    x : (n,) array
        Receives the acceleration, or the velocity after an impulse.
    torque : (n,) array
        Receives u.
    """
    n = len(mass)
    for _ in range(TURNS):
        for i in range(n):
            torque[i] = 0.0
            if state[i] == AT_LOW:
                torque[i] = low[i]
            elif state[i] == AT_HIGH:
                torque[i] = high[i]
            given[i] = right[i] + torque[i]
        solve_moving(mass, state, given, factor, x)
        changed = False
        for i in range(n):
            if state[i] == HELD:
                torque[i] = -right[i]
                for j in range(n):
                    torque[i] += mass[i][j] * x[j]
                if not changed and torque[i] < low[i]:
                    state[i] = AT_LOW
                    changed = True
                elif not changed and torque[i] > high[i]:
                    state[i] = AT_HIGH
                    changed = True
            elif not changed and (
                (state[i] == AT_LOW and x[i] < 0.0) or (state[i] == AT_HIGH and x[i] > 0.0)
            ):
                state[i] = HELD
                changed = True
        if not changed:
            return
