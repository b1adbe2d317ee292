"""Measurements of other nodes beside those of the driver: second publishers, recordings."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable, Mapping

from pam_check.fault_kinds.host_and_command_kinds import TURNS
from pam_check.faults.chain import FaultChain
from pam_driver.snapshot import Snapshot

Values = Mapping[str, float]
STEP = 0.1  # rad; at the greatest speed of the motion, the joint goes 0.03 rad
Injection = Callable[[FaultChain, Values, random.Random], None]


def _claim_hardly_moves(chain: FaultChain) -> None:
    """Until the controller has recognised two nodes, the joint does not follow the wrong one."""
    angle, until = chain.truth.positions[0], chain.now + TURNS

    def hardly_moves() -> str:
        way = abs(chain.truth.positions[0] - angle)
        return f"the joint moves by {way:.2f} rad" if chain.now < until and way > STEP else ""

    chain.claims.append(hardly_moves)


def _in_degrees(seen: Snapshot) -> Snapshot:
    return seen._replace(positions=tuple(map(math.degrees, seen.positions)))


def _in_kpa(seen: Snapshot) -> Snapshot:
    return seen._replace(pressures=tuple(1e-3 * value for value in seen.pressures))


def _second_node(change: Callable[[Snapshot], Snapshot]) -> Injection:
    """A second node publishes measurements, changed, between those of the driver."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        end = chain.now + values["duration"]
        _claim_hardly_moves(chain)

        def publish(now: float) -> None:
            if now < end and chain.published is not None:
                chain.hear(change(chain.published), "another node")

        chain.before_control.append(publish)

    return inject


def _recording(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """Measurements of some time ago are published again, with the stamps of today."""
    past: deque[tuple[float, Snapshot]] = deque()

    def record(now: float) -> None:
        if chain.published is not None:
            past.append((now, chain.published))

    chain.before_control.append(record)
    chain.wait(values["past"])
    _claim_hardly_moves(chain)
    end = chain.now + values["duration"]

    def play(now: float) -> None:
        while past[0][0] < now - values["past"]:
            past.popleft()
        if now < end:
            old, wall = past[0][1], chain.wall
            chain.hear(old._replace(joint_stamp=wall, pressure_stamp=wall), "the recording")

    chain.before_control.append(play)


INJECTIONS: Mapping[str, Injection] = {
    "measurements_of_a_second_node_in_degrees": _second_node(_in_degrees),
    "measurements_of_a_second_node_in_kpa": _second_node(_in_kpa),
    "recording_played_into_the_rig": _recording,
}
