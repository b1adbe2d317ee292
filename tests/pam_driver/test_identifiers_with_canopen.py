"""A valve board of this project and a CANopen device on one bus, with the second identifiers."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cantools
import pytest

from pam_driver.boards.identifier_clashes import canopen_use
from pam_driver.boards.pam_board.codec import (
    BoardCodec,
    BoardCommand,
    DbcError,
    Heartbeat,
    Measurement,
    Status,
    ValveCommand,
    default_dbc_path,
)
from pam_driver.boards.wiring import RigWiring
from pam_driver.safety.states import SafetyState
from pam_model.errors import RigError
from pam_model.rig import Rig, load_rig
from support.canopen_device import ELBOW_REGULATOR
from support.mapped_device import nested
from support.rigs import CONFIG

from .simulated_robot import Robot

NUMBER = 1  # of the board, and of the CANopen node: all their identifiers would be equal
MESSAGES = (BoardCommand, ValveCommand, Measurement, Status, Heartbeat)


def shared_rig(**changes: Any) -> Rig:
    """The elbow: regulators on a valve board, and a CANopen encoder, on the only bus."""
    rig = load_rig(ELBOW_REGULATOR)
    sections = nested(rig.boards)
    sections["encoder"]["node"] = NUMBER
    sections["coupler"] = {"kind": "pam_board", "number": NUMBER, **changes}
    channels = {"port_a": 0, "port_b": 1}
    muscles = tuple(replace(one, channel=channels[str(one.channel)]) for one in rig.muscles)
    return replace(rig, boards=sections, muscles=muscles)


def test_a_board_and_a_canopen_device_with_the_same_number_share_a_bus() -> None:
    robot = Robot(shared_rig(identifiers="with_canopen"))
    robot.move()
    robot.run(0.5, command=True)
    assert robot.driver.state is SafetyState.ACTIVE, robot.driver.faults
    assert not robot.driver.frame_errors, robot.driver.last_frame_error
    robot.sim.restart_board("encoder", robot.now)
    robot.run(0.1, command=False)
    assert robot.driver.state is SafetyState.FAULT
    assert not robot.sim.boards["coupler"].active


def test_without_the_second_identifiers_such_a_bus_is_refused() -> None:
    with pytest.raises(RigError, match=r"identifier 0x181 .*TPDO1"):
        RigWiring(shared_rig()).make_boards()


def test_no_service_of_canopen_uses_the_second_identifiers() -> None:
    codec = BoardCodec.from_dbc(with_canopen=True)
    for board in range(codec.board_count):
        for message in MESSAGES:
            assert canopen_use(codec.frame_id(message, board)) == ""


def test_an_unknown_set_of_identifiers_is_refused_by_name() -> None:
    with pytest.raises(RigError, match=r"boards.coupler.identifiers = other: expected own_bus or"):
        RigWiring(shared_rig(identifiers="other"))


def test_a_dbc_file_without_the_second_identifiers_is_refused_by_name(tmp_path: Path) -> None:
    text = re.sub(r".*IdWithCanopen.*\n", "", default_dbc_path().read_text())
    path = tmp_path / "own.dbc"
    path.write_text(text)
    BoardCodec.from_dbc(path)
    with pytest.raises(DbcError, match="attribute IdWithCanopen of BoardCommand is missing"):
        BoardCodec.from_dbc(path, with_canopen=True)


def test_the_firmware_has_the_second_identifiers_of_the_dbc_file() -> None:
    source = (CONFIG.parent / "firmware/core/pam_frames.c").read_text()
    (found,) = re.findall(r"WITH_CANOPEN\[\] = \{(.*)\};", source)
    codec = BoardCodec.from_dbc(with_canopen=True)
    assert [int(one, 16) for one in found.split(",")] == [codec.frame_id(m, 0) for m in MESSAGES]
    assert cantools.database.load_file(default_dbc_path()).messages
