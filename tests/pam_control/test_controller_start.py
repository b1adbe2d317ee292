"""A controller that cannot start says why and ends; it keeps no time, so others may run beside."""

from __future__ import annotations

import subprocess

import pytest

pytest.importorskip("rclpy")

from pam_demo.chain import private_domain

from .controller_bench import ELBOW, PATIENCE, command, environment

DOMAIN = int(private_domain()["ROS_DOMAIN_ID"])
BAD_STARTS = [
    ({"elbow.inertia": -0.05}, "inertia"),
    ({"elbow.colour": 1.0}, "colour"),
    (
        {"law": "magic"},
        "law = 'magic': must be model_based, pressure_ratio_pid, ",
    ),
    ({"loop.rate": 5.0}, "loop.rate"),
    ({"gains.elbow.derivative": 8.0}, "not safe"),
    ({"gains.wrist.derivative": 1.0}, "gains"),
    ({"loop.command_delay": 0.1, "gains.elbow.proportional": 40.0}, "elbow"),
    ({"design.least_stiffness": 30.0, "design.greatest_stiffness": 20.0}, "must not be above"),
    ({"design.least_stiffness": 30.0}, "both must be given"),
]


@pytest.mark.sampled("two bad starts; the words of each are held where it is checked", cases=2)
@pytest.mark.parametrize(("parameters", "said"), BAD_STARTS)
def test_refuses_a_bad_start_in_plain_words(parameters, said):
    ended = subprocess.run(
        command(ELBOW, parameters=parameters),
        env=environment(DOMAIN),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert ended.returncode != 0
    assert "Traceback" not in ended.stderr
    assert said in ended.stderr


def test_refuses_to_start_without_a_rig():
    ended = subprocess.run(
        command(),
        env=environment(DOMAIN),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert ended.returncode != 0
    assert "no rig" in ended.stderr
    assert "Traceback" not in ended.stderr
