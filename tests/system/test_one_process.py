"""Driver, controller and model in one process: it moves a joint, and however it ends, it vents."""

from __future__ import annotations

import signal
import textwrap

import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from pam_demo.programs import NODES_OF_ROBOT
from support.reruns import HOST_STALLS

from .conftest import TOGETHER
from .test_whole_chain_ends import is_disarmed, is_vented, pressurise

pytestmark = pytest.mark.system
OBSERVED = ("joint_states", "pressure_states", "valve_commands", "sent_valve_commands",
            "muscle_states", "joint_estimates", "pam_controller/reference")  # fmt: skip


@pytest.mark.rerun_because(HOST_STALLS)
def test_it_moves_a_joint_answers_and_dies_vented(make_suite, rig_path):
    suite = make_suite(rig_path, TOGETHER)
    heard = {topic: suite.probe.listen(JointState, topic) for topic in OBSERVED}
    assert set(NODES_OF_ROBOT.values()) <= set(suite.probe.node.get_node_names())
    suite.move({"elbow": 0.3}, 0.5)
    suite.wait_until_at("elbow", 0.3)
    suite.wait("every topic", lambda: all(len(messages) > 5 for messages in heard.values()))
    assert suite.probe.call(Trigger, "pam_controller/stop", Trigger.Request()).success
    assert suite.probe.call(Trigger, "pam_driver/vent", Trigger.Request()).success
    suite.frames.wait_for("vented", is_vented, 20.0 * suite.patience, suite.frames.now)
    suite.recover()
    pressurise(suite)

    process = suite.chain.processes.pop("robot")
    at = suite.frames.now
    process.send(signal.SIGKILL)
    assert process.wait(10.0 * suite.patience) == -signal.SIGKILL
    suite.frames.wait_for("disarmed by the watchdog", is_disarmed, 10.0 * suite.patience, at)
    suite.frames.wait_for("vented", is_vented, 10.0 * suite.patience, at)

    suite.start("robot")  # the watchdog is latched: a new process must not clear it by itself
    suite.recover()
    suite.wait_until_controlling()
    pressurise(suite)
    process = suite.chain.processes.pop("robot")
    process.send(signal.SIGINT)
    process.send(signal.SIGINT)  # in a launch file: from the terminal, and handed on by launch
    assert process.wait(15.0 * suite.patience) == 0, process.output
    assert "Traceback" not in process.output
    suite.frames.wait_for("vented", is_vented, 10.0 * suite.patience, suite.frames.now - 0.2)


FAILING = """
    import sys
    from pam_control.controller import Controller
    from pam_robot.__main__ import main

    step, since = Controller.step, []

    def failing(self, *given):
        since.extend(self.active * [1])
        if len(since) > 100:
            raise RuntimeError("of the test")
        return step(self, *given)

    Controller.step = failing
    sys.exit(main())
"""


@pytest.mark.rerun_because(HOST_STALLS)
def test_an_exception_ends_it_vented_with_code_70_and_the_boards_keep_the_fault(
    make_suite, rig_path, tmp_path, monkeypatch
):
    program = tmp_path / "failing_robot.py"
    program.write_text(textwrap.dedent(FAILING))
    monkeypatch.setattr("pam_demo.chain.ROBOT", "failing_robot")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    suite = make_suite(rig_path, ("rig",))
    suite.start("robot")
    process = suite.chain.processes.pop("robot")
    assert process.wait(60.0 * suite.patience) == 70, process.output
    assert "internal error" in process.output
    assert "of the test" in process.output
    assert "Traceback" not in process.output
    suite.frames.wait_for("vented", is_vented, 10.0 * suite.patience, suite.frames.now - 0.2)
    monkeypatch.undo()
    suite.start("robot")
    suite.chain.processes["robot"].wait_for_output("latched until", 60.0 * suite.patience)
    assert suite.driver_state() != "active"
