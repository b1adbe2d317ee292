"""Interfaces of the suite that get random and mutated input; only PamError may escape from them."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.controller_parameters import create_controller, parameter_table
from pam_control.references.trajectory import TrajectoryPoint
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardState,
    FrameError,
    Heartbeat,
    ValveCommand,
)
from pam_driver.boards.pam_board.codec import Measurement as MeasurementFrame
from pam_driver.boards.pam_board.codec import Status as StatusFrame
from pam_driver.boards.pam_board.messages import BoardMessage
from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand, ValveCommandIntake
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_sim.boards.pam_board_twin import SimulatedPamBoard
from pam_sim.fault_injection import parse_injection

Target = Callable[[random.Random], None]
_NUMBERS = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1e308, -1e308, 5e-324, 1.0, -1.0, 2**63)
_NAMES = ("", "nobody", "\x00", "é" * 300, "elbow ", "__class__", "elbow.flexor")


class ViolationError(AssertionError):
    """Random input had an effect that it must not have."""


def frame(codec: BoardCodec, draw: random.Random) -> tuple[int, bytes]:
    """Noise, or a valid frame with flipped bits or another length."""
    if draw.random() < 0.5:
        return draw.randrange(1 << 11), draw.randbytes(draw.randrange(9))
    message: BoardMessage
    kind = draw.randrange(5)
    if kind == 0:
        enable = (draw.random() < 0.5, draw.random() < 0.5)
        valves = (draw.uniform(-1.0, 1.0), draw.uniform(-1.0, 1.0))
        message = ValveCommand(valves, enable, draw.randrange(256))
    elif kind == 1:
        message = BoardCommand(draw.choice(list(BoardCode)))
    elif kind == 2:
        pressures = (draw.uniform(-1e5, 1.2e6), draw.choice((math.nan, 1e5)))
        message = MeasurementFrame(pressures, draw.uniform(-8.0, 8.0), draw.randrange(256))
    elif kind == 3:
        faults = BoardFault(draw.randrange(2 * max(BoardFault)))
        message = StatusFrame(
            BoardState(draw.randrange(4)), faults, draw.randrange(256), 7e5, draw.randrange(1 << 16)
        )
    else:
        message = Heartbeat(draw.uniform(0.0, 4e6), draw.randrange(3), draw.randrange(1 << 16))
    identifier, data = codec.encode(draw.choice((0, 0, 1, 15)), message)
    what = draw.randrange(4)
    if what == 0:
        return identifier, data
    if what == 1:
        return identifier, draw.randbytes(draw.randrange(9)) + data[: draw.randrange(9)]
    word = int.from_bytes(data, "little")
    for _ in range(draw.randrange(1, 5)):
        word ^= 1 << draw.randrange(8 * len(data))
    return identifier ^ draw.choice((0, 0, 1, 0x400)), word.to_bytes(len(data), "little")


def _number(draw: random.Random) -> float:
    return draw.choice(_NUMBERS) if draw.random() < 0.4 else draw.uniform(-2.0, 2.0)


def numbers(draw: random.Random, count: int) -> list[float]:
    """Numbers of every kind; their number is often `count`."""
    size = count if draw.random() < 0.7 else draw.randrange(2 * count + 2)
    return [_number(draw) for _ in range(size)]


def names(draw: random.Random, known: Sequence[str]) -> list[str]:
    """The known names, shuffled, repeated, truncated or mixed with others."""
    chosen = list(known)
    if draw.random() < 0.3:
        draw.shuffle(chosen)
    if draw.random() < 0.3:
        chosen[draw.randrange(len(chosen))] = draw.choice((*_NAMES, *known))
    if draw.random() < 0.1:
        chosen = chosen[: draw.randrange(len(chosen) + 1)]
    return chosen


def frames_target(rig: Rig) -> Target:
    """The decoder gives a message or a FrameError, and a message can be encoded again."""
    codec = BoardCodec.from_dbc()

    def target(draw: random.Random) -> None:
        identifier, data = frame(codec, draw)
        try:
            board, message = codec.decode(identifier, data)
        except FrameError:
            return
        if codec.encode(board, message)[0] != identifier:
            raise ViolationError(f"{identifier:X} {data.hex()} decodes to {message}")

    return target


class _Port:
    """A bus that delivers queued frames and keeps the sent frames that allow air flow."""

    state = BusState.ERROR_ACTIVE

    def __init__(self, codec: BoardCodec) -> None:
        self.codec = codec
        self.waiting: list[ReceivedFrame] = []

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        """Return all queued frames."""
        waiting, self.waiting = self.waiting, []
        return waiting

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        """Raise an error if the frame would allow air flow."""
        _, message = self.codec.decode(frame_id, data)
        if isinstance(message, ValveCommand) and any(message.enable):
            raise ViolationError("a valve command from random input")
        return SendOutcome.SENT


def driver_target(rig: Rig) -> Target:
    """A driver that receives random input, vented or before activation, never allows air flow."""
    codec = BoardCodec.from_dbc()
    port = _Port(codec)
    driver = Driver(rig, port, DriverSettings(), PressurePlausibility(compose(rig), 0.002))
    clock = [100.0]

    def target(draw: random.Random) -> None:
        clock[0] += draw.choice((0.0, 0.002, 0.002, 0.3))
        now = clock[0]
        for _ in range(4):
            stamp = now + draw.choice((0.0, -1.0, 5.0))
            port.waiting.append(ReceivedFrame(*frame(codec, draw), stamp))
        driver.cycle(now, now)
        if draw.random() < 0.05:
            try:
                driver.activate(now)
            except PamError:
                driver.clear_faults(now)
        if driver.state is SafetyState.ACTIVE:
            raise ViolationError("active without a command")

    return target


def board_target(rig: Rig) -> Target:
    """A board that receives random input: only a frame with a valid checksum allows air flow."""
    codec = BoardCodec.from_dbc()
    board = SimulatedPamBoard(0, codec)
    own = {codec.frame_id(ValveCommand, 0), codec.frame_id(BoardCommand, 0)}
    clock = [0.0]

    def target(draw: random.Random) -> None:
        clock[0] += 0.001
        board.poll(clock[0], (1e5, 1e5), (0.0,), 7e5)
        before = board.state
        identifier, data = frame(codec, draw)
        board.on_frame(identifier, data, clock[0])
        if board.state is before or board.state is not BoardState.ACTIVE:
            return
        try:
            codec.decode(identifier, data)
        except FrameError:
            raise ViolationError(f"{identifier:X} {data.hex()} changed a board") from None
        if identifier not in own:
            raise ViolationError("a frame that is addressed to no board changed a board")

    return target


def commands_target(rig: Rig) -> Target:
    """Valve commands are refused, or give fractions within full scale."""
    intake = ValveCommandIntake(rig, 0.1)
    clock = [0.0]

    def target(draw: random.Random) -> None:
        clock[0] += 0.001
        count = len(rig.muscles)
        command = NamedCommand(
            names(draw, rig.muscle_names),
            numbers(draw, count),
            numbers(draw, count) if draw.random() < 0.1 else (),
            numbers(draw, count) if draw.random() < 0.2 else (),
            draw.choice((0.0, 0.0, 0.05, _number(draw))),
        )
        try:
            fractions = intake.take(command, clock[0])
        except PamError:
            return
        if not all(-1.0 <= fraction <= 1.0 for fraction in fractions):
            raise ViolationError(f"{command} gives {fractions}")

    return target


def _controller(rig: Rig) -> Controller:
    names = rig.joint_names
    return create_controller(rig, {p.name: p.default for p in parameter_table(names)}, names)


def references_target(rig: Rig) -> Target:
    """Trajectories, streams and stiffness are refused, or give finite references in the limits."""
    controller = _controller(rig)
    joints = rig.joint_names
    clock = [0.0]
    controller.references.hold(dict.fromkeys(joints, 0.0))

    def target(draw: random.Random) -> None:
        clock[0] += 0.002
        references, now, count = controller.references, clock[0], len(joints)
        try:
            what = draw.randrange(3)
            if what == 0:
                velocities = numbers(draw, count) if draw.random() < 0.5 else []
                references.stream(names(draw, joints), numbers(draw, count), velocities, now=now)
            elif what == 1:
                points = [
                    TrajectoryPoint(
                        draw.choice((0.1 * (i + 1), draw.uniform(-1.0, 2.0**31))),
                        numbers(draw, count),
                        numbers(draw, count) if draw.random() < 0.5 else [],
                        numbers(draw, count) if draw.random() < 0.2 else [],
                    )
                    for i in range(draw.randrange(4))
                ]
                # stamps and durations are whole seconds and nanoseconds, never NaN
                start = draw.choice((None, now, draw.uniform(-(2.0**31), 2.0**31)))
                references.follow(names(draw, joints), points, start=start, now=now)
            else:
                controller.set_stiffness(numbers(draw, count))
        except PamError:
            pass
        references.advance(now)
        for joint in rig.joints:
            position = references.sample(joint.name, now).position
            low, high = joint.position_limits
            if not low - 1e-6 <= position <= high + 1e-6:
                raise ViolationError(f"{joint.name} is sent to {position} rad")

    return target


def measurements_target(rig: Rig) -> Target:
    """Measurements give no commands of the controller, or finite ones."""
    controller = _controller(rig)
    clock = [0.0]

    def target(draw: random.Random) -> None:
        clock[0] += draw.choice((0.002, 0.002, 0.0, 10.0, -1.0))
        now = clock[0]
        good = draw.random() < 0.5
        positions = [draw.uniform(-0.9, 0.9) for _ in rig.joints]
        pressures = [draw.uniform(0.0, 6e5) for _ in rig.muscles]
        measurement = Measurement(
            positions if good else numbers(draw, len(rig.joints)),
            pressures if good else numbers(draw, len(rig.muscles)),
            draw.choice((now, now, now - 1.0, _number(draw))),
            draw.choice((now, now, now + 1.0, _number(draw))),
        )
        try:
            commands = controller.step(now, measurement).commands
        except PamError:
            controller.deactivate()
            return
        if commands is not None and not all(map(math.isfinite, commands)):
            raise ViolationError(f"{measurement} gives {commands}")

    return target


def injection(draw: random.Random) -> str:
    """A text that is similar to a request for a fault."""
    words = [draw.choice(("supply_lost", "share=0.3", "share=", "=", "share=nan", *_NAMES))]
    words += [draw.choice(("share=1e999", "share=-1", "x=1")) for _ in range(draw.randrange(3))]
    return " ".join(words)


def injections_target(rig: Rig) -> Target:
    """Requests for faults, valid and invalid ones."""

    def target(draw: random.Random) -> None:
        text = injection(draw)
        try:
            _, values = parse_injection(text, rig)
        except PamError:
            return
        if not all(map(math.isfinite, values.values())):
            raise ViolationError(f"{text} gives {values}")

    return target


TARGETS: Mapping[str, Callable[[Rig], Target]] = {
    "frames": frames_target,
    "driver": driver_target,
    "board": board_target,
    "commands": commands_target,
    "references": references_target,
    "measurements": measurements_target,
    "injections": injections_target,
}
