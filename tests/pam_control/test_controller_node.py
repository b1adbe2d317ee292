"""The controller as a process, spoken to over ROS alone."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import threading
import time

import pytest

rclpy = pytest.importorskip("rclpy")

from rcl_interfaces.srv import DescribeParameters, GetParameters  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Float64MultiArray  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from pam_demo.chain import private_domain  # noqa: E402
from support.processes import end  # noqa: E402
from support.reruns import HOST_STALLS  # noqa: E402

from .controller_bench import (  # noqa: E402
    CONTROLLER,
    ELBOW,
    MUSCLES,
    PATIENCE,
    Bench,
    command,
    environment,
)

pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def domain() -> int:
    return int(private_domain()["ROS_DOMAIN_ID"])


@pytest.fixture(scope="module")
def bench(domain):
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    made = Bench(domain)
    yield made
    made.close()


@pytest.fixture(scope="module")
def controller(bench, domain):
    """A running controller that holds the arm."""
    process = subprocess.Popen(
        command(ELBOW, CONTROLLER, parameters={"loop.stale_after": 0.25}),
        env=environment(domain),
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        bench.wait(lambda: bench.commands or process.poll() is not None, "valve commands")
        assert process.poll() is None, process.stderr.read()
        bench.wait_until_heard()
        yield process
    finally:
        end(process)


def test_commands_carry_spools_in_position_and_nothing_in_effort(bench, controller):
    message = bench.commands[-1]
    assert list(message.name) == MUSCLES
    assert all(-1.0 <= spool <= 1.0 for spool in message.position)
    assert not message.effort
    assert message.header.stamp.sec > 0


@pytest.mark.rerun_because(HOST_STALLS)
def test_follows_a_trajectory_and_tells_reference_and_error(bench, controller):
    bench.send([0.4], 1.0)
    bench.wait(lambda: abs(bench.position - 0.4) < 0.02, "the joint at 0.4 rad")
    bench.wait(
        lambda: bench.references and abs(bench.references[-1].position[0] - 0.4) < 1e-6,
        "the reference at 0.4 rad",
    )
    assert list(bench.references[-1].name) == ["elbow"]
    bench.wait(lambda: abs(bench.errors[-1].position[0]) < 0.02, "a small error")


@pytest.mark.rerun_because(HOST_STALLS)
def test_follows_a_stream_and_holds_when_it_ends(bench, controller):
    for _ in range(60):
        bench.stream.publish(JointState(name=["elbow"], position=[0.2]))
        time.sleep(0.02)
    bench.wait(lambda: abs(bench.position - 0.2) < 0.02, "the joint at 0.2 rad")
    bench.wait(
        lambda: any(
            value.key == "following" and value.value == "hold"
            for value in bench.health["pam_controller: elbow"].values
        ),
        "hold after the stream",
    )
    assert bench.position == pytest.approx(0.2, abs=0.03)


@pytest.mark.rerun_because(HOST_STALLS)
def test_stiffness_is_asked_for_and_delivered(bench, controller):
    bench.stiffness.publish(Float64MultiArray(data=[20.0]))

    def shown(key: str) -> float:
        status = bench.health["pam_controller: elbow"]
        return float(next(value.value for value in status.values if value.key == key))

    bench.wait(lambda: shown("stiffness now [N m/rad]") == pytest.approx(20.0, abs=0.1), "20")
    assert shown("least stiffness [N m/rad]") < 20.0 < shown("greatest stiffness [N m/rad]")
    assert shown("phase margin [rad]") > math.radians(30.0)


BAD_MESSAGES = [
    (lambda b: b.send([math.nan], 1.0), "positions of elbow is nan"),
    (lambda b: b.send([2.0], 1.0), "outside its position_limits"),
    (lambda b: b.send([0.1], 1.0, "knee"), "unknown joint 'knee'"),
    (lambda b: b.stream.publish(JointState(name=["elbow"])), "1 names, 0 positions"),
    (
        lambda b: b.stream.publish(JointState(name=["elbow"], position=[math.inf])),
        "elbow at inf rad",
    ),
    (
        lambda b: b.stiffness.publish(Float64MultiArray(data=[1.0, 2.0])),
        "2 values for 1 joints",
    ),
    (lambda b: b.stiffness.publish(Float64MultiArray(data=[-3.0])), "elbow at -3.0 N m/rad"),
]


@pytest.mark.sampled(
    "one bad message for each topic; the words of each are held where it is checked",
    alike=lambda send, said: send.__code__.co_names[0],
)
@pytest.mark.rerun_because(HOST_STALLS)
@pytest.mark.parametrize(("send", "said"), BAD_MESSAGES)
def test_a_bad_message_moves_nothing_and_is_named(bench, controller, send, said):
    before = bench.references[-1].position[0]
    send(bench)
    bench.wait(lambda: said in bench.health["pam_controller: commands"].message, said)
    assert bench.health["pam_controller: commands"].level == b"\x01"
    assert bench.references[-1].position[0] == pytest.approx(before, abs=1e-6)
    assert controller.poll() is None


def test_parameters_have_text_unit_and_range(bench, controller):
    request = DescribeParameters.Request(names=["pressure_loop.rate_limit"])
    service = "pam_controller/describe_parameters"
    described = bench.call(DescribeParameters, service, request).descriptors[0]
    assert "[Pa/s]" in described.description
    assert described.floating_point_range[0].from_value > 0.0


def test_a_gain_that_breaks_the_margins_is_taken_back_while_running(bench, controller):
    """It is answered at once, and told when the check has ended; a stop is answered meanwhile."""
    bench.wait(bench.controls, "control")
    before, asked = len(bench.commands), time.monotonic()
    result = bench.set_parameter("gains.elbow.derivative", 8.0)
    assert result.successful
    assert "being designed" in result.reason
    assert bench.call(Trigger, "pam_controller/stop", Trigger.Request()).success

    def told():
        values = bench.health["pam_controller: loop"].values
        return next(value.value for value in values if value.key == "last change refused")

    bench.wait(lambda: "not safe" in told(), "the refusal")
    cycles = 500.0 * (time.monotonic() - asked)
    assert len(bench.commands) - before > 0.2 * cycles  # it controls on while it checks
    assert "phase margin" in told()
    request = GetParameters.Request(names=["gains.elbow.derivative"])
    value = bench.call(GetParameters, "pam_controller/get_parameters", request).values[0]
    assert value.double_value == -1.0
    assert bench.set_parameter("gains.elbow.proportional", 5.0).successful
    bench.wait(lambda: told() == "none", "the new gain")
    assert not bench.set_parameter("stiffness.rate_limit", -0.5).successful
    assert not bench.set_parameter("elbow.inertia", 0.1).successful


def test_falls_silent_on_stale_measurements_and_takes_over_again(bench, controller):
    bench.measuring = False
    bench.wait(lambda: bench.health["pam_controller: loop"].level == b"\x03", "stale")
    bench.wait_until_silent()
    count = len(bench.commands)
    assert "ms old" in bench.health["pam_controller: loop"].message
    bench.measuring = True
    bench.wait(lambda: len(bench.commands) > count, "commands again")


def test_falls_silent_while_a_position_is_not_a_number(bench, controller):
    bench.position_of_nan = True
    bench.wait(
        lambda: "elbow is not available" in bench.health["pam_controller: loop"].message, "NaN"
    )
    bench.wait_until_silent()
    count = len(bench.commands)
    bench.position_of_nan = False
    bench.wait(lambda: len(bench.commands) > count, "commands again")


@pytest.mark.sampled("one of the two signals, which one function answers", cases=1)
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_ends_cleanly_when_told_to(domain, bench, sent):
    process = subprocess.Popen(
        command(ELBOW), env=environment(domain), stderr=subprocess.PIPE, text=True
    )
    seen = []
    listener = threading.Thread(target=lambda: seen.extend(process.stderr))
    listener.start()
    try:
        bench.wait(lambda: any("proportional" in line for line in list(seen)), "a start")
        time.sleep(0.5)
        process.send_signal(sent)
        assert process.wait(PATIENCE) == 0, seen
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        listener.join(5.0)
    assert not [line for line in seen if "Traceback" in line or "Error" in line]


@pytest.mark.long("test_kept_designs holds what is designed and read, and what the report says")
def test_says_that_gains_are_designed_and_how_long_it_took(domain, tmp_path):
    """The first start designs normal and soft gains, the next one reads both; both say so."""
    said = []
    for _ in range(2):
        process = subprocess.Popen(
            command(ELBOW),
            env={**environment(domain), "XDG_CACHE_HOME": str(tmp_path)},
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            heard = []
            for line in process.stderr:
                heard.append(line)
                if "gains took" in line:
                    break
            said.append("".join(heard))
        finally:
            process.stderr.close()
            end(process)
    assert all(f"designing the gains of elbow; designs of earlier starts are in {tmp_path}" in text
               for text in said)  # fmt: skip
    assert re.search(r"designing the gains .*gains took \d+\.\d s: 4 designed", said[0], re.DOTALL)
    assert re.search(r"gains took \d+\.\d s: 0 designed, 4 read from an earlier start", said[1])


@pytest.mark.rerun_because(HOST_STALLS)
def test_after_a_vent_it_takes_over_where_the_joint_is(bench, controller):
    """A reference from before a vent, or sent during it, must not move the joint afterwards."""
    bench.measuring, bench.position_of_nan = True, False
    bench.activate()
    bench.vent("a call of ~/vent")
    bench.wait_until_silent()
    count = len(bench.commands)
    bench.send([-0.5], 0.1)
    said = "the driver is vented"
    bench.wait(lambda: said in bench.health["pam_controller: commands"].message, "the refusal")
    assert len(bench.commands) == count
    bench.references.clear()
    bench.say("ready")
    bench.wait(lambda: len(bench.commands) > count + 50, "commands again")
    assert abs(bench.references[0].position[0] - bench.position) < 0.1
    assert all(
        abs(r.position[0] - bench.references[0].position[0]) < 1e-3 for r in bench.references
    )


@pytest.mark.rerun_because(HOST_STALLS)
def test_a_new_activation_takes_over_where_the_joint_is_although_no_vent_was_heard(
    bench, controller
):
    """Someone else, such as a recording, may have said that the driver is active all the time."""
    bench.measuring, bench.position_of_nan = True, False
    bench.activate(1)
    bench.send([-0.5], 1.0)
    bench.wait(lambda: bench.references[-1].position[0] == pytest.approx(-0.5, abs=1e-9), "start")
    bench.send([0.5], 20.0)
    bench.wait(lambda: bench.references[-1].velocity[0] > 0.02, "a motion")
    bench.references.clear()
    bench.say("active", "at reduced speed", activation=1)
    bench.wait(lambda: len(bench.references) > 50, "the motion goes on")
    assert bench.references[-1].velocity[0] > 0.02
    bench.say("active", activation=2)
    bench.wait(lambda: bench.references[-1].velocity[0] == 0.0, "the takeover")
    assert bench.references[-1].position[0] < 0.4
    assert abs(bench.references[-1].position[0] - bench.position) < 0.1


@pytest.mark.rerun_because(HOST_STALLS)
def test_stop_brakes_and_holds(bench, controller):
    bench.wait(bench.controls, "control")
    bench.send([-0.3], 1.0)
    bench.wait(lambda: abs(bench.references[-1].position[0] + 0.3) < 1e-3, "the start")
    bench.send([0.6], 6.0)
    bench.wait(lambda: bench.references[-1].velocity[0] > 0.1, "a motion")
    answer = bench.call(Trigger, "pam_controller/stop", Trigger.Request())
    assert answer.success
    bench.wait(lambda: bench.references[-1].velocity[0] == 0.0, "the stop")
    held = bench.references[-1].position[0]
    time.sleep(0.5)
    assert bench.references[-1].position[0] == pytest.approx(held, abs=1e-6)
    assert held < 0.55


@pytest.mark.rerun_because(HOST_STALLS)
def test_a_joint_that_rests_is_moved_a_little_when_its_stiffness_is_to_be_tested(bench, controller):
    bench.wait(bench.controls, "control")
    bench.wait(lambda: bench.references[-1].velocity[0] == 0.0, "rest")
    place = bench.references[-1].position[0]
    bench.references.clear()
    assert bench.set_parameter("stiffness_test.amplitude", 0.05).successful

    def ways():
        return [abs(each.position[0] - place) for each in list(bench.references)]

    try:
        bench.wait(lambda: max(ways(), default=0.0) > 0.04, "the test motion")
    finally:
        bench.set_parameter("stiffness_test.amplitude", 0.0)
    assert bench.call(Trigger, "pam_controller/stop", Trigger.Request()).success
    bench.wait(lambda: bench.references[-1].velocity[0] == 0.0, "its end")
    assert max(ways()) < 0.06


def test_a_rig_file_is_saved_on_request_alone_and_says_why_not(bench, controller):
    bench.wait(bench.controls, "control")
    answer = bench.call(Trigger, "pam_controller/save_adapted_rig", Trigger.Request())
    assert not answer.success
    assert "set the parameter adaptation.rig_file" in answer.message


def test_lowering_ends_in_a_vent_by_the_driver_and_silence(bench, controller):
    vents = []

    def vent(_, response):
        vents.append(time.monotonic())
        return response

    bench.node.create_service(Trigger, "pam_driver/vent", vent)
    bench.wait(bench.controls, "control")
    answer = bench.call(Trigger, "pam_controller/lower", Trigger.Request())
    assert answer.success
    assert "lowering" in answer.message
    bench.send([0.5], 1.0)
    said = "the joints are being lowered"
    bench.wait(lambda: said in bench.health["pam_controller: commands"].message, "a refusal")
    bench.wait(lambda: vents, "the vent")
    loop = "pam_controller: loop"
    bench.wait(lambda: "lowered as asked for" in bench.health[loop].message, "the reason")
    bench.wait_until_silent()
    assert not bench.call(Trigger, "pam_controller/stop", Trigger.Request()).success
