"""Injects the faults of devices that are no board of this project: mapped ones and CANopen."""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Mapping
from typing import Final

from pam_driver.boards.canopen.device import Check
from pam_driver.boards.canopen.reader import read_device as read_canopen_device
from pam_driver.boards.mapped.kind import read_device as read_mapped_device
from pam_driver.boards.protocol import Address, WiredBoard
from pam_driver.boards.wiring import kind_name
from pam_model.errors import PamError
from pam_sim.fault_stage import FOR_EVER, FaultStage, Injection, Values
from pam_sim.faults.frame_faults import Direction, FrameFault

_HEARTBEAT: Final = 0x700
_TPDOS: Final = (0x180, 0x280, 0x380, 0x480)
_RPDOS: Final = (0x200, 0x300, 0x400, 0x500)
_DEVICE_TYPE: Final = 0x1000
_SDO_REQUEST: Final = 0x600

Fits = Callable[[WiredBoard], bool]


def _measures(wired: WiredBoard) -> bool:
    return bool(wired.pressures or wired.angles)


def _drives(wired: WiredBoard) -> bool:
    return bool(wired.valves)


def _is_recognised(wired: WiredBoard) -> bool:
    """Whether the driver compares the device profile; an EDS file may state none (0)."""
    device, _ = read_canopen_device(wired)
    return any(step.name.index == _DEVICE_TYPE for step in device.steps if isinstance(step, Check))


def _any(wired: WiredBoard) -> bool:
    return True


def _device(stage: FaultStage, draw: random.Random, kinds: Collection[str], fits: Fits) -> Address:
    """A randomly chosen device of these kinds.

    Raises
    ------
    PamError
        If the rig has none.
    """
    found = [
        address
        for address, wired in stage.sim.wired.items()
        if kind_name(wired) in kinds and fits(wired)
    ]
    if not found:
        raise PamError(f"the rig has no {' or '.join(kinds)} device that can have this fault")
    return draw.choice(found)


def _unplug(stage: FaultStage, values: Values, draw: random.Random) -> None:
    stage.sim.faults.unplugged.add(_device(stage, draw, ("mapped", "canopen"), _any))


def _misbehaves(kind: str, fault: str, fits: Fits = _any, *, restarts: bool = False) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        address = _device(stage, draw, (kind,), fits)
        if restarts:
            stage.sim.restart_board(address, stage.now)
        stage.sim.boards[address].misbehave(fault, values.get("value", 0.0))

    return inject


def _reboots(kind: str) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        stage.sim.restart_board(_device(stage, draw, (kind,), _any), stage.now)

    return inject


def _spoil(stage: FaultStage, how: str, direction: Direction, identifiers: Collection[int]) -> None:
    stage.frames.faults.append(
        FrameFault(how, direction, 1.0, 0.0, FOR_EVER, only=frozenset(identifiers))
    )


def _canopen_frames(
    how: str, direction: Direction, bases: Collection[int], fits: Fits, *, restarts: bool = False
) -> Injection:
    """All frames of one device with these function codes are spoiled."""

    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        address = _device(stage, draw, ("canopen",), fits)
        node = int(stage.sim.wired[address].settings["node"])
        _spoil(stage, how, direction, [base + node for base in bases])
        if restarts:
            stage.sim.restart_board(address, stage.now)

    return inject


def _host_heartbeat_lost(stage: FaultStage, values: Values, draw: random.Random) -> None:
    address = _device(stage, draw, ("canopen",), _drives)
    device, _ = read_canopen_device(stage.sim.wired[address])
    _spoil(stage, "lost", "down", [_HEARTBEAT + device.host_node])


def _mapped_answers(how: str, *, status: bool) -> Injection:
    """All messages with measurements, or all with the state, are spoiled."""

    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        address = _device(stage, draw, ("mapped",), _any)
        answers = read_mapped_device(stage.sim.wired[address]).answers
        chosen = [frame.frame_id for frame in answers if (frame.state is not None) is status]
        _spoil(stage, how, "up", chosen)

    return inject


def _mapped_commands(stage: FaultStage, values: Values, draw: random.Random) -> None:
    address = _device(stage, draw, ("mapped",), _drives)
    commands = read_mapped_device(stage.sim.wired[address]).commands
    _spoil(stage, "wrong_length", "down", [frame.frame_id for frame in commands])


INJECTIONS: Final[Mapping[str, Injection]] = {
    "device_unplugged": _unplug,
    "canopen_reboots": _reboots("canopen"),
    "canopen_emergency": _misbehaves("canopen", "emergency"),
    "canopen_stops_by_itself": _misbehaves("canopen", "leave"),
    "canopen_heartbeat_lost": _canopen_frames("lost", "up", (_HEARTBEAT,), _any),
    "canopen_host_heartbeat_lost": _host_heartbeat_lost,
    "canopen_refuses_an_object": _misbehaves("canopen", "refuse_configuration", restarts=True),
    "canopen_answers_no_sdo": _canopen_frames("lost", "down", (_SDO_REQUEST,), _any, restarts=True),
    "canopen_measurements_wrong_length": _canopen_frames("wrong_length", "up", _TPDOS, _measures),
    "canopen_set_points_wrong_length": _canopen_frames("wrong_length", "down", _RPDOS, _drives),
    "canopen_other_device": _misbehaves("canopen", "other_device", _is_recognised, restarts=True),
    "mapped_reboots": _reboots("mapped"),
    "mapped_reports_a_fault": _misbehaves("mapped", "fault"),
    "mapped_status_lost": _mapped_answers("lost", status=True),
    "mapped_measurements_wrong_length": _mapped_answers("wrong_length", status=False),
    "mapped_set_points_wrong_length": _mapped_commands,
    "mapped_other_byte_order": _misbehaves("mapped", "other_byte_order", _measures),
    "mapped_other_checksum": _misbehaves("mapped", "other_checksum", _measures),
}
