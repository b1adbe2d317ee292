"""Stops, starts and restarts at the wrong moment: what people and supervisors of processes do."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping

from pam_check.faults.acts import (
    EMPTYING,
    activate,
    claim_no_air,
    claim_stays,
    clean_up_and_configure,
    clear_faults,
    hold_at,
    settle,
    start_new_process,
    vent,
)
from pam_check.faults.chain import FaultChain
from pam_check.faults.reference_faults import send_trajectory
from pam_check.faults.unavoidable_speed import HELD_ANGLE
from pam_control.references.trajectory import TrajectoryPoint
from pam_driver.safety.states import SafetyState
from pam_sim.faults.rig_faults import POSITION, offset

Values = Mapping[str, float]
Injection = Callable[[FaultChain, Values, random.Random], None]
STAYS = 0.1  # rad; a joint that is activated and asked for nothing stays where it is
_RESTART = 0.3  # s until a process runs again
_JUMP = 0.5  # rad
_LEFT = (4e4, 2e5)  # Pa gauge, which an exhaust that closes leaves in its muscle


def _vent(chain: FaultChain, values: Values, draw: random.Random) -> None:
    vent(chain)
    chain.noticed["vented"] += 1


def _vent_held(chain: FaultChain, values: Values, draw: random.Random) -> None:
    hold_at(chain, values["angle"])
    _vent(chain, values, draw)


def _clear_and_activate(chain: FaultChain) -> None:
    clear_faults(chain)
    chain.wait(0.1)
    activate(chain)


def _activated_again(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """Hold, vent, clear, activate: the joint stays where it hangs."""
    hold_at(chain, values["angle"])
    chain.motion = None
    vent(chain)
    settle(chain)
    claim_stays(chain, STAYS)
    _clear_and_activate(chain)


def _sent_while_vented(chain: FaultChain, values: Values, draw: random.Random) -> None:
    vent(chain)
    settle(chain)
    send_trajectory(chain, [TrajectoryPoint(3.0, [values["angle"]])])
    claim_stays(chain, STAYS)
    chain.wait(0.5)
    _clear_and_activate(chain)


def _sent_before_commands(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """A trajectory arrives after clearing and before activating."""
    vent(chain)
    settle(chain)
    clear_faults(chain)
    chain.wait(0.05)
    send_trajectory(chain, [TrajectoryPoint(0.5, [values["angle"]])])
    claim_stays(chain, STAYS)
    chain.wait(0.05)
    activate(chain)


def _vented_during_start(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """A process that is to activate by itself waits for a board; someone calls `~/vent`."""
    chain.driver_runs = False
    chain.wait(_RESTART)
    settle(chain)
    board = draw.choice(list(chain.sim.boards))
    chain.sim.faults.frozen[board] = chain.now + values["board_after"]
    claim_no_air(chain)
    start_new_process(chain, activates=True)
    chain.wait(0.5 * values["board_after"])
    _vent(chain, values, draw)


def _make_fault(chain: FaultChain) -> None:
    """A fault that the driver alone sees and latches; its cause ends after a moment.

    The boards find nothing wrong and hear their commands: only the driver can keep this fault.
    """
    encoders = [(board, POSITION) for board in chain.sim.boards]
    for encoder in encoders:
        chain.sim.faults.sensors[encoder] = offset(_JUMP)
    chain.wait(0.02)
    for encoder in encoders:
        del chain.sim.faults.sensors[encoder]
    chain.wait(0.5)


def _cleaned_up(chain: FaultChain, values: Values, draw: random.Random) -> None:
    _make_fault(chain)
    clean_up_and_configure(chain)
    claim_no_air(chain)
    chain.wait(0.7)
    activate(chain)


def _restarted_after_fault(chain: FaultChain, values: Values, draw: random.Random) -> None:
    _make_fault(chain)
    chain.driver_runs = False
    claim_no_air(chain)
    chain.wait(_RESTART)
    start_new_process(chain, activates=True)


def _killed_and_restarted(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.driver_runs = False
    claim_no_air(chain, 0.111)
    chain.wait(values["restart_after"])
    start_new_process(chain, activates=True)


def _activated_with_fault(chain: FaultChain, values: Values, draw: random.Random) -> None:
    _make_fault(chain)
    claim_no_air(chain)
    activate(chain)


def _cleared_in_motion(chain: FaultChain, values: Values, draw: random.Random) -> None:
    clear_faults(chain)
    chain.wait(0.1)
    activate(chain)


def _acts_in_haste(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """Someone vents, clears and activates again and again, long before the arm is empty."""
    for _ in range(int(values["times"])):
        vent(chain)
        chain.wait(draw.uniform(0.002, 0.1))
        clear_faults(chain)
        chain.wait(draw.uniform(0.0, 0.05))
        activate(chain)
        chain.wait(draw.uniform(0.05, 0.3))


def _old_commands(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """Commands from before the activation arrive after it; the controller has died."""
    kept = chain.on_way[-1:]
    while not kept:
        chain.step()
        kept = chain.on_way[-1:]
    stamp = chain.wall
    chain.controller_runs = False
    vent(chain)
    settle(chain)
    claim_no_air(chain)
    clear_faults(chain)
    chain.step()
    activate(chain)
    chain.on_way = [(kept[0][0], stamp, chain.now + 0.002 * n) for n in range(1, 20)]


def _crossed(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """Two hoses were exchanged while the rig was switched off."""
    vent(chain)
    settle(chain)
    chain.sim.faults.crossed.update(chain.sim.boards)
    _clear_and_activate(chain)


def _blocked(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """Both exhausts close before the muscles are empty, as with ice or a wrong check valve."""
    left = draw.uniform(*_LEFT)

    def close(now: float) -> None:
        share = 0.0 if max(chain.truth.pressures) < left else 1.0
        for address, board in chain.sim.boards.items():
            for place in range(len(board.valves)):
                chain.sim.faults.exhausts[address, place] = share

    chain.inject.append(close)
    _vent(chain, values, draw)

    def claim() -> str:
        full = max(chain.truth.pressures) > 30e3
        return "called vented although muscles are full" if full and _is_vented(chain) else ""

    since = chain.now + 0.1
    chain.claims.append(lambda: claim() if chain.now > since else "")
    chain.wait(EMPTYING)
    claim_no_air(chain)
    clear_faults(chain)
    chain.wait(0.05)
    if activate(chain):
        chain.claims.append(lambda: "activated although muscles are full")


def _is_vented(chain: FaultChain) -> bool:
    return chain.driver.state is SafetyState.VENTED


def _controller_restarted(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """The controller's process ends and is started again, before anything times out."""
    chain.controller_runs = False
    chain.controller.deactivate()
    chain.at(chain.now + values["gap"], lambda: setattr(chain, "controller_runs", True))


def _restarts_again(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """A board loses power again and again; someone clears and activates between the restarts."""
    board = draw.choice(list(chain.sim.boards))
    begin, end = chain.now, chain.now + 10.0 * values["period"]

    def turn(now: float, restart_at: float) -> None:
        chain.sim.restart_board(board, now)
        if restart_at < end:
            later = restart_at + values["period"] * draw.uniform(0.5, 1.5)
            for share in (0.3, 0.6):
                chain.at(restart_at + share * (later - restart_at), try_again)
            chain.at(later, lambda: turn(chain.now, later))

    def try_again() -> None:
        clear_faults(chain)
        chain.at(chain.now + 0.02, retry)

    def retry() -> None:
        activate(chain)

    turn(begin, begin)


def held(inject: Injection) -> Injection:
    """The same fault while the joint is held away from where it hangs."""

    def while_held(chain: FaultChain, values: Values, draw: random.Random) -> None:
        hold_at(chain, math.copysign(draw.uniform(0.5, 1.0) * HELD_ANGLE, draw.uniform(-1.0, 1.0)))
        inject(chain, values, draw)

    return while_held


INJECTIONS: Mapping[str, Injection] = {
    "vent_called": _vent,
    "vent_while_held": _vent_held,
    "activated_after_vent": _activated_again,
    "trajectory_while_vented": _sent_while_vented,
    "trajectory_before_activation": _sent_before_commands,
    "vent_during_start": _vented_during_start,
    "clean_up_after_fault": _cleaned_up,
    "driver_restarted_after_fault": _restarted_after_fault,
    "driver_killed_and_restarted": _killed_and_restarted,
    "activation_with_fault": _activated_with_fault,
    "faults_cleared_in_motion": _cleared_in_motion,
    "acts_in_haste": _acts_in_haste,
    "old_commands_after_activation": _old_commands,
    "hoses_crossed": _crossed,
    "exhausts_blocked": _blocked,
    "board_restarts_again_and_again": _restarts_again,
    "controller_restarted": _controller_restarted,
}
