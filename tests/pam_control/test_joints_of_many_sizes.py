"""A joint of any size, from a finger to a knee, is driven well with the controller's defaults."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pam_control.controller import Controller
from pam_control.controller_parameters import parameter_table, settings_from
from pam_control.declared import sized
from pam_control.joint_models import PRESSURE_SHARE, JointModels
from pam_control.joint_scale import JointScale
from pam_control.laws.impedance import Impedance
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.errors import PamError
from pam_model.identify.size import size_joint, sized_rig
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose

PRESSURE = 5e5  # Pa
# torque [N m], length of the muscles [m], inertia [kg m^2]
SIZES = [
    (0.1, 0.08, 2e-5),
    (1.0, 0.12, 1e-3),
    (5.0, 0.25, 0.02),
    (30.0, 0.3, 0.3),
    (300.0, 0.6, 6.0),
]


def rig_of(folder, torque: float, length: float, inertia: float) -> Rig:
    path = folder / "rig.yaml"
    size = size_joint(torque, 1.0, 3.0, PRESSURE, length, PRESSURE + 1e5)
    path.write_text(sized_rig(size, 1.0, PRESSURE, inertia).text(), encoding="utf-8")
    return load_rig(path)


@pytest.mark.sampled("two of the five sizes", cases=2)
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]:g} N m")
def test_a_sized_joint_fills_and_tracks_below_the_pressure_at_which_the_driver_vents(
    tmp_path, closed_loop, size
):
    """With levels of an elbow, small joints were filled to `max_pressure`, and were vented."""
    controller = Controller(rig_of(tmp_path, *size), ControlSettings())
    loop = closed_loop(controller)
    filled = loop.run(2.0)
    goal = TrajectoryPoint(1.0, (0.5,), (0.0,), (0.0,))
    controller.references.follow(["joint"], [goal], start=None, now=loop.time)
    moved = loop.run(2.0)
    highest = max(part.column(column).max() for part in (filled, moved) for column in (3, 4))
    assert highest < 0.7 * PRESSURE
    assert moved.rms(2.0) < 1e-3
    wanted = controller.stiffness_commands[0]
    assert moved.column(7)[-1] == pytest.approx(wanted, rel=0.05)


def test_a_stiffness_out_of_reach_leaves_room_for_overshoot_below_max_pressure(
    tmp_path, closed_loop
):
    """A request that cannot be met must not end in a vent for too much pressure."""
    rig = rig_of(tmp_path, *SIZES[2])
    controller = Controller(rig, ControlSettings(default_stiffness=1e3))
    filled = closed_loop(controller).run(3.0)
    highest = max(filled.column(column).max() for column in (3, 4))
    assert PRESSURE * (PRESSURE_SHARE - 0.01) < highest < PRESSURE


def scale_of(rig) -> JointScale:
    robot = compose(rig)
    return JointModels.of(robot, robot.joints[0], 5e3).scale


def test_each_joint_of_a_rig_has_the_levels_of_its_own_size(tmp_path):
    rig = rig_of(tmp_path, *SIZES[2])
    wide = replace(rig.joints[0], pulley_radius=1.5 * rig.joints[0].pulley_radius)
    small = scale_of(rig)
    big = scale_of(rig.with_joint(wide))
    settings = ControlSettings(observer_limit=1.5)
    of_small, of_big = small.complete(settings), big.complete(settings)
    assert of_big.default_stiffness > 2.0 * of_small.default_stiffness
    assert of_big.adaptation_limit > 1.2 * of_small.adaptation_limit
    assert of_small.observer_limit == of_big.observer_limit == 1.5
    assert min(of_small.stiffness_grid) < of_small.default_stiffness < max(of_small.stiffness_grid)


def test_the_elbow_of_config_keeps_the_levels_it_was_tuned_with(rig):
    scale = scale_of(rig)
    settings = scale.complete(ControlSettings())
    assert settings.default_stiffness == pytest.approx(14.0, rel=0.02)
    assert settings.stiffness_grid == pytest.approx((6.0, 12.0, 20.0), rel=0.02)
    assert settings.integral_limit == pytest.approx(10.0, rel=0.02)
    assert sized(Impedance(), scale, settings).damping == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"stiffness.default": 0.0}, "stiffness.default = 0: must be at least 0.01, or -1"),
        ({"adaptation.limit": -0.5}, "adaptation.limit = -0.5: must be at least 0, or -1"),
        ({"design.least_stiffness": 3.0}, "both must be given in N m/rad, or both be -1"),
    ],
)
def test_values_between_minus_one_and_the_least_are_refused(changes, said):
    values = {parameter.name: parameter.default for parameter in parameter_table(("elbow",))}
    with pytest.raises(PamError, match=said):
        settings_from({**values, **changes}, ("elbow",))
