"""Acts of people and processes, drawn at random, against one rule: moving air is always an act.

After every stop the valves may open only when the driver was activated since. After a fault of the
driver or a board, faults must have been cleared before that. A few lines here keep this rule, and
not the driver's own table of states.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping

from pam_check.fault_kinds.fault_kind import VENT
from pam_check.faults.acts import (
    activate,
    clean_up_and_configure,
    clear_faults,
    start_new_process,
    vent,
)
from pam_check.faults.chain import STEP, FaultChain
from pam_check.faults.reference_faults import send_trajectory
from pam_control.references.trajectory import TrajectoryPoint
from pam_driver.safety.states import SafetyState

Values = Mapping[str, float]
Injection = Callable[[FaultChain, Values, random.Random], None]
PAUSES = (0.0, 0.01, 0.05, 0.2, 0.6)  # s, between two acts
_STOPPING = 0.13  # s in which a dying process or bus may still let air move: the board's watchdog


class _Rule:
    """Whether air may move, by what has happened since the last stop."""

    def __init__(self, chain: FaultChain) -> None:
        self._chain = chain
        self._activated = True
        self._cleared = True
        self._stopped_at = chain.now
        self._in_fault = False
        chain.after.append(self._watch)
        chain.claims.append(self._claim)

    def stop(self, *, fault: bool) -> None:
        """Something has stopped the rig: from here on moving air needs acts."""
        if self._activated:
            self._stopped_at = self._chain.now
        self._activated = False
        self._cleared = self._cleared and not fault

    def clear(self) -> None:
        """Somebody has cleared the faults."""
        self._cleared = True

    def activate(self) -> None:
        """Somebody has activated."""
        self._activated = self._activated or self._cleared

    def _watch(self, now: float) -> None:
        chain = self._chain
        boards = chain.sim.boards.values()
        before = self._in_fault
        # a board that was told to clear its fault hears this in the next step
        self._in_fault = any(board.fault_names for board in boards) or (
            chain.driver_runs and chain.driver.state is SafetyState.FAULT
        )
        if self._in_fault and not before:
            self.stop(fault=True)

    def _claim(self) -> str:
        chain = self._chain
        if not chain.moves_air or chain.now <= chain.lowered_at + VENT:
            return ""
        late = chain.now > self._stopped_at + _STOPPING
        if not self._activated and late:
            return "air moves after a stop without " + (
                "an activation" if self._cleared else "clearing the faults"
            )
        return ""


def _act(chain: FaultChain, rule: _Rule, act: str, draw: random.Random) -> None:
    if act == "vent":
        vent(chain)
        rule.stop(fault=False)
    elif act == "clear":
        clear_faults(chain)
        rule.clear()
    elif act == "activate":
        if activate(chain):
            rule.activate()
    elif act == "deactivate":
        chain.driver.deactivate(chain.now)
        rule.stop(fault=False)
    elif act == "clean up":
        rule.stop(fault=chain.driver.state is SafetyState.FAULT)
        clean_up_and_configure(chain)
    elif act == "restart driver":
        rule.stop(fault=False)  # if it takes long, the boards' watchdogs make it a fault
        chain.driver_runs = False
        chain.wait(draw.choice((0.05, 0.2)))
        start_new_process(chain, activates=False)
    elif act == "controller":
        chain.controller_runs = not chain.controller_runs
    elif act == "trajectory":
        motion = chain.motion
        send_trajectory(chain, [TrajectoryPoint(0.8, [draw.uniform(-0.8, 0.8)])])
        chain.motion = motion if draw.random() < 0.5 else None
    elif act == "bus":
        chain.can.down = True
        chain.at(chain.now + draw.uniform(0.02, 0.3), lambda: setattr(chain.can, "down", False))
    elif act == "board":
        chain.sim.restart_board(draw.choice(list(chain.sim.boards)), chain.now)
        rule.stop(fault=False)


ACTS = (
    "vent", "clear", "activate", "deactivate", "clean up", "restart driver", "controller",
    "trajectory",
)  # fmt: skip
FAULTS = ("bus", "board")


def _random_acts(chain: FaultChain, values: Values, draw: random.Random) -> None:
    rule = _Rule(chain)
    # clearing and activating are drawn often, so that air moves again in most sequences
    acts = [*ACTS, "clear", "activate", "activate"]
    if values["faults"] > 0.0:
        acts += FAULTS
    for _ in range(int(values["acts"])):
        _act(chain, rule, draw.choice(acts), draw)
        chain.wait(max(draw.choice(PAUSES), STEP))


INJECTIONS: Mapping[str, Injection] = {
    "acts_at_random": _random_acts,
    "acts_and_faults_at_random": _random_acts,
}
