"""The answer in one line: cause, size and share of the error, in the units of the user."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pam_gap.answer.diagnosis import Diagnosis, FoundParameter
from pam_gap.answer.headline import headline, marginals
from pam_gap.inference.confidence import Interval
from pam_gap.prediction.materiality import GapSize

POSITION = "joint_states.elbow.position"
SIZE = GapSize(POSITION, "rad", "joint", 0.7, 0.031, 0.025, 0.002, 1e-4, 7e-4, 2.1e-3)


def found(value: float, unit: str) -> FoundParameter:
    return FoundParameter(Interval(value, 0.9 * value, 1.1 * value), unit)


FRICTION = {"torque": found(0.52, "N m"), "presliding_angle": found(0.001, "rad")}
NAMED = Diagnosis(
    "named", "joint", ("coulomb_friction",), (), (), {"coulomb_friction": FRICTION}, {},
    None, "", sizes=(SIZE,),
)  # fmt: skip
OVERLAPS = {"overlap.agonist": found(0.05, "-"), "overlap.antagonist": found(0.06, "-")}


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({}, f"Coulomb friction (torque 0.52 N m): 94 % of an error of 31 mrad at {POSITION}"),
        (
            {"effects": ("valve_dead_zone", "coulomb_friction"),
             "parameters": {"valve_dead_zone": OVERLAPS, "coulomb_friction": FRICTION}},
            "Valve dead zone (overlap 0.05 and 0.06) and Coulomb friction (torque 0.52 N m): 94 % "
            f"of an error of 31 mrad at {POSITION}",
        ),
        (
            {"verdict": "ambiguous", "effects": ("coulomb_friction", "hysteresis"),
             "indistinguishable": (("coulomb_friction", "hysteresis"),)},
            f"Coulomb friction or hysteresis: 94 % of an error of 31 mrad at {POSITION}",
        ),
        (
            {"at_the_end": ("end_caps",)},
            f"Coulomb friction (torque 0.52 N m): 94 % of an error of 31 mrad at {POSITION}; end "
            "caps, at the end of the range searched, might explain as much",
        ),
        (
            {"verdict": "unknown", "effects": (), "looks_like": "an eccentricity of the encoder"},
            f"No known effect explains 25 mrad at {POSITION}, 3.6 % of its range; it looks like an "
            "eccentricity of the encoder",
        ),
        (
            {"verdict": "none", "effects": ()},
            f"The re-tuned rig file is right to 25 mrad at {POSITION}, 3.6 % of its range",
        ),
        (
            {"verdict": "not_identifiable", "effects": (), "sizes": ()},
            "The recording does not hold enough for a diagnosis",
        ),
    ],
)  # fmt: skip
def test_each_verdict_has_a_line(changes: dict[str, object], line: str) -> None:
    assert headline(replace(NAMED, **changes)) == line


def test_a_size_of_one_side_is_told_with_the_side() -> None:
    offset = {"offset.agonist": found(0.02, "-")}
    one = replace(
        NAMED, effects=("valve_null_offset",), parameters={"valve_null_offset": offset}, sizes=()
    )
    assert headline(one) == "Valve null offset (offset of the agonist 0.02)"


def test_marginals_are_sums_over_all_sets_with_a_cause() -> None:
    sets = {"a + b": 0.5, "a": 0.3, "unknown": 0.15, "none": 0.048, "c": 0.002}
    assert marginals(sets) == [("a", 0.8), ("b", 0.5), ("unknown", 0.15), ("none", 0.048)]
