"""A simulation of the plant from constant pressures, for tests of single effects."""

from __future__ import annotations

import numpy as np

from pam_model.plant.simulate import initial_state, simulate

HELD = np.zeros((1000, 2))
DT = 2e-3


def simulate_held(parameters, changes, pressures=(2e5, 2e5), commands=HELD, **start):
    """Simulate from constant pressures [Pa] with effects; valves commanded or all shut."""
    changed = parameters.replaced(changes)
    shut = start.pop("shut", False)
    prescribed = {k: start.pop(k) for k in ("positions",) if k in start}
    state = initial_state(changed, pressures=pressures, **start)
    return simulate(changed, commands, DT, state, shut=shut, **prescribed)
