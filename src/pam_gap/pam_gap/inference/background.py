"""What an ordinary background leaves: the discrepancy of a good rig.

No rig is exact. A good one has a little thread friction, creep, dry friction, leakage and play of
the spools, friction that builds up in another way, and sensors that are not quite linear and drift.
None of that is a cause. Its size in each channel is predicted: a plant with an ordinary amount of
each is simulated along the recording, what re-tuning absorbs is removed, and the mean squares are
added. It plays the part of the model discrepancy in history matching: V_noise + V_discrepancy
(Gardner, Lord and Barthorpe, Mech. Syst. Signal Process. 143, 2020; Kennedy and O'Hagan, J. R.
Statist. Soc. B 63, 2001).
"""

from __future__ import annotations

import numpy as np

from pam_gap.inference.candidates import ordinary_sizes, rig_scales
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.prediction.channel_order import BOTH_FORCES, BOTH_PRESSURES, POSITION
from pam_gap.prediction.fit import Array, Scaling, mean_squares, normal_equations
from pam_model.plant.layout import MUSCLES
from pam_model.plant.parameters import INDEX


def discrepancy(fitter: HypothesisFitter, nominal: Hypothesis) -> Array:
    """Mean squared whitened error that an ordinary background leaves, shape (channels,).

    Parameters
    ----------
    fitter : HypothesisFitter
        Rig, recordings and nuisance parameters.
    nominal : Hypothesis
        The re-tuned plant without effects.
    """
    problem, rules = fitter.problem, fitter.rules.decision
    vector = fitter.vector((), nominal.result.values)
    changed = []
    for path, size in ordinary_sizes(problem.rig, problem.rig.joints[problem.joint]):
        changed.append(vector.copy())
        changed[-1][INDEX[path]] += rules.ordinary_share * size
    for side in MUSCLES:
        changed.append(vector.copy())
        changed[-1][INDEX[f"{side}.hysteresis.presliding_length"]] *= rules.ordinary_presliding
    base = problem.errors(vector[None])[0]
    left = np.zeros(base.shape[1])
    for errors in problem.errors(np.array(changed)):
        left += mean_squares(_not_absorbed(fitter, nominal, errors - base), problem.counted)
    return np.where(problem.present, left + _sensors(fitter), 0.0)


def _not_absorbed(fitter: HypothesisFitter, nominal: Hypothesis, change: Array) -> Array:
    """The change of the errors that re-tuning the nuisance parameters does not remove."""
    jacobian = nominal.result.jacobian
    if jacobian.shape[-1] == 0:
        return change
    problem = fitter.problem
    free, _, _ = fitter.problem_parts(())
    weights = 1.0 / np.maximum(nominal.mean_square, fitter.floor)
    hessian, slope = normal_equations(change, jacobian, problem.counted, weights)
    hessian += np.diag(Scaling(free).weight ** 2 + 1e-9 * np.max(np.diag(hessian)) + 1e-12)
    left: Array = change - jacobian @ np.linalg.solve(hessian, slope)
    return left


def _sensors(fitter: HypothesisFitter) -> Array:
    """Mean squared whitened error of ordinary sensors beside their white noise."""
    problem, rules = fitter.problem, fitter.rules.decision
    rig = problem.rig
    size = np.zeros(problem.present.size)
    gauge = rig.supply_pressure - rig.gas.ambient_pressure
    size[BOTH_PRESSURES] = rules.ordinary_pressure * gauge
    size[POSITION] = rules.ordinary_position
    size[BOTH_FORCES] = rules.ordinary_force * rig_scales(rig, rig.joints[problem.joint]).force
    deviation = np.sqrt(np.mean([data.block_deviation**2 for data in problem.data], axis=0))
    result: Array = np.nan_to_num((size / deviation) ** 2)
    return result
