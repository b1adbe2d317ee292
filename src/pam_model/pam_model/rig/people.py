"""The optional section `people` of a rig file: how people stop the robot, and by which inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pam_model.rig.keys import Key, Section, keys_of

_INPUTS = ("emergency_stop", "enabling_switch")


@dataclass(frozen=True, slots=True)
class People:
    """The inputs for people on which the driver insists; by default on none.

    An input that a board reports is obeyed in any case. A key here says that it must exist: while
    it is missing or sends no message, nothing moves.
    """

    # emergency_stop_board, enabling_switch_board: the board that has this input
    emergency_stop_board: int | str | None = None
    enabling_switch_board: int | str | None = None
    # emergency_stop_topic, enabling_switch_topic: whether the driver's topic of this input must
    # permit motion
    emergency_stop_topic: bool = False
    enabling_switch_topic: bool = False
    # fmt: off
    deadline: Annotated[float, Key("s", 0.05, 5.0,
        text="an input without a message for longer forbids motion, or full speed")] = 0.2
    dump_valve_fill_time: Annotated[float, Key("s", 0.0, 30.0,
        text="time that the supply needs after the dump valve was closed; until then, and while it "
             "is open, a low supply is no fault. 0: no dump valve")] = 0.0
    brake_release_delay: Annotated[float, Key("s", 0.0, 5.0,
        text="time from the first command of the driver to a board until its brake is released: "
             "meanwhile the controller builds up the pressure that holds the joint")] = 0.0
    # whether the driver's topic of this input must permit full speed; without permission the joints
    # keep their `reduced_velocity`
    full_speed_topic: bool = False
    slowing_time: Annotated[float, Key("s", 0.1, 5.0,
        text="time in which the controller brakes after full speed is no longer permitted; then "
             "the driver stops a joint above its reduced_velocity")] = 0.5
    # fmt: on


def read_people(section: Section) -> People:
    """Read the section; problems are added to it."""
    numbers = {key: section.number(key, entry) for key, entry in keys_of(People).items()}
    stop, enabling = (section.place(f"{name}_board") for name in _INPUTS)
    stop_topic, enabling_topic = (section.flag(f"{name}_topic") for name in _INPUTS)
    full_speed = section.flag("full_speed_topic")
    section.finish()
    known = {key: value for key, value in numbers.items() if value is not None}
    return People(stop, enabling, stop_topic, enabling_topic, full_speed_topic=full_speed, **known)
