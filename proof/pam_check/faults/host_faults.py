"""Injects each fault of the bus controller, the host and the commands into the chain."""

from __future__ import annotations

import errno
import math
import random
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import can

from pam_check.faults.chain import STEP, FaultChain
from pam_check.faults.virtual_can import BUS_OFF, CONTROLLER, RESTARTED
from pam_control.controller_parameters import parameter_table, settings_from
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.errors import PamError
from pam_ros.errors import ParameterError
from pam_ros.valve_command import FLOW

Values = Mapping[str, float]
Injection = Callable[[FaultChain, Values, random.Random], None]
_ACKNOWLEDGE, _PASSIVE = 0x20, 0x20


def _bus_off(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.can.bus_off = True
    chain.can.error(BUS_OFF, 0, chain.wall)

    def restart() -> None:
        chain.can.bus_off = False
        chain.can.error(RESTARTED, 0, chain.wall)

    chain.at(chain.now + values["duration"], restart)


def _bus_down(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.can.down = True
    chain.at(chain.now + values["duration"], lambda: setattr(chain.can, "down", False))


def _queue_full(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.can.full = True
    chain.at(chain.now + values["duration"], lambda: setattr(chain.can, "full", False))


def _error_frames(chain: FaultChain, values: Values, draw: random.Random) -> None:
    end = chain.now + values["duration"]

    def more(now: float) -> None:
        if now < end and draw.random() < 0.3:
            kind, detail = draw.choice(((CONTROLLER, _PASSIVE), (_ACKNOWLEDGE, 0), (0x8, 0)))
            chain.can.error(kind, detail, chain.wall)

    chain.inject.append(more)


class _SecondEnd(can.BusABC):
    """Another node on the same bus; it receives nothing."""

    def __init__(self, chain: FaultChain) -> None:
        self._chain = chain

    def recv(self, timeout: float | None = None) -> can.Message | None:
        return None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        chain, frame = self._chain, (msg.arbitration_id, bytes(msg.data))
        if chain.can.down or chain.can.bus_off:
            raise can.CanOperationError("no bus", errno.ENETDOWN)
        chain.can.to_boards.append(frame)
        chain.can.deliver(frame, chain.wall)

    def shutdown(self) -> None:
        """There is nothing to close."""


def _two_drivers(chain: FaultChain, values: Values, draw: random.Random) -> None:
    port = chain.open_port("second", _SecondEnd(chain))
    second = chain.make_driver(port)
    chain.inject.append(lambda now: second.cycle(now, chain.wall) and None)


def _clock(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.wall += values["by"]


def _stop(*names: str, again: bool = True) -> Injection:
    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        for name in names:
            setattr(chain, name, False)
            if again:
                chain.at(chain.now + values["duration"], partial(setattr, chain, name, True))

    return inject


def _parameters(chain: FaultChain, values: Values, draw: random.Random) -> None:
    names = chain.rig.joint_names
    table = {entry.name: entry for entry in parameter_table(names)}
    base = {name: entry.default for name, entry in table.items()}
    numbers = [name for name, entry in table.items() if isinstance(entry.default, float)]
    for _ in range(20):
        name = draw.choice(numbers)
        value = draw.choice((math.nan, math.inf, -math.inf, 1e300, -1e9))
        try:
            table[name].check(value)
            chain.controller.change(settings_from({**base, name: value}, names))
        except (PamError, ParameterError):
            chain.noticed["refused parameters"] += 1


def _references(chain: FaultChain, values: Values, draw: random.Random) -> None:
    joint = chain.rig.joint_names[0]
    bad: tuple[tuple[list[str], list[float], list[float]], ...] = (
        ([joint], [math.nan], []), ([joint], [math.inf], []), ([joint], [100.0], []),
        (["nobody"], [0.0], []), ([joint], [0.0, 0.0], []), ([joint, joint], [0.0, 0.0], []),
        ([joint], [0.0], [math.nan]), ([], [0.0], []), ([joint], [], []),
    )  # fmt: skip
    for names, positions, velocities in bad:
        try:
            chain.controller.references.stream(names, positions, velocities, now=chain.wall)
        except PamError:
            chain.noticed["refused references"] += 1


def _measurements(chain: FaultChain, values: Values, draw: random.Random) -> None:
    end = chain.now + values["duration"]
    wrong = draw.choice((math.nan, math.inf, -math.inf))
    size = draw.choice([n for n in range(6) if n != len(chain.rig.joints)])

    def spoil(now: float) -> None:
        if now < end:
            if draw.random() < 0.5:
                count = len(chain.rig.muscles)
                chain.heard = replace(chain.heard, pressures=(wrong,) * count)
            else:
                chain.heard = replace(chain.heard, positions=(0.0,) * size)

    chain.before_control.append(spoil)


Change = Callable[[FaultChain, NamedCommand, random.Random], NamedCommand]


def _edit(change: Change) -> Injection:
    """Change every command, or a share of them, between controller and driver."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        end, share = chain.now + values["duration"], values.get("share", 1.0)

        def edit(command: NamedCommand) -> list[NamedCommand]:
            if chain.now < end and draw.random() < share:
                return [change(chain, command, draw)]
            return [command]

        chain.edit = edit

    return inject


def _values_of(chain: FaultChain, command: NamedCommand) -> list[float]:
    return chain.command_format.unpack(
        command.names, command.position, command.velocity, command.effort
    )


def _with_values(chain: FaultChain, command: NamedCommand, values: list[float]) -> NamedCommand:
    position, effort = chain.command_format.pack(values)
    return command._replace(names=chain.rig.muscle_names, position=position, effort=effort)


def _values_to(number: float) -> Change:
    def change(chain: FaultChain, command: NamedCommand, draw: random.Random) -> NamedCommand:
        values = _values_of(chain, command)
        values[draw.randrange(len(values))] = number
        return _with_values(chain, command, values)

    return change


def _wrong_size(chain: FaultChain, command: NamedCommand, draw: random.Random) -> NamedCommand:
    size = draw.choice([n for n in range(1, 7) if n != len(command.names)])
    return command._replace(position=[0.0] * size)


def _unknown(chain: FaultChain, command: NamedCommand, draw: random.Random) -> NamedCommand:
    name = draw.choice(("", "nobody", "\x00", "\N{BANANA}" * 1000))
    return command._replace(names=[name, *command.names[1:]])


def _old_between(chain: FaultChain, values: Values, draw: random.Random) -> None:
    end = chain.now + values["duration"]
    before: deque[NamedCommand] = deque(maxlen=40)

    def edit(command: NamedCommand) -> list[NamedCommand]:
        before.append(command)
        if chain.now < end and len(before) > 15 and draw.random() < values["share"]:
            return [command, before[0]._replace(age=len(before) * 2 * STEP)]
        return [command]

    chain.edit = edit


def _flood(chain: FaultChain, values: Values, draw: random.Random) -> None:
    end = chain.now + values["duration"]
    chain.edit = lambda command: [command] * (50 if chain.now < end else 1)


def _second_publisher(chain: FaultChain, values: Values, draw: random.Random) -> None:
    end = chain.now + values["duration"]
    drawn = [draw.uniform(-1.0, 1.0) for _ in chain.rig.muscles]

    def other(command: NamedCommand) -> NamedCommand:
        values = _values_of(chain, command)
        for place, kind in enumerate(chain.rig.valve_kinds.values()):
            values[place] = drawn[place] if kind == FLOW else abs(drawn[place]) * values[place]
        return _with_values(chain, command, values)._replace(source="another node")

    chain.edit = lambda command: [command, other(command)] if chain.now < end else [command]


INJECTIONS: Mapping[str, Injection] = {
    "bus_off": _bus_off,
    "bus_down": _bus_down,
    "error_frames": _error_frames,
    "send_queue_full_short": _queue_full,
    "send_queue_full": _queue_full,
    "two_drivers": _two_drivers,
    "clock_step": _clock,
    "host_stall_short": _stop("driver_runs", "controller_runs"),
    "host_stall": _stop("driver_runs", "controller_runs"),
    "driver_stopped": _stop("driver_runs"),
    "driver_killed": _stop("driver_runs", again=False),
    "controller_stopped_short": _stop("controller_runs"),
    "controller_stopped": _stop("controller_runs"),
    "controller_killed": _stop("controller_runs", again=False),
    "parameters_nonsense": _parameters,
    "references_nonsense": _references,
    "measurements_nonsense": _measurements,
    "command_nan": _edit(_values_to(math.nan)),
    "command_infinite": _edit(_values_to(math.inf)),
    "command_out_of_range": _edit(
        lambda chain, c, d: _values_to(d.choice((-9e9, 9e9)))(chain, c, d)
    ),
    "command_wrong_size": _edit(_wrong_size),
    "command_unknown_name": _edit(_unknown),
    "command_name_twice": _edit(lambda _, c, d: c._replace(names=[c.names[0]] * len(c.names))),
    "command_wrong_field": _edit(lambda _, c, d: c._replace(velocity=[0.0] * len(c.names))),
    "command_stale": _edit(lambda _, c, d: c._replace(age=d.uniform(0.11, 10.0))),
    "command_future": _edit(lambda _, c, d: c._replace(age=-d.uniform(0.02, 10.0))),
    "command_some_bad": _edit(_values_to(math.nan)),
    "command_old_between": _old_between,
    "command_flood": _flood,
    "command_two_publishers": _second_publisher,
}
