"""The improved rig file can be read again, re-tuned nominal parameters included."""

from pathlib import Path

import numpy as np
import pytest

from pam_gap.answer.improved_rig import improve_rig
from pam_gap.inference.candidates import candidates_for, nuisances_for
from pam_gap.inference.hypothesis import Hypothesis
from pam_gap.prediction.fit import PlantFit
from pam_model.plant.constants import derive_constants
from pam_model.plant.parameters import INDEX, PlantParameters
from pam_model.rig import load_rig, save_rig

ELBOW = load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml")


def test_every_parameter_a_fit_moves_arrives(tmp_path: Path) -> None:
    """The rig has every fitted value; written and read again, it is the same plant."""
    joint = ELBOW.joints[0]
    nuisances = nuisances_for(ELBOW, joint)
    before = PlantParameters.from_rig(ELBOW).values
    for candidate in candidates_for(ELBOW, joint):
        free = len(nuisances) + len(candidate.free)
        values = np.concatenate([np.linspace(0.985, 1.015, len(nuisances)), candidate.starts[0]])
        result = PlantFit(values, np.zeros((0, 5)), 0.0, np.zeros((0, 5, free)), 0)
        targets = [nuisance.targets for nuisance in nuisances] + list(candidate.targets)
        factors = [True] * len(nuisances) + [False] * len(candidate.free)
        hypothesis = Hypothesis((candidate,), result, np.ones(5))
        improved = improve_rig(ELBOW, 0, hypothesis, targets, factors)
        after = PlantParameters.from_rig(improved).values
        save_rig(improved, tmp_path / "rig.yaml")
        read = PlantParameters.from_rig(load_rig(tmp_path / "rig.yaml")).values
        assert derive_constants(read) == pytest.approx(derive_constants(after), rel=1e-9)
        for group, factor, value in zip(targets, factors, values.tolist(), strict=True):
            for name in group:
                wanted = before[INDEX[name]] * value if factor else value
                assert abs(after[INDEX[name]] - wanted) <= 1e-6 * abs(wanted), (
                    candidate.label,
                    name,
                )
