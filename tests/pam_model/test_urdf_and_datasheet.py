"""The URDF has the rig's dynamics, and a data sheet's numbers give that muscle."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from pam_model.__main__ import main
from pam_model.command_line import DONE, MISTAKE
from pam_model.muscle_sizes import SIZES
from pam_model.muscles.braid import ThinCylinder, braid_diameter, thread_angle
from pam_model.rig import load_rig, rig_from_parameters
from pam_model.rig.from_datasheet import BraidFromDatasheet
from pam_model.rig.types import Rig
from pam_model.robot import compose
from pam_model.views.equivalent_rod import STANDARD_GRAVITY
from pam_model.views.urdf import robot_as_urdf
from support.rigs import ELBOW


def about_y(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def numbers(element: ET.Element | None, name: str) -> np.ndarray:
    assert element is not None
    return np.array([float(part) for part in element.get(name, "").split()])


def link_of(rig: Rig) -> ET.Element:
    link = ET.fromstring(robot_as_urdf(compose(rig), "arm")).find("link[@name='elbow_link']")
    assert link is not None
    return link


@pytest.mark.parametrize("gravity_torque", [4.9, 0.3, -2.0])
@pytest.mark.parametrize("gravity_angle", [0.0, 0.7, -1.9])
def test_the_link_has_the_joints_gravity_torque_at_every_angle(
    gravity_torque: float, gravity_angle: float
) -> None:
    """Rigid-body mechanics of the URDF's link, which know nothing of the rig file."""
    rig = load_rig(ELBOW)
    joint = replace(rig.joints[0], gravity_torque=gravity_torque, gravity_angle=gravity_angle)
    inertial = link_of(rig.with_joint(joint)).find("inertial")
    assert inertial is not None
    centre = numbers(inertial.find("origin"), "xyz")
    mass = float(numbers(inertial.find("mass"), "value")[0])
    for position in np.linspace(-3.0, 3.0, 7):
        at = about_y(position) @ centre
        torque = np.cross(at, [0.0, 0.0, -mass * STANDARD_GRAVITY])[1]
        expected = -gravity_torque * math.sin(position - gravity_angle)
        assert torque == pytest.approx(expected, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("gravity_torque", [4.9, 0.0, -2.0])
def test_the_link_has_the_joints_inertia_about_its_axis(gravity_torque: float) -> None:
    rig = load_rig(ELBOW)
    joint = replace(rig.joints[0], gravity_torque=gravity_torque, gravity_angle=0.4)
    inertial = link_of(rig.with_joint(joint)).find("inertial")
    assert inertial is not None
    distance = float(np.linalg.norm(numbers(inertial.find("origin"), "xyz")))
    mass = float(numbers(inertial.find("mass"), "value")[0])
    own = float(numbers(inertial.find("inertia"), "iyy")[0])
    assert own + mass * distance**2 == pytest.approx(joint.inertia, rel=1e-6)


def test_every_joint_of_the_rig_has_its_limits() -> None:
    rig = load_rig(ELBOW.with_name("two_joints.yaml"))
    document = ET.fromstring(robot_as_urdf(compose(rig), "arm"))
    found = {joint.get("name"): joint.find("limit") for joint in document.iter("joint")}
    assert list(found) == list(rig.joint_names)
    for joint in rig.joints:
        limit = found[joint.name]
        assert numbers(limit, "lower")[0] == pytest.approx(joint.position_limits[0])
        assert numbers(limit, "upper")[0] == pytest.approx(joint.position_limits[1])
        assert numbers(limit, "velocity")[0] == pytest.approx(joint.max_velocity)
        assert numbers(limit, "effort")[0] > abs(joint.gravity_torque)


@pytest.mark.parametrize("angle", [15.0, 23.0, 40.0])
def test_the_data_sheets_numbers_come_back_from_the_braid(angle: float) -> None:
    made = BraidFromDatasheet.measured(20e-3, 0.3, math.radians(angle))
    assert braid_diameter(made.thread_length, made.turns, 0.3) == pytest.approx(20e-3)
    assert math.degrees(thread_angle(made.thread_length, 0.3)) == pytest.approx(angle)
    # Chou and Hannaford's form, with the diameter and the angle in place of b and n
    cosine = math.cos(math.radians(angle))
    area = 0.25 * math.pi * (20e-3) ** 2 / (1.0 - cosine**2)
    assert made.force_per_pressure == pytest.approx(area * (3.0 * cosine**2 - 1.0))


def test_at_the_largest_contraction_the_pull_is_gone() -> None:
    made = BraidFromDatasheet.measured(20e-3, 0.3, math.radians(23.0))
    short = made.rest_length * (1.0 - made.largest_contraction)
    braid = ThinCylinder(made.thread_length, made.turns)
    assert braid.coefficients(short)[0] == pytest.approx(0.0, abs=1e-12)


def test_a_braid_that_would_extend_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["braid", "--diameter", "0.02", "--length", "0.3", "--angle", "60"])
    assert code == MISTAKE
    assert "54.74 deg" in capsys.readouterr().err


def test_the_printed_section_is_read_as_a_muscle(capsys: pytest.CaptureFixture[str]) -> None:
    import yaml

    code = main(
        ["braid", "--diameter", "0.02", "--length", "0.3", "--angle", "23", "--name", "biceps"]
    )
    assert code == DONE
    section = yaml.safe_load(capsys.readouterr().out)["biceps"]
    keys = yaml.safe_load(ELBOW.read_text())["/**"]["ros__parameters"]
    keys["elbow_flexor"] |= section | {"neutral_length": 0.28}
    muscle = rig_from_parameters(keys).muscle("elbow_flexor")
    assert muscle.rest_length == pytest.approx(0.3)
    assert muscle.thread_length == pytest.approx(0.3 / math.cos(math.radians(23.0)), rel=1e-5)


@pytest.mark.parametrize("name", sorted(SIZES))
def test_a_bought_size_has_its_published_force_as_an_ideal_braid(name: str) -> None:
    """The force of the muscle model, which does not share the formula for the angle."""
    size = SIZES[name]
    made = BraidFromDatasheet.of_force(size.diameter, 0.3, size.force, size.pressure)
    assert made.force_per_pressure * size.pressure == pytest.approx(size.force, rel=1e-9)
    assert braid_diameter(made.thread_length, made.turns, 0.3) == pytest.approx(size.diameter)
    assert made.largest_contraction > size.contraction


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--size", "DMSP-20", "--angle", "23"], "state the same numbers: expected --rest-length"),
        (["--diameter", "0.02"], "--angle missing: expected --rest-length"),
        (["--diameter", "0.02", "--turns", "2"], "--diameter and --angle, --thread-length"),
        (["--thread-length", "0.31"], "--turns and --rest-length [m] must be given together"),
        (["--size", "DMSP-30"], "DMSP-30"),
    ],
)
def test_a_size_and_its_numbers_exclude_each_other(words, says, capsys) -> None:
    assert main(["braid", "--length", "0.3", *words]) == MISTAKE
    assert says in capsys.readouterr().err


def test_the_command_prints_the_section_of_a_bought_size(capsys) -> None:
    assert main(["braid", "--size", "DMSP-20", "--length", "30cm"]) == DONE
    printed = capsys.readouterr().out
    assert "1500 N at 6 bar" in printed
    assert "pulls 250 N per bar" in printed
