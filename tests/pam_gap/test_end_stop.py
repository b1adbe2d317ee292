"""A stop at one end of the motion is found, and is no effect of the muscles."""

import numpy as np
import pytest

import pam_gap
from pam_gap.prediction.end_stop import end_stop
from pam_gap.prediction.problem import PredictionProblem
from pam_model.rig import Rig

from .conftest import Maker

POSITION = "joint_states.elbow.position"


def reach(record: Maker) -> tuple[float, float]:
    low, high = np.quantile(record().values[POSITION], [0.02, 0.98])
    return float(low), float(high)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stop_is_found_at_its_end_and_angle(rig: Rig, record: Maker, sign: float) -> None:
    low, high = reach(record)
    begins = 0.5 * (low + high) + sign * 0.25 * (high - low)

    def pushed(angle: float) -> float:
        return -sign * 30.0 * max(sign * (angle - begins), 0.0)

    stop = end_stop(PredictionProblem(rig, 0, [record(pushed=pushed)]))
    assert stop is not None
    assert stop.sign == sign
    assert stop.begins == pytest.approx(begins, abs=0.15 * (high - low))
    assert stop.stiffness == pytest.approx(30.0, rel=0.5)
    assert stop.torque(np.array([begins - sign, begins + sign])) @ [0.0, 1.0] * sign < 0.0
    assert ("upper" in stop.name) == (sign > 0.0)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"agonist.bladder_elasticity.linear": 8e3, "antagonist.bladder_elasticity.linear": 8e3},
        {"coulomb_friction.torque": 0.8},
        {"payload.mass": 1.0, "payload.distance": 0.25},
    ],
)
def test_effects_of_the_table_are_no_stop(
    rig: Rig, record: Maker, changes: dict[str, float]
) -> None:
    assert end_stop(PredictionProblem(rig, 0, [record(changes)])) is None


@pytest.mark.long("a whole search; the stop itself is found by the tests above")
def test_a_stop_is_unknown_and_said_to_look_like_one(rig: Rig, record: Maker) -> None:
    """Bladder elasticity and an offset of the encoder were named for it."""
    low, high = reach(record)
    begins = 0.5 * (low + high) + 0.25 * (high - low)
    recording = record(duration=26.0, pushed=lambda angle: -30.0 * max(angle - begins, 0.0))
    (answer,) = pam_gap.diagnose(recording, rig, threads=1)
    assert answer.verdict == "unknown"
    assert "end stop" in answer.looks_like
    assert "upper end" in answer.sentence
