"""Faults of mapped and CANopen devices in the campaign: vented in time, device and object named."""

from __future__ import annotations

from pathlib import Path

import pytest

from pam_check.fault_kinds.device_kinds import DEVICE_KINDS, FOR_ALL_BOARDS
from pam_check.fault_kinds.kinds import KINDS
from pam_check.faults.campaign import in_a_fork, make_chain
from pam_check.faults.chain import FaultChain
from pam_check.faults.chosen_kinds import kinds_for
from pam_check.faults.trial import Trial, run_trial
from pam_model.rig import load_rig
from pam_sim.device_fault_injection import INJECTIONS
from support.canopen_device import ELBOW_CANOPEN
from support.fault_kinds import kind_called
from support.rigs import CONFIG

VENDOR = CONFIG / "elbow_vendor_dbc.yaml"


def chain_of(path: Path) -> FaultChain:
    return make_chain(load_rig(path))


@pytest.fixture(scope="module")
def canopen_chain() -> FaultChain:
    return chain_of(ELBOW_CANOPEN)


@pytest.fixture(scope="module")
def mapped_chain() -> FaultChain:
    """A chain whose frames have identifiers of 29 bits."""
    return chain_of(VENDOR)


def trial_of(chain: FaultChain, name: str, **values: float) -> Trial:
    return in_a_fork(lambda: run_trial(chain, kind_called(name), values, 1))


def test_a_rig_gets_the_kinds_that_are_stated_for_its_boards() -> None:
    assert kinds_for({"pam_board"}) == list(KINDS)
    for board in ("canopen", "mapped"):
        names = {kind.name for kind in kinds_for({board})}
        assert names > set(FOR_ALL_BOARDS)
        assert names - set(FOR_ALL_BOARDS) == {
            kind.name for kind in DEVICE_KINDS if board in kind.boards
        }
    assert set(INJECTIONS) == {kind.name for kind in DEVICE_KINDS}
    assert all(kind.message for kind in DEVICE_KINDS)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("device_unplugged", "no "),
        ("canopen_set_points_wrong_length", "PDO "),
        ("canopen_other_device", "object 0x1000:0 (device profile by "),
    ],
)
def test_a_fault_of_a_canopen_device_vents_and_names_node_and_object(
    canopen_chain: FaultChain, name: str, says: str
) -> None:
    trial = trial_of(canopen_chain, name)
    assert trial.problem == ""
    assert says in trial.message


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("mapped_other_byte_order", ""),
        ("mapped_other_checksum", "PVM_Actual of board manifold fails its checksum"),
        ("mapped_set_points_wrong_length", "watchdog"),
    ],
)
def test_a_fault_of_a_mapped_device_vents_and_names_device_and_signal(
    mapped_chain: FaultChain, name: str, says: str
) -> None:
    trial = trial_of(mapped_chain, name)
    assert trial.problem == ""
    assert says in trial.message


def test_a_message_that_does_not_come_is_out_of_bounds(mapped_chain: FaultChain) -> None:
    from dataclasses import replace

    kind = replace(kind_called("vent_called"), message="a text that nobody says")
    assert "no message like" in in_a_fork(lambda: run_trial(mapped_chain, kind, {}, 1)).problem
