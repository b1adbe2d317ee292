"""The cycle takes the muscles of a joint from a table: it goes through any number of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pam_control.cycle.joint_cycle import (
    K_SEEN_POSITION,
    K_VALVE_LIMITED,
    N_STATE,
    U_PRESSURE_RATE,
    U_SCHEDULE,
    demand,
    settle,
)
from pam_control.laws.position_plan import last_to_act, planned
from pam_control.rows.loop_rows import (
    D_AHEAD,
    D_CUT,
    D_POSITION,
    D_RATE,
    D_REFERENCE,
    N_DEMAND,
    V_TUBE,
)
from pam_control.rows.plan_rows import (
    N_CYCLE,
    N_MUSCLE,
    W_ACTS,
    W_AHEAD,
    W_DESIRED,
    W_MOST,
    W_RATE,
    W_REACHED,
    W_SHIFT,
    X_SEEN,
)
from pam_control.rows.telemetry_rows import Z_PRESSURES, Z_TUBES, Z_VALVE_CUT
from pam_model.plant.compiled import for_kernel

REACHED = {1: [2e5], 2: [2e5, 1e5], 3: [2e5, 1e5, 3e5], 4: [2e5, 1e5, 3e5, 2.5e5]}
"""Pressures that a plan has found, by the number of muscles [Pa]."""


def rows(*shape: int) -> Any:
    return for_kernel(np.zeros(shape))


@pytest.mark.parametrize("muscles", REACHED)
def test_each_muscle_gets_its_own_pressure(muscles: int) -> None:
    """The plan of each one arrives at its own loop, whatever the order of the loops."""
    reached, step, rate = REACHED[muscles], 0.002, 1e7
    w, x, d = rows(1, muscles, N_MUSCLE), rows(1, N_CYCLE), rows(muscles, N_DEMAND)
    k, u = rows(1, N_STATE), rows(1, U_SCHEDULE)
    places = list(range(muscles))[::-1]
    owned = for_kernel(np.array([places], dtype=np.int64))
    u[0][U_PRESSURE_RATE], k[0][K_SEEN_POSITION], x[0][X_SEEN + 1] = rate, 0.3, 0.1
    for number, muscle in enumerate(w[0]):
        muscle[W_REACHED], muscle[W_SHIFT], muscle[W_MOST] = reached[number], 1e3, 2.9e5
        muscle[W_DESIRED] = reached[number]
        muscle[W_RATE], muscle[W_AHEAD], muscle[W_ACTS + 1] = number, -number, 0.1 + number
    planned(w[0], x[0], rows(1, 99)[0])
    demand(owned, w, x, k, u, d, step)
    for number, place in enumerate(places):
        limit = min(reached[number] + 1e3, 2.9e5)
        assert d[place][D_REFERENCE] == max(limit, reached[number] - rate * step)
        assert (d[place][D_RATE], d[place][D_AHEAD]) == (number, -number)
        assert d[place][D_POSITION] == pytest.approx(0.3 + number)


@pytest.mark.parametrize("muscles", REACHED)
def test_any_of_its_valves_may_be_limited_or_the_last_to_act(muscles: int) -> None:
    owned = for_kernel(np.arange(muscles, dtype=np.int64)[None])
    for chosen in range(muscles):
        w, k, d = rows(1, muscles, N_MUSCLE), rows(1, N_STATE), rows(muscles, N_DEMAND)
        v, z = rows(muscles, V_TUBE + 1), rows(1, Z_PRESSURES + muscles)
        w[0][chosen][W_ACTS], w[0][chosen][W_DESIRED] = 0.01, 2e5
        assert last_to_act(w[0]) == chosen
        for is_cut in (0.0, 1.0):
            d[chosen][D_CUT], v[chosen][V_TUBE] = is_cut, 0.3 * is_cut
            x, u = rows(1, N_CYCLE), rows(1, U_SCHEDULE)
            settle(owned, w, x, k, u, v, d, z, 0.002, False)
            assert k[0][K_VALVE_LIMITED] == z[0][Z_VALVE_CUT] == z[0][Z_TUBES] == is_cut
            assert z[0][Z_PRESSURES + chosen] == 2e5
