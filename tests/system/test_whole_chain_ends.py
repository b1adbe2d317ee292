"""However a node ends, the muscles are vented, and nothing hangs. Seen on the bus.

The chain is that of test_whole_chain.py, which runs before.
"""

from __future__ import annotations

import math
import signal

import pytest

from pam_driver.boards.pam_board.codec import (
    BoardMessage,
    BoardState,
    Measurement,
    Status,
    ValveCommand,
)
from support.reruns import HOST_STALLS

pytestmark = pytest.mark.system
PRESSURISED = 5e4  # Pa
VENTED = 3e3  # Pa
HOW = {
    "Ctrl-C": signal.SIGINT,
    "SIGTERM": signal.SIGTERM,
    "kill -9": signal.SIGKILL,
}


def is_pressurised(board: int, message: BoardMessage) -> bool:
    return isinstance(message, Measurement) and min(message.pressures) > PRESSURISED


def is_vented(board: int, message: BoardMessage) -> bool:
    return isinstance(message, Measurement) and max(message.pressures) < VENTED


def is_disarmed(board: int, message: BoardMessage) -> bool:
    return isinstance(message, Status) and message.state is not BoardState.ACTIVE


def pressurise(suite) -> None:
    """Wait until both muscles hold pressure."""
    timeout = 20.0 * suite.patience
    suite.frames.wait_for("pressure", is_pressurised, timeout, suite.frames.now)


def end(suite, name: str, how: str) -> float:
    """End a node; when that was. Ctrl-C and SIGTERM must be obeyed, with exit code 0."""
    process = suite.chain.processes.pop(name)
    at: float = suite.frames.now
    process.send(HOW[how])
    if how == "Ctrl-C":
        process.send(HOW[how])  # in a launch file: from the terminal, and handed on by launch
    code = process.wait(10.0 * suite.patience)
    expected = -signal.SIGKILL if how == "kill -9" else 0
    assert code == expected, f"{name}: {process.output}"
    assert "Traceback" not in process.output
    return at


@pytest.mark.rerun_because(HOST_STALLS)
def test_without_its_model_the_joint_is_held_and_without_its_controller_vented(suite):
    """It runs last, so that nobody has to wait until the nodes have started again."""
    timeout = 10.0 * suite.patience
    pressurise(suite)
    at = end(suite, "model", "Ctrl-C")
    suite.frames.wait_for("control without the model", is_pressurised, timeout, at + 1.0)
    assert suite.driver_state() == "active"
    at = end(suite, "controller", "kill -9")
    suite.frames.wait_for("vented without the controller", is_vented, timeout, at)
    assert suite.driver_state() != "active"


@pytest.mark.long(
    "two of the nodes are ended in one run; test_driver_node and test_faults end the others"
)
@pytest.mark.rerun_because(HOST_STALLS)
@pytest.mark.parametrize("how", HOW)
def test_any_node_may_end(suite, how):
    timeout = 10.0 * suite.patience
    pressurise(suite)

    # The model only estimates: without it the joint is held as before.
    at = end(suite, "model", how)
    suite.frames.wait_for("control without the model", is_pressurised, timeout, at + 1.0)
    assert suite.driver_state() == "active"

    at = end(suite, "controller", how)
    suite.frames.wait_for("vented without the controller", is_vented, timeout, at)
    suite.start("controller")
    # it follows the driver, and controls nothing before someone has activated it again
    suite.recover()
    suite.wait_until_controlling()
    pressurise(suite)

    at = end(suite, "driver", how)
    suite.frames.wait_for("disarmed without the driver", is_disarmed, timeout, at)
    suite.frames.wait_for("vented without the driver", is_vented, timeout, at)
    suite.start("driver")
    # after kill -9 the board's watchdog is latched: a new driver must not clear it by itself
    suite.recover()
    pressurise(suite)

    # Without boards nothing can be shown of the muscles; but the driver must shut its valves, and
    # must not open them again when the boards come back.
    at = end(suite, "rig", how)
    suite.frames.wait_for(
        "valves disabled without the boards",
        lambda _, message: isinstance(message, ValveCommand) and not any(message.enable),
        timeout,
        at,
    )
    suite.start("rig")
    back, _ = suite.frames.wait_for(
        "the boards back", lambda _, m: isinstance(m, Measurement), 6 * timeout, suite.frames.now
    )
    suite.frames.wait_for("vented", is_vented, timeout, back + 0.5)
    commands = suite.frames.heard(ValveCommand, back)
    assert commands
    assert not any(any(message.enable) for _, message in commands)
    peak = max(
        (max(m.pressures) for _, m in suite.frames.heard(Measurement, back)), default=math.nan
    )
    assert peak < VENTED
