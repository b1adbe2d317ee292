"""A brake and a dump valve at the outputs of the boards, which fail.

The rig gets both for the trial: the brake is dry friction at the joint, and an open dump valve
takes the supply to ambient pressure. Without a fault, both do what the outputs of the board say.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pam_check.faults.chain import FaultChain
from pam_sim.boards.pam_board_twin import SimulatedPamBoard

Values = Mapping[str, float]
Injection = Callable[[FaultChain, Values, random.Random], None]
_BEFORE = 0.1  # s


@dataclass(slots=True)
class Outputs:
    """What brake and dump valve do.

    Attributes
    ----------
    brake, dump : bool or None
        Whether the brake holds, and whether the dump valve is open, whatever the outputs say; None
        if they follow them.
    """

    brake: bool | None = None
    dump: bool | None = None


def _equip(chain: FaultChain, torque: float = 0.0) -> Outputs:
    """Give the rig a dump valve and a brake with this torque [N m]."""
    outputs = Outputs()
    supply = chain.rig.supply_pressure
    done = (False, False)

    def follow(now: float) -> None:
        nonlocal done
        boards = [one for one in chain.sim.boards.values() if isinstance(one, SimulatedPamBoard)]
        brake = not all(board.brake_released for board in boards)
        dump = not all(board.dump_closed for board in boards)
        brake = brake if outputs.brake is None else outputs.brake
        dump = dump if outputs.dump is None else outputs.dump
        if (brake, dump) == done:
            return
        done = brake, dump
        chain.sim.set_brake(torque if brake else 0.0)
        chain.sim.set_supply_pressure(chain.rig.gas.ambient_pressure if dump else supply)

    chain.inject.append(follow)
    chain.wait(_BEFORE)
    return outputs


def _fails(
    brake: bool | None = None, dump: bool | None = None, *, killed: bool = False
) -> Injection:
    """The brake holds or not, the dump valve is open or not, whatever the outputs say."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        outputs = _equip(chain, values.get("torque", 0.0))
        outputs.brake, outputs.dump = brake, dump
        chain.driver_runs = not killed
        if "duration" in values:
            chain.at(chain.now + values["duration"], lambda: setattr(outputs, "brake", None))

    return inject


INJECTIONS: Mapping[str, Injection] = {
    "brake_engages_at_a_stop": _fails(killed=True),
    "brake_does_not_engage": _fails(brake=False, killed=True),
    "brake_engages_in_motion": _fails(brake=True),
    "brake_sticks_then_releases": _fails(brake=True),
    "dump_valve_stuck_shut": _fails(dump=False, killed=True),
    "dump_valve_opens_in_motion": _fails(dump=True),
}
