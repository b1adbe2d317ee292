"""References and settings that ask for more than a joint may do."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable, Mapping, Sequence

from pam_check.faults.acts import hold_at
from pam_check.faults.chain import FaultChain
from pam_control.controller_parameters import parameter_table, settings_from
from pam_control.references.trajectory import TrajectoryPoint

Values = Mapping[str, float]
Injection = Callable[[FaultChain, Values, random.Random], None]
_JUMP_EVERY = 0.25  # s
_NOISE_EVERY = 0.01  # s
LONG = 60_000  # points


def _serialized(name: str, points: Sequence[TrajectoryPoint]) -> bytes:
    """A trajectory_msgs/JointTrajectory of one joint in plain CDR, as DDS delivers it."""
    data = bytearray()

    def add(code: str, *values: float) -> None:
        size = struct.calcsize(code[-1])
        data.extend(bytes(-len(data) % size))
        data.extend(struct.pack(f"<{code}", *values))

    def text(value: str) -> None:
        add("I", len(value) + 1)
        data.extend(value.encode() + b"\0")

    add("iI", 0, 0)
    text("")
    add("I", 1)
    text(name)
    add("I", len(points))
    for point in points:
        for values in (point.positions, point.velocities, point.accelerations, ()):
            add("I", len(values))
            if values:
                add(f"{len(values)}d", *values)
        whole = int(point.time_from_start)
        add("iI", whole, round(1e9 * (point.time_from_start - whole)))
    return b"\0\1\0\0" + bytes(data)


def send_trajectory(
    chain: FaultChain, points: Sequence[TrajectoryPoint], ahead: float = 0.0
) -> None:
    """Send a trajectory to the first joint, as bytes as they arrive at the node.

    Its stamp is as far ahead [s]; 0 means "now".
    """
    chain.motion = None
    table = {entry.name: entry.default for entry in parameter_table(chain.rig.joint_names)}
    most = int(table["trajectory.max_points"])
    data = _serialized(chain.rig.joint_names[0], points)
    chain.intake.trajectory(data, most, lambda message: chain.now + ahead if ahead else None)


def _fast(chain: FaultChain, values: Values, draw: random.Random) -> None:
    end = 0.95 * draw.choice((-1.0, 1.0))
    points = [TrajectoryPoint(1.0, [-end]), TrajectoryPoint(1.0 + values["time"], [end])]
    send_trajectory(chain, points)


def _steep(chain: FaultChain, values: Values, draw: random.Random) -> None:
    speed = values["speed"] * draw.choice((-1.0, 1.0))
    points = [
        TrajectoryPoint(0.5, [0.0], [speed]),
        TrajectoryPoint(1.0, [0.2], [-speed]),
        TrajectoryPoint(1.5, [0.0], [0.0]),
    ]
    send_trajectory(chain, points)


def _long(chain: FaultChain, values: Values, draw: random.Random) -> None:
    motion = chain.motion
    send_trajectory(chain, [TrajectoryPoint(1.0 + 1e-3 * n, [0.1]) for n in range(LONG)])
    chain.motion = motion


def _ahead(chain: FaultChain, values: Values, draw: random.Random) -> None:
    motion = chain.motion
    send_trajectory(chain, [TrajectoryPoint(1.0, [0.5])], values["ahead"])
    chain.motion = motion


def _in_degrees(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """Someone streams the same motion in degrees: angle and speed, or the speed alone."""
    motion = chain.motion
    angle_too = draw.random() < 0.5

    def degrees(now: float) -> tuple[float, float]:
        angle, speed = (0.0, 0.0) if motion is None else motion(now)
        return math.degrees(angle) if angle_too else angle, math.degrees(speed)

    chain.motion = degrees


def _jumps(chain: FaultChain, values: Values, draw: random.Random) -> None:
    size = values["size"]
    chain.motion = lambda now: (size if now % (2.0 * _JUMP_EVERY) < _JUMP_EVERY else -size, 0.0)


def _noise(chain: FaultChain, values: Values, draw: random.Random) -> None:
    size, next_at, target = values["size"], chain.now, 0.0

    def motion(now: float) -> tuple[float, float]:
        nonlocal next_at, target
        if now >= next_at:
            next_at, target = now + _NOISE_EVERY, draw.uniform(-size, size)
        return target, 0.0

    chain.motion = motion


def _wrong_speed(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """The streamed speed does not belong to the streamed angle."""
    angle, speed = values["angle"], values["speed"] * draw.choice((-1.0, 1.0))
    chain.motion = lambda now: (angle, speed)


def _stiffness(chain: FaultChain, values: Values, draw: random.Random) -> None:
    low, high = 2.0, values["stiffness"]

    def change(now: float) -> None:
        value = low if now % (2.0 * _JUMP_EVERY) < _JUMP_EVERY else high
        chain.controller.set_stiffness([value] * len(chain.rig.joints))

    chain.before_control.append(change)


def _setting(name: str, value: float | bool) -> Injection:
    """A setting of the controller changes while the joint is held."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        hold_at(chain, values["angle"])
        names = chain.rig.joint_names
        base = {entry.name: entry.default for entry in parameter_table(names)}
        chain.controller.change(settings_from({**base, name: value}, names))

    return inject


def _stream_ends(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.motion = None


INJECTIONS: Mapping[str, Injection] = {
    "trajectory_too_fast": _fast,
    "trajectory_too_steep": _steep,
    "trajectory_too_long": _long,
    "trajectory_in_the_future": _ahead,
    "stream_in_degrees": _in_degrees,
    "stream_jumps": _jumps,
    "stream_is_noise": _noise,
    "stream_with_wrong_speed": _wrong_speed,
    "stream_ends": _stream_ends,
    "stiffness_jumps": _stiffness,
    "feedforward_switched_off": _setting("feedforward", False),
}
