"""What may be exchanged on a robot, and a rig file that describes it as it is.

A joint that each muscle turns the wrong way has two hoses crossed or an encoder that counts the
other way. Both look alike to the sensors, so a person has to say which; the rig file can then
describe the robot as it is, and nothing on it needs to be changed. A flow valve whose sign is
reversed must be mended at the robot: its driver could not vent the muscle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from pam_demo.commission.robot_port import JointReading, RobotPort
from pam_model.rig.partial import PartialRig
from pam_model.rig.rewiring import crossed_hoses, turned_encoder


class Mend(Enum):
    """How something that is exchanged is put right; the value is kept in a file."""

    HOSES = "hoses"
    ENCODER = "encoder"
    AT_ROBOT = "at the robot"


Confirm = Callable[[Mend, str], bool]
"""Whether a person says that something is so; the text is the question."""
BY_RIG_FILE: Final = (Mend.HOSES, Mend.ENCODER)


def nobody(_: Mend, __: str) -> bool:
    """Confirm nothing, as where no person can be asked."""
    return False


def question(partial: PartialRig, mend: Mend) -> str:
    """What a person is asked.

    Parameters
    ----------
    partial : PartialRig
        With one joint, as written.
    mend : Mend
        What may be so.
    """
    first, second = partial.rig.joints[0].muscles
    if mend is Mend.HOSES:
        return (
            f"Does {second} swell when the valve of {first} opens? Then the new rig file gives "
            f"each of them the valve and the sensor of the other."
        )
    if mend is Mend.ENCODER:
        return (
            f"Does {first} swell when its own valve opens, so that the encoder counts the other "
            f"way? Then the new rig file counts the angle as the encoder does."
        )
    return (
        "Have you mended it at the robot, and are all muscles empty? Then the check begins again."
    )


def said_of(partial: PartialRig, mend: Mend) -> str:
    """What the new rig file has that the old one had not, in a sentence."""
    joint = partial.rig.joints[0]
    first, second = joint.muscles
    if mend is Mend.HOSES:
        return (
            f"The hoses of {first} and {second} are crossed; in the new rig file each has the "
            "board, channel and valve that fill it."
        )
    return (
        f"The encoder of {joint.name} counts the other way; in the new rig file the angle counts "
        "as the encoder does, so that muscles, limits and gravity_angle have changed sides."
    )


def why_not(partial: PartialRig, mend: Mend) -> str:
    """Why the robot cannot be moved with the changed rig file at once; empty if it can.

    The driver keeps the limits of the file with which it was started.
    """
    joint = partial.rig.joints[0]
    first, second = (partial.rig.muscle(name) for name in joint.muscles)
    lower, upper = joint.position_limits
    if mend is Mend.HOSES and first.max_pressure != second.max_pressure:
        change = crossed_hoses(partial.rig, joint)
    elif mend is Mend.ENCODER and lower != -upper:
        change = turned_encoder(partial.rig, joint)
    else:
        return ""
    return (
        f"The driver keeps the limits that it was started with. In the rig file, {change}; then "
        "start the driver and this command with it."
    )


def rewired(partial: PartialRig, mend: Mend) -> PartialRig:
    """The rig file of a joint whose hoses are crossed, or whose encoder counts the other way.

    Parameters
    ----------
    partial : PartialRig
        With one joint.
    mend : Mend
        Of `BY_RIG_FILE`.
    """
    rig, joint = partial.rig, partial.rig.joints[0]
    first, second = (rig.muscle(name) for name in joint.muscles)
    if mend is Mend.HOSES:
        for one, other in _both(first, second):
            rig = rig.with_muscle(one.with_valve_of(other))
        places = {f"{a.name}.valve.": f"{b.name}.valve." for a, b in _both(first, second)}
        ranges = {_moved(key, places): ends for key, ends in partial.ranges.items()}
        missing = frozenset(_moved(key, places) for key in partial.missing)
        return replace(partial, rig=rig, ranges=ranges, missing=missing)
    joint = joint.counted_the_other_way()
    rig = replace(rig, joints=(joint,), muscles=(second, first))  # the agonist comes first
    angle = f"{joint.name}.gravity_angle"
    ranges = {
        key: (-ends[1], -ends[0]) if key == angle else ends for key, ends in partial.ranges.items()
    }
    return replace(partial, rig=rig, ranges=ranges)


def _both[T](first: T, second: T) -> Sequence[tuple[T, T]]:
    return (first, second), (second, first)


def _moved(key: str, places: dict[str, str]) -> str:
    for old, new in places.items():
        if key.startswith(old):
            return new + key.removeprefix(old)
    return key


@dataclass(slots=True)
class CrossedPort:
    """A port on which the two muscles change places.

    The driver still has the rig file as it was: with crossed hoses its name of a valve is that of
    the other muscle, and with an encoder that counts the other way the other muscle is the agonist.
    """

    port: RobotPort  # the port as it is
    # period, measurement_delay, command_delay: its own [s]
    period: float
    measurement_delay: float
    command_delay: float

    @classmethod
    def of(cls, port: RobotPort) -> CrossedPort:
        """A port behind another one."""
        return cls(port, port.period, port.measurement_delay, port.command_delay)

    def advance(self, commands: Sequence[float]) -> JointReading:
        """As of every `RobotPort`."""
        first, second = commands
        reading = self.port.advance((second, first))
        return reading._replace(pressures=(reading.pressures[1], reading.pressures[0]))
