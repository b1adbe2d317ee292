"""Effects that the controller does not know, at moderate size, while it moves the rig.

The size of an effect is that at which docs/effects.md shows it, which is a size that real rigs
have. After a while the controller dies, so that the stop happens on this rig, too.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping

from pam_check.fault_kinds.fault_kind import COMMANDS_STOP
from pam_check.faults.acts import claim_no_air
from pam_check.faults.chain import FaultChain
from pam_model.effects import EFFECTS

Values = Mapping[str, float]
Injection = Callable[[FaultChain, Values, random.Random], None]


def moderate(effect: str) -> dict[str, float]:
    """Parameters of an effect as `SimulatedRig` takes them, at the size of its portrait."""
    return {f"{effect}.{name}": size for name, size in EFFECTS[effect].portrait.sizes.items()}


def _hidden(effect: str) -> Injection:
    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        chain.power_cycle(moderate(effect))
        chain.wait(1.5)
        chain.controller_runs = False
        claim_no_air(chain, COMMANDS_STOP)

    return inject


INJECTIONS: Mapping[str, Injection] = {f"hidden_{name}": _hidden(name) for name in EFFECTS}
