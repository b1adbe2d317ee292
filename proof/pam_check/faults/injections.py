"""Every fault of the campaign by its name; those of the rig itself are in pam_sim."""

from __future__ import annotations

import random
from collections.abc import Mapping
from functools import partial

from pam_check.fault_kinds.kinds import HELD
from pam_check.faults import (
    foreign_faults,
    hidden_effects,
    host_faults,
    operator_faults,
    output_faults,
    people_faults,
    random_acts,
    reference_faults,
    time_faults,
)
from pam_check.faults.chain import FaultChain
from pam_check.faults.operator_faults import Injection, held
from pam_sim import fault_injection


def _of_rig(name: str, chain: FaultChain, values: Mapping[str, float], draw: random.Random) -> None:
    fault_injection.inject(chain, name, values, draw)


_PLAIN: Mapping[str, Injection] = {
    **{name: partial(_of_rig, name) for name in fault_injection.FAULTS},
    **host_faults.INJECTIONS,
    **time_faults.INJECTIONS,
    **reference_faults.INJECTIONS,
    **operator_faults.INJECTIONS,
    **people_faults.INJECTIONS,
    **output_faults.INJECTIONS,
    **foreign_faults.INJECTIONS,
    **random_acts.INJECTIONS,
    **hidden_effects.INJECTIONS,
}
INJECTIONS: Mapping[str, Injection] = {
    **_PLAIN,
    **{f"{name}_while_held": held(_PLAIN[name]) for name in HELD},
}
