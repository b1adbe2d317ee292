"""The disturbance observer: what it finds, what it compensates, and that it stays stable."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.controller_topics import ControllerTopics
from pam_control.feedback.disturbance_observer import begin_observer, observed_loss
from pam_control.feedback.margins import ControlDesignError
from pam_control.plan_memory import Rings, measure, value_at
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.rows.plan_rows import N_PLAN, P_MEASURED
from pam_control.settings import ControlSettings

SETTLE = 2.0
ALONE = ControlSettings(adaptation=False)  # what is learnt would take the observer's share
PAYLOAD = {"payload.mass": 0.5, "payload.distance": 0.2}


def observing(rig, **settings):
    return Controller(rig, ALONE.replace(observer=True, **settings))


def plain(rig):
    return Controller(rig, ALONE)


def tracked(closed_loop, controller, motion, **options):
    """RMS error [rad] over the motion."""
    points, duration = motion
    loop = closed_loop(controller, **options)
    loop.run(SETTLE)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    return loop.run(duration + 0.2).rms(SETTLE)


@pytest.mark.sampled("one of the three torques", cases=1)
@pytest.mark.parametrize(
    "hidden",
    [PAYLOAD, {"coulomb_friction.torque": 0.5}, {"viscous_friction.extra": 0.3}],
    ids=str,
)
def test_hidden_torques_cost_less_with_the_observer(closed_loop, rig, reaching, hidden):
    without = tracked(closed_loop, plain(rig), reaching, effects=hidden)
    observed = tracked(closed_loop, observing(rig), reaching, effects=hidden)
    assert observed < 0.75 * without


def test_a_payload_is_reported_as_its_torque(closed_loop, rig):
    controller = observing(rig)
    loop = closed_loop(controller, effects=PAYLOAD)
    loop.run(SETTLE)
    points = [TrajectoryPoint(1.0, [0.6], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(3.0)
    found = controller.channels[0].telemetry.disturbance
    assert found == pytest.approx(-0.5 * 9.81 * 0.2 * math.sin(0.6), rel=0.1)


def test_a_rig_as_written_has_hardly_any_disturbance(closed_loop, rig, reaching):
    controller = observing(rig)
    points, duration = reaching
    loop = closed_loop(controller)
    loop.run(SETTLE)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    found = []
    loop.run(duration, lambda _: found.append(controller.channels[0].telemetry.disturbance))
    assert np.std(found) < 0.1


@pytest.mark.parametrize("way", ["measurement_delay", "command_delay"])
def test_an_unknown_delay_within_the_design_does_not_make_it_oscillate(
    closed_loop, rig, reaching, way
):
    controller = observing(rig)
    late = {way: getattr(ControlSettings(), way) + 0.01}
    assert tracked(closed_loop, controller, reaching, **late) < 0.05
    assert (controller.guard.softened, controller.guard.stopped) == ("", "")


def test_the_output_is_limited(closed_loop, rig):
    controller = observing(rig, observer_limit=0.2)
    loop = closed_loop(controller, effects=PAYLOAD)
    found = []
    loop.run(1.0, lambda _: found.append(controller.channels[0].telemetry.disturbance))
    controller.references.stream(["elbow"], [0.5], now=loop.time)
    loop.run(0.5, lambda _: found.append(controller.channels[0].telemetry.disturbance))
    assert np.nanmax(np.abs(found)) <= 0.2


def test_switching_it_while_a_load_is_held_does_not_move_the_joint(closed_loop, rig):
    controller = observing(rig)
    loop = closed_loop(controller, effects=PAYLOAD)
    loop.run(SETTLE)
    points = [TrajectoryPoint(1.0, [0.5], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(3.0)
    before = loop.run(0.2).column(2).mean()
    controller.change(ALONE.replace(observer=False))
    assert math.isclose(loop.run(1.5).column(2).mean(), before, abs_tol=2e-3)
    controller.change(ALONE.replace(observer=True))
    assert np.abs(loop.run(1.5).column(2) - before).max() < 0.03


def test_more_unknown_delay_means_a_slower_observer(rig):
    fast, slow = (
        observing(rig, extra_delay=delay).settings.gains["elbow"].at(14.0).observer
        for delay in (2e-3, 0.03)
    )
    assert 0.0 < slow < fast


def test_gains_that_an_unknown_delay_makes_unstable_are_refused(rig):
    with pytest.raises(ControlDesignError, match=r"observer of 20 rad/s.*20 ms"):
        observing(
            rig,
            extra_delay=0.02,
            observer_bandwidth=20.0,
            partial_gains={"elbow": {"proportional": 12.0}},
        )


def test_a_delay_of_the_position_that_is_known_is_no_disturbance():
    """Compared at one time, a fast motion shows nothing; compared as they arrive, it would."""
    inertia, damping, delay, step = 0.05, 0.25, 0.02, 0.002

    def found(known: float) -> float:
        state, pressures, seen = [0.0] * N_PLAN, Rings(1, P_MEASURED + 1), []
        begin_observer(state, 0.0, 0.0)
        for cycle in range(1000):
            now = cycle * step
            torque = inertia * -36.0 * math.sin(6.0 * now) + damping * 6.0 * math.cos(6.0 * now)
            measure(pressures.rows[0], pressures.ends[0], now, [[torque]], 0, 0.1)
            speed = 6.0 * math.cos(6.0 * (now - delay))
            muscles = value_at(pressures.rows[0], pressures.ends[0], now - known, P_MEASURED, 1.0)
            seen.append(
                observed_loss(
                    state, step, muscles, 0.0, speed, inertia, damping, 0.0, 40.0, 1e-6, 5.0
                )
            )
        return float(np.std(seen[500:]))

    assert found(delay) < 0.1 * found(0.0)


def test_the_node_publishes_the_disturbance_of_the_joints_that_have_an_observer(rig):
    serialization = pytest.importorskip("rclpy.serialization")
    messages = pytest.importorskip("sensor_msgs.msg")
    sent = {}

    def create_publisher(_, topic, __):
        return SimpleNamespace(
            publish=lambda message: sent.__setitem__(topic, message),
            get_subscription_count=lambda: 1,
        )

    node = SimpleNamespace(create_publisher=create_publisher, get_fully_qualified_name=lambda: "/c")
    topics = ControllerTopics(node, rig, 1)
    rest = SimpleNamespace(position=0.0, velocity=0.0)
    quiet = SimpleNamespace(reference=rest, torque=0.0, error=0.0, disturbance=math.nan)
    topics.publish(1_000, SimpleNamespace(telemetry=[quiet]))
    assert "~/disturbance" not in sent
    observed = SimpleNamespace(**{**vars(quiet), "disturbance": -1.5})
    topics.publish(2_000, SimpleNamespace(telemetry=[observed]))
    said = serialization.deserialize_message(sent["~/disturbance"], messages.JointState)
    assert list(said.name) == ["elbow"]
    assert list(said.effort) == [-1.5]
