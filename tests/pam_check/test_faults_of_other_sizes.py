"""Faults of joints that are smaller, stronger or at another pressure than the elbow of config/."""

from __future__ import annotations

import dataclasses
import random

import pytest

from pam_check.faults.campaign import in_a_fork, make_chain
from pam_check.faults.rig_bounds import bounds_of
from pam_check.faults.trial import draw_values, run_trial
from pam_driver.safety.states import SafetyState
from pam_model.errors import PamError
from pam_model.identify.size import size_joint, sized_rig
from pam_model.rig import Rig, load_rig
from pam_sim.faults.size_of_faults import ranges_on
from support.fault_kinds import kind_called

# torque [N m], length of the muscles [m], inertia [kg m^2], damping [N m s/rad], pressure [Pa]
RIGS = {
    "1 N m": (1.0, 0.12, 0.004, 0.02, 5e5),
    "30 N m": (30.0, 0.3, 0.12, 0.6, 5e5),
    "2 bar": (1.5, 0.25, 0.02, 0.1, 2e5),
}
# out of bounds on one of these rigs at least, with the levels of the elbow
KINDS = (
    "measurement_gaps_with_valve_stuck_shut",
    "valve_stuck_shut",
    "muscle_burst",
    "muscle_leak",
    "muscle_leak_small",
    "pressure_too_high",
    "vent_called",
)


LARGER = pytest.mark.long("one rig of another size than the elbow stands for three")


@pytest.fixture(
    scope="module",
    params=["1 N m", *(pytest.param(name, marks=LARGER) for name in RIGS if name != "1 N m")],
)
def sized(request, tmp_path_factory) -> Rig:
    torque, length, inertia, damping, pressure = RIGS[request.param]
    path = tmp_path_factory.mktemp("rig") / "rig.yaml"
    size = size_joint(torque, 1.0, 3.0, pressure, length)
    path.write_text(sized_rig(size, 1.0, pressure, inertia).text(), encoding="utf-8")
    rig = load_rig(path)
    return rig.with_joint(dataclasses.replace(rig.joints[0], viscous_friction=damping))


@pytest.fixture(scope="module")
def chain(sized):
    return make_chain(sized)


@pytest.mark.sampled("one of two draws of each kind")
@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("name", KINDS)
def test_a_fault_is_noticed_and_ends_as_promised(chain, name, number):
    kind = kind_called(name)
    draw = random.Random(f"{name} {number}")
    values = draw_values(kind, draw, chain.rig)
    trial = in_a_fork(lambda: run_trial(chain, kind, values, draw.randrange(1 << 30)))
    assert trial.problem == "", values


def test_a_healthy_joint_moves_without_suspicion(chain):
    def look() -> tuple[SafetyState, list[str]]:
        seen: set[str] = set()
        for _ in range(4000):
            chain.step()
            seen |= {str(one) for one in chain.driver.suspicions}
        return chain.driver.state, sorted(seen)

    assert in_a_fork(look) == (SafetyState.ACTIVE, [])


def test_a_joint_differs_from_its_file_as_far_as_the_safety_page_says_without_a_stop(chain):
    """Valves with 5 % overlap, and muscles that lose 8 % of it by hysteresis."""

    def look() -> SafetyState:
        chain.power_cycle({"valve_dead_zone.overlap": 0.05, "hysteresis.amplitude": 0.08})
        chain.wait(4.0)
        return chain.driver.state

    assert in_a_fork(look) is SafetyState.ACTIVE


def test_the_sizes_of_faults_follow_the_valve_the_pressure_and_the_torque(rig, sized):
    """On the elbow they are as the tables say; what bursts a muscle is no leak of a larger one."""
    for name in ("muscle_burst", "muscle_leak", "pressure_noisy", "brake_engages_in_motion"):
        kind = kind_called(name)
        for parameter, (low, high) in kind.parameters.items():
            found = ranges_on(name, kind.parameters, rig)[parameter]
            assert found == pytest.approx((low, high), rel=1e-3)
    valve = sized.muscles[0].valve.sonic_conductance
    burst, high, sags = (
        ranges_on(name, kind_called(name).parameters, sized)
        for name in ("muscle_burst", "pressure_too_high", "supply_sags")
    )
    assert burst["conductance"][0] == pytest.approx(valve)
    assert high["shown"][0] > sized.muscles[0].max_pressure
    assert sags == kind_called("supply_sags").parameters


def test_a_valve_that_nothing_shuts_may_fill_its_muscle_up_to_the_supply(rig):
    higher = dataclasses.replace(rig, supply_pressure=rig.supply_pressure + 1e5)
    bounds, before = bounds_of(higher), bounds_of(rig)
    assert bounds.pressure == before.pressure == before.filled_pressure
    assert bounds.filled_pressure == before.pressure + 1e5
    assert bounds.filled_force > bounds.force == before.force


def test_only_a_joint_with_a_weight_can_be_thrown_up(rig):
    level = rig.with_joint(dataclasses.replace(rig.joints[0], gravity_torque=0.0))
    assert (bounds_of(rig).heavy, bounds_of(level).heavy) == (True, False)


def test_a_joint_that_does_not_reach_the_angles_of_the_campaign_is_refused(rig):
    """Its references would be refused, and the faults would meet a joint at rest."""
    narrow = rig.with_joint(dataclasses.replace(rig.joints[0], position_limits=(-0.1, 0.1)))
    with pytest.raises(PamError, match=r"elbow.position_limits = \[-0.1, 0.1\] rad: .* need"):
        make_chain(narrow)
