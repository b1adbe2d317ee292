"""The inputs of people, pressed, released or silent while a joint moves.

The inputs are topics that permit something, again and again. A trial's driver gets the input that
it needs, with a permission that lasts until the fault.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import replace

from pam_check.fault_kinds.fault_kind import VENT
from pam_check.faults.acts import claim_no_air, vent
from pam_check.faults.chain import FaultChain
from pam_driver.boards.pam_board.codec import SafetyInput
from pam_driver.boards.protocol import EMERGENCY_STOP, ENABLING_SWITCH
from pam_driver.safety.people_inputs import FULL_SPEED, PeopleInputs

Values = Mapping[str, float]
Injection = Callable[[FaultChain, Values, random.Random], None]
_PERIOD = 0.02  # s between two messages
_BEFORE = 0.3  # s, with the permission
_MESSAGE = 0.05  # s until the controller has heard the driver's state
_PAUSE = 0.3  # s without a stream, after which a stream is a new one
_AGAIN = 1.2  # s after the fault, at which references are sent again


def _permitted(chain: FaultChain, name: str) -> Callable[[float], None]:
    """Make the driver listen to a topic that permits something, and let it do so."""
    people = replace(chain.rig.people, **{f"{name}_topic": True})
    chain.driver.people = PeopleInputs(people, chain.driver.boards)
    next_at = chain.now

    def permit(now: float) -> None:
        nonlocal next_at
        if now >= next_at:
            next_at += _PERIOD
            chain.driver.people.hear_topic(name, True, now)

    permit(chain.now)
    chain.inject.append(permit)
    chain.wait(_BEFORE)
    return permit


def _ends(name: str) -> Injection:
    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        chain.inject.remove(_permitted(chain, name))

    return inject


def _forbidden(name: str) -> Injection:
    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        chain.inject.remove(_permitted(chain, name))
        chain.driver.people.hear_topic(name, False, chain.now)

    return inject


def _for_one_message(name: str) -> Injection:
    """Forbidden in one message; permissions follow before the driver has a cycle."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        _permitted(chain, name)
        chain.driver.people.hear_topic(name, False, chain.now)
        for _ in range(round(values["permissions"])):
            chain.driver.people.hear_topic(name, True, chain.now)

    return inject


def _slowed(end: Injection) -> Injection:
    """The joint brakes; the user pauses and sends references again, which are followed slowly."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        end(chain, values, draw)
        people, motion = chain.rig.people, chain.motion
        slow_from = chain.now + people.deadline + _MESSAGE + people.slowing_time
        fastest = min(joint.reduced_velocity for joint in chain.rig.joints)

        def too_fast() -> str:
            speed = max(map(abs, chain.truth.velocities))
            if chain.now < slow_from or speed <= fastest:
                return ""
            return f"{speed:.2f} rad/s at reduced speed, {fastest:g} permitted"

        def stream(moving: bool) -> None:
            chain.motion = motion if moving else None

        chain.claims.append(too_fast)
        chain.at(chain.now + _AGAIN - _PAUSE, lambda: stream(False))
        chain.at(chain.now + _AGAIN, lambda: stream(True))

    return inject


def _ignored(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.obeys_speed = False
    _ends(FULL_SPEED)(chain, values, draw)


def _bounces(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """Released and held again, many times; the user goes on sending references."""
    chain.inject.remove(_permitted(chain, ENABLING_SWITCH))
    start, people = chain.now, chain.driver.people
    claim_no_air(chain, VENT)

    def bounce(now: float) -> None:
        held = (now - start) % values["period"] >= 0.5 * values["period"]
        people.hear_topic(ENABLING_SWITCH, held, now)

    bounce(start)
    chain.inject.append(bounce)


def _while_lowered(chain: FaultChain, values: Values, draw: random.Random) -> None:
    permit = _permitted(chain, EMERGENCY_STOP)
    vent(chain)
    chain.wait(values["after"])
    chain.inject.remove(permit)
    chain.driver.people.hear_topic(EMERGENCY_STOP, False, chain.now)


def _lowered_with_inputs(chain: FaultChain, values: Values, draw: random.Random) -> None:
    _permitted(chain, EMERGENCY_STOP)
    vent(chain)
    chain.noticed["vented"] += 1
    chain.claims.append(lambda: "; ".join(map(str, chain.driver.faults)))


def _input_lost(name: str) -> Injection:
    """The input of a board permits motion, then the board reports none."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        for board in chain.sim.boards.values():
            board.misbehave(name, SafetyInput.PERMIT)
        chain.wait(_BEFORE)
        for board in chain.sim.boards.values():
            board.misbehave(name, SafetyInput.NOT_AVAILABLE)

    return inject


INJECTIONS: Mapping[str, Injection] = {
    "emergency_stop_pressed": _forbidden(EMERGENCY_STOP),
    "emergency_stop_for_one_message": _for_one_message(EMERGENCY_STOP),
    "enabling_switch_for_one_message": _for_one_message(ENABLING_SWITCH),
    "emergency_stop_silent": _ends(EMERGENCY_STOP),
    "enabling_switch_released": _forbidden(ENABLING_SWITCH),
    "enabling_switch_silent": _ends(ENABLING_SWITCH),
    "enabling_switch_bounces": _bounces,
    "emergency_stop_while_lowered": _while_lowered,
    "vent_with_inputs_held": _lowered_with_inputs,
    "emergency_stop_input_lost": _input_lost(EMERGENCY_STOP),
    "enabling_switch_input_lost": _input_lost(ENABLING_SWITCH),
    "full_speed_ended": _slowed(_forbidden(FULL_SPEED)),
    "full_speed_silent": _slowed(_ends(FULL_SPEED)),
    "reduced_speed_ignored": _ignored,
}
