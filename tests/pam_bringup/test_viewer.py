"""The viewer shows what the messages say, in names, units and words."""

from __future__ import annotations

import math
import signal
import socket
import subprocess
import sys
from pathlib import Path
from time import sleep
from types import SimpleNamespace

import numpy as np
import pytest

from pam_bringup.security.policy import NODES, rights_of
from pam_bringup.viewer import rerun_sink
from pam_bringup.viewer.arm_drawing import arm_strokes, eye_of, pressure_colour
from pam_bringup.viewer.robot_view import GAP_WINDOW, TOPICS, RobotView
from pam_model.errors import PamError
from pam_model.robot import compose

ELBOW = Path(__file__).parents[2] / "config/elbow.yaml"


class KeptSink:
    """Keeps what the view shows."""

    def __init__(self) -> None:
        self.numbers: dict[str, list[tuple[float, float]]] = {}
        self.texts: list[str] = []
        self.strokes: list = []

    def number(self, path, time, value):
        self.numbers.setdefault(path, []).append((time, value))

    def text(self, path, time, markdown):
        self.texts.append(markdown)

    def lines(self, time, strokes):
        self.strokes = list(strokes)


@pytest.fixture
def sink() -> KeptSink:
    return KeptSink()


def states(names, position=(), effort=()):
    return SimpleNamespace(name=names, position=list(position), effort=list(effort))


def test_every_shown_topic_is_one_that_a_node_publishes_or_hears(rig):
    kinds = ("publish", "subscribe")
    known = {name for node in NODES for kind in kinds for name in rights_of(node, rig)[kind]}
    for topic in TOPICS:
        assert topic in known or f"/{topic}" in known, topic


def test_numbers_are_shown_by_name_and_in_the_unit_of_the_title(rig, sink):
    view = RobotView(rig, sink)
    joint, (agonist, antagonist) = rig.joint_names[0], rig.joints[0].muscles
    view.take("joint_states", 1.0, states(["another", joint], [9.0, 0.25]))
    view.take("pressure_states", 1.0, states([agonist, antagonist], effort=[2e5, 1e5]))
    view.take("valve_commands", 1.0, states([agonist, antagonist], [0.5, -0.5]))
    view.take("pam_controller/reference", 1.0, states([joint], [0.3]))
    view.take("pam_controller/error", 1.0, states([joint], [0.05]))
    for topic, value in (("pam_controller/stiffness_commands", 12.0), ("joint_stiffness", 11.0)):
        view.take(topic, 1.0, SimpleNamespace(data=[value]))
    assert sink.numbers == {
        f"angle/{joint}/measured": [(1.0, 0.25)],
        f"angle/{joint}/reference": [(1.0, 0.3)],
        f"error/{joint}": [(1.0, pytest.approx(50.0))],
        f"pressure/{agonist}": [(1.0, pytest.approx(200.0))],
        f"pressure/{antagonist}": [(1.0, pytest.approx(100.0))],
        f"valve/{agonist}": [(1.0, 0.5)],
        f"valve/{antagonist}": [(1.0, -0.5)],
        f"stiffness/{joint}/asked": [(1.0, 12.0), (1.0, 12.0)],
        f"stiffness/{joint}/given": [(1.0, 11.0)],
    }


def test_the_stiffness_asked_for_holds_until_the_next_command(rig, sink):
    """From 14 to 8 N m/rad, the viewer drew a ramp of 15 s that nobody had asked for."""
    view = RobotView(rig, sink)
    for time in (1.0, 2.0, 3.0):
        if time != 2.0:
            asked = SimpleNamespace(data=[14.0 if time == 1.0 else 8.0])
            view.take("pam_controller/stiffness_commands", time, asked)
        view.take("joint_stiffness", time + 0.5, SimpleNamespace(data=[11.0]))
    shown = sink.numbers[f"stiffness/{rig.joint_names[0]}/asked"]
    assert shown == [(1.0, 14.0), (1.5, 14.0), (2.5, 14.0), (3.0, 8.0), (3.5, 8.0)]


def test_a_fast_topic_is_thinned_and_a_clock_set_back_does_not_stop_the_view(rig, sink):
    view = RobotView(rig, sink)
    joint = rig.joint_names[0]
    for tick in range(500):
        view.take("joint_states", 10.0 + 0.002 * tick, states([joint], [0.0]))
    shown = len(sink.numbers[f"angle/{joint}/measured"])
    assert 40 <= shown <= 51
    view.take("joint_states", 1.0, states([joint], [0.0]))
    assert len(sink.numbers[f"angle/{joint}/measured"]) == shown + 1


def test_state_and_faults_are_told_in_words_until_they_are_over(rig, sink):
    view = RobotView(rig, sink)
    value = SimpleNamespace(key="air", value="vented")
    view.take("pam_driver/state", 1.0, SimpleNamespace(message="latched: bus off", values=[value]))
    assert "latched: bus off" in sink.texts[-1]
    assert "air: vented" in sink.texts[-1]
    for level in (b"\x02", 2):  # rclpy gives bytes, rosbags a number
        fault = SimpleNamespace(name="pam_driver: bus", level=level, message="bus off")
        view.take("/diagnostics", 2.0, SimpleNamespace(status=[fault]))
        assert "error: pam_driver: bus: bus off" in sink.texts[-1]
        fault.level = b"\x00"
        view.take("/diagnostics", 3.0, SimpleNamespace(status=[fault]))
        assert "bus off" not in sink.texts[-1].partition("Warnings")[2]


def test_the_gap_is_shown_by_stage_once_the_window_is_full(rig, sink):
    view = RobotView(rig, sink)
    joint, muscles = rig.joint_names[0], list(rig.joints[0].muscles)
    for time in np.arange(100.0, 103.0 + GAP_WINDOW, 0.004):
        swing = 0.2 * math.sin(4.0 * time)
        view.take("valve_commands", time, states(muscles, [swing, -swing]))
        view.take("pressure_states", time, states(muscles, effort=[2e5 + 1e5 * swing, 2e5]))
        view.take("joint_states", time, states([joint], [swing]))
    gaps = {path: points for path, points in sink.numbers.items() if path.startswith("gap/")}
    assert {path.split("/")[1] for path in gaps} == {joint}
    assert {path.split("/")[2] for path in gaps} >= {"valve", "muscle and joint"}
    assert gaps[f"gap/{joint}/muscle and joint"][0][1] > 5.0, (
        "nothing here moves as the rig file says"
    )


def test_a_full_muscle_is_shorter_and_redder_on_the_side_to_which_the_joint_turns(rig):
    agonist, antagonist = rig.joints[0].muscles
    strokes = {s.name.split("/")[1]: s for s in arm_strokes(compose(rig), 0, 0.4, {agonist: 3e5})}
    lengths = {name: strokes[name].points[0][2] - strokes[name].points[1][2] for name in strokes}
    radius = rig.joints[0].pulley_radius
    assert lengths[agonist] == pytest.approx(rig.muscle(agonist).neutral_length - 0.4 * radius)
    assert lengths[antagonist] == pytest.approx(
        rig.muscle(antagonist).neutral_length + 0.4 * radius
    )
    assert strokes[agonist].colour[0] > strokes[antagonist].colour[0]
    assert strokes[antagonist].colour == pressure_colour(math.nan)


def test_the_eye_looks_at_the_middle_from_where_all_of_the_arm_is_in_view(rig):
    """Both ends of the arm were cut off."""
    eye, middle = eye_of(compose(rig))
    points = [point for stroke in arm_strokes(compose(rig), 0, 0.0, {}) for point in stroke.points]
    farthest = max(math.dist(point, middle) for point in points)
    assert farthest / math.dist(eye, middle) < math.tan(math.radians(25.0))


def test_without_the_viewer_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "rerun", None)
    with pytest.raises(PamError, match="pip install rerun-sdk"):
        rerun_sink.rerun()


def test_the_viewer_gets_the_curves_the_arm_and_the_words(rig, tmp_path):
    """Where the optional viewer is installed: a file of it holds all that was shown."""
    rr = pytest.importorskip("rerun", reason="rerun-sdk is optional")
    view_file = tmp_path / "shown.rrd"
    sink = rerun_sink.RerunSink()
    sink.save(view_file, rerun_sink.layout(rig, live=False, narrow=False))
    view = RobotView(rig, sink)
    for tick in range(100):
        view.take("joint_states", 100.0 + 0.1 * tick, states([rig.joint_names[0]], [0.1]))
    view.take("pam_driver/state", 105.0, SimpleNamespace(message="active", values=[]))
    sink.number("gap/elbow/muscle and joint", 105.0, 2.0)
    sink.finish()
    del sink, view
    assert rr.__version__
    content = view_file.read_bytes()
    for path in (b"/angle/elbow/measured", b"/arm/elbow/link", b"/driver", b"muscle-and-joint"):
        assert path in content, path


class Parts:
    """Stands in for the viewer's stream and keeps what each part holds."""

    def __init__(self):
        self.sent: list[tuple[str, str, list[float]]] = []

    def log(self, *_, **__):
        pass

    def flush(self):
        pass

    def send_columns(self, path, indexes, columns):
        (index,) = indexes
        kind = str(index.timeline_type() if hasattr(index, "timeline_type") else "")
        self.sent.append((path, kind, list(index.times)))


@pytest.mark.parametrize("live", [True, False])
def test_a_recording_is_handed_over_in_one_part_for_each_curve_curves_first(live, rig, monkeypatch):
    """In thousands of parts, the page showed the first seconds for a minute."""
    pytest.importorskip("rerun", reason="rerun-sdk is optional")
    sink = rerun_sink.RerunSink(live=live)
    monkeypatch.setattr(sink, "_stream", Parts())
    view = RobotView(rig, sink)
    for tick in range(100):
        now = 1000.0 + 0.1 * tick
        view.take("joint_states", now, states(rig.joint_names, [0.1]))
        view.take("pressure_states", now, states(rig.muscle_names, effort=[2e5, 2e5]))
        view.take("pam_driver/state", now, SimpleNamespace(message="active", values=[]))
    if not live:
        assert sink._stream.sent == []
    sink.finish()
    paths = [path for path, _, _ in sink._stream.sent]
    if live:
        assert paths.index("driver") < paths.index("pressure/elbow_flexor") or len(paths) > 100
        return
    assert len(paths) == len(set(paths))
    curves = [path for path in paths if path.startswith(("angle/", "pressure/"))]
    assert paths[: len(curves)] == curves
    assert paths[-1] == "driver"
    assert paths.count("arm/elbow/link") == 1


def listening(port: int) -> list[str]:
    """The local addresses on which this machine listens, as the kernel writes them."""
    rows = [
        row.split()
        for table in ("tcp", "tcp6")
        for row in Path(f"/proc/net/{table}").read_text().splitlines()[1:]
    ]
    addresses = [row[1].split(":") for row in rows if row[3] == "0A"]
    return [host for host, number in addresses if int(number, 16) == port]


def test_the_page_is_served_to_this_machine_alone(rig):
    """Whoever can open the page sees the robot."""
    pytest.importorskip("rerun", reason="rerun-sdk is optional")
    web, data = free_port(), free_port()
    sink = rerun_sink.RerunSink()
    address = sink.serve(
        web, data, rerun_sink.layout(rig, live=False, narrow=False), open_browser=False
    )
    assert address.startswith(f"http://127.0.0.1:{web}/")
    assert listening(web) == listening(data) == ["0100007F"]
    with pytest.raises(PamError, match=f"port {web} is in use"):
        rerun_sink.RerunSink().serve(web, data, None, open_browser=False)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_server_ends_with_the_viewer_and_nothing_is_complained_about(number):
    pytest.importorskip("rerun", reason="rerun-sdk is optional")
    web, data = free_port(), free_port()
    words = [sys.executable, "-m", "pam_bringup", "--rig", str(ELBOW), "--no-browser"]
    words += ["--web-port", str(web), "--data-port", str(data)]
    viewer = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert viewer.stdout
    assert viewer.stdout.readline().startswith("open in a browser: http://127.0.0.1")
    sleep(2.0)  # until it has subscribed
    viewer.send_signal(number)
    viewer.send_signal(number)
    _, errors = viewer.communicate(timeout=60.0)
    assert (viewer.returncode, errors) == (0, "")
    assert not listening(web)
    assert not listening(data)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
