"""Failing parts and loads beside those of the campaign, on the whole chain in one process."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from pam_check.faults.acts import activate, clear_faults, hold_at, settle, vent
from pam_check.faults.campaign import in_a_fork
from pam_check.faults.rig_bounds import bounds_of
from pam_driver.safety.states import SafetyState
from pam_model.plant.joint_muscles import SIDES
from pam_sim.faults.rig_faults import POSITION, RigFaults, offset

SUDDEN = 10.0  # a turn count so much larger takes the force, and leaves the volume to a dead one


@dataclass
class Seen:
    """The extremes after an act, and how it ended."""

    speed: float = 0.0
    error: float = 0.0
    farthest: float = 0.0
    pressure: float = 0.0
    shown: float = 0.0
    stopped_after: float = math.inf
    state: SafetyState = SafetyState.ACTIVE
    faults: tuple[str, ...] = ()


def watch(chain: Any, act: Callable[[Any], None], angle: float | None, seconds: float) -> Seen:
    """Act on a chain in motion, or on a held joint, and watch it."""

    def run() -> Seen:
        if angle is not None:
            hold_at(chain, angle)
        act(chain)
        seen, start = Seen(), chain.now
        while chain.now < start + seconds:
            chain.step()
            truth, active = chain.truth, chain.driver.state is SafetyState.ACTIVE
            seen.speed = max(seen.speed, abs(truth.velocities[0]))
            seen.farthest = max(seen.farthest, abs(truth.positions[0]))
            seen.pressure = max(seen.pressure, *truth.pressures)
            seen.shown = max(seen.shown, *chain.snapshot.pressures)
            if active:
                seen.error = max(seen.error, abs(truth.positions[0] - chain.reference))
            elif seen.stopped_after == math.inf:
                seen.stopped_after = chain.now - start
        seen.state = chain.driver.state
        seen.faults = tuple(fault.kind for fault in chain.driver.faults)
        return seen

    return in_a_fork(run)


def valve_stuck(opening: float) -> Callable[[Any], None]:
    def act(chain: Any) -> None:
        chain.sim.faults.valves[next(iter(chain.sim.boards)), 0] = opening

    return act


def valve_sticks_again_and_again(chain: Any) -> None:
    """Water or ice: the valve stays where it is for a moment, then follows again."""
    draw, board = random.Random(3), next(iter(chain.sim.boards))
    state = {"until": 0.0, "next": chain.now}

    def stick(now: float) -> None:
        if now >= state["next"]:
            state["until"] = now + draw.uniform(0.05, 0.3)
            state["next"] = state["until"] + draw.uniform(0.05, 0.6)
            chain.sim.faults.valves[board, 0] = math.nan
        elif now >= state["until"]:
            chain.sim.faults.valves.pop((board, 0), None)

    chain.inject.append(stick)


def load(factor: float) -> Callable[[Any], None]:
    def act(chain: Any) -> None:
        torque = factor * chain.rig.joints[0].gravity_torque
        chain.sim._plants[0].change({"joint.gravity_torque": torque})

    return act


def encoder_slips(by: float) -> Callable[[Any], None]:
    def act(chain: Any) -> None:
        chain.sim.faults.sensors[next(iter(chain.sim.boards)), POSITION] = offset(by)

    return act


def supply_pulses(chain: Any) -> None:
    """A compressor with a small receiver."""
    ambient, gauge = chain.rig.gas.ambient_pressure, chain.rig.supply_gauge_pressure

    def pulse(now: float) -> None:
        share = 0.98 + 0.27 * math.sin(2.0 * math.pi * now)
        chain.sim.set_supply_pressure(ambient + share * gauge)

    chain.inject.append(pulse)


ACTS = {
    "a valve sticks where it is": valve_stuck(math.nan),
    "a valve sticks nearly shut": valve_stuck(0.1),
    "a valve sticks a third open": valve_stuck(0.3),
    "a valve sticks again and again": valve_sticks_again_and_again,
    "somebody hangs a load on the arm": load(2.5),
    "the load falls off": load(0.2),
    "the encoder slips a little": encoder_slips(0.05),
    "the encoder slips": encoder_slips(-0.15),
    "the supply pulses": supply_pulses,
}


@pytest.mark.sampled(
    "each part once, at one of the two angles, and a valve, load or encoder with one of its sizes",
    alike=lambda name, angle: ACTS[name].__qualname__,
)
@pytest.mark.parametrize("angle", [None, 0.75])
@pytest.mark.parametrize("name", ACTS)
def test_a_failing_part_stays_within_the_bounds(chain: Any, name: str, angle: float | None) -> None:
    bounds = bounds_of(chain.rig)
    seen = watch(chain, ACTS[name], angle, 2.0)
    assert seen.speed <= bounds.speed
    assert seen.error <= bounds.tracking_error
    assert seen.farthest <= bounds.position[1]
    assert seen.pressure <= bounds.pressure


def tendon_breaks(side: str) -> Callable[[Any], None]:
    def act(chain: Any) -> None:
        plant = chain.sim._plants[0]
        length = plant.output[f"{side}.length"]
        thread, turns = (plant.parameters[f"{side}.{key}"] for key in ("thread_length", "turns"))
        volume = length * (thread**2 - length**2) / (4.0 * math.pi * turns**2)
        dead = plant.parameters[f"{side}.dead_volume"] + (1.0 - SUDDEN**-2) * volume
        plant.change({f"{side}.turns": SUDDEN * turns, f"{side}.dead_volume": dead})

    return act


@pytest.mark.sampled("either tendon, at one of the two angles")
@pytest.mark.parametrize("angle", [None, 0.75])
@pytest.mark.parametrize("side", SIDES)
def test_a_tendon_that_breaks_is_seen_in_a_moment_but_the_other_muscle_throws_the_arm(
    chain: Any, side: str, angle: float | None
) -> None:
    """The page of safety says so: no valve is fast enough, only the stiffness makes it slower."""
    seen = watch(chain, tendon_breaks(side), angle, 2.0)
    assert seen.stopped_after <= 0.03
    assert seen.state is SafetyState.FAULT
    assert "joint_too_fast" in seen.faults
    assert bounds_of(chain.rig).speed < seen.speed < 13.0
    assert seen.farthest <= bounds_of(chain.rig).position[1]


class WrongPorts(RigFaults):
    """The supply and the exhaust of one valve are exchanged: it fills where it should vent."""

    move_valves = True

    def spools(self, board: Any, commands: Any, kinds: Any) -> Any:
        return (-commands[0], *commands[1:])


def test_a_valve_with_exchanged_ports_is_never_vented_and_cannot_be_activated(chain: Any) -> None:
    def exchanged() -> tuple[list[str], bool, float]:
        vent(chain)
        settle(chain)
        chain.sim.faults = WrongPorts()
        chain.wait(0.3)
        clear_faults(chain)
        chain.wait(9.0)
        kinds = [fault.kind for fault in chain.driver.faults]
        clear_faults(chain)
        chain.wait(0.3)
        return kinds, activate(chain), max(chain.truth.pressures)

    kinds, activated, pressure = in_a_fork(exchanged)
    assert "exhaust_blocked" in kinds
    assert not activated
    assert pressure > 0.9 * chain.rig.supply_gauge_pressure  # only the supply can be shut


def test_two_sensors_of_another_range_are_not_seen(chain: Any) -> None:
    """The page of safety asks for a gauge, because of this."""

    def exchanged(chain: Any) -> None:
        motion, chain.motion = chain.motion, None
        vent(chain)
        settle(chain)
        for place in (0, 1):
            chain.sim.faults.sensors[next(iter(chain.sim.boards)), place] = lambda v, _: 0.6 * v
        clear_faults(chain)
        chain.wait(0.2)
        assert activate(chain)
        chain.wait(0.3)
        chain.motion = motion

    seen = watch(chain, exchanged, None, 3.0)
    assert seen.state is SafetyState.ACTIVE
    assert seen.pressure > 1.5 * seen.shown
