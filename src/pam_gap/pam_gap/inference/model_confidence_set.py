"""The Model Confidence Set: the models that the data do not distinguish from the best one.

Starting from all models, the hypothesis that the remaining ones are equally good is tested by the
range statistic T_R = max |t_ij|, where t_ij is the mean difference of the losses of models i and j
over its standard deviation. Where the test rejects, the model with the largest t_ij is eliminated,
and the rest is tested again. The p-value of a model is the largest p-value of all tests up to its
own elimination; the set holds every model whose p-value exceeds the size of the test.

Standard deviations and the distribution of T_R come from one circular block bootstrap (Politis and
Romano 1992), which keeps the correlation of neighbouring losses, and which all tests share.

Source: Hansen, Lunde and Nason, The Model Confidence Set, Econometrica 79 (2011) 453-497,
sections 2.1 (algorithm and p-values) and 3.1.2 (range statistic).
"""

from __future__ import annotations

import numpy as np

from pam_gap.prediction.fit import Array


def circular_blocks(count: int, length: int, generator: np.random.Generator) -> np.ndarray:
    """Indices of one circular block bootstrap sample.

    Parameters
    ----------
    count : int
        Number of observations in time order, and of indices returned.
    length : int
        Number of consecutive observations that are drawn together; a block that reaches the end
        continues at the beginning.
    generator : numpy.random.Generator
        Draws the starts of the blocks.

    Returns
    -------
    ndarray of int, shape (count,)
    """
    starts = generator.integers(count, size=-(-count // length))
    sample: np.ndarray = ((starts[:, None] + np.arange(length)) % count).ravel()[:count]
    return sample


def mcs_p_values(losses: Array, *, block_length: int, draws: int, seed: int = 0) -> Array:
    """P-value of each model for its membership in the Model Confidence Set.

    Parameters
    ----------
    losses : ndarray, shape (observations, models)
        Loss of each model at each observation, in time order; any unit that all models share.
    block_length : int
        Observations that the bootstrap draws together; at least the correlation time of the losses.
    draws : int
        Number of bootstrap samples.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    ndarray, shape (models,)
        A model belongs to the set of size a when its p-value exceeds a; the best one has 1. Models
        with equal losses count as equally good.

    Raises
    ------
    ValueError
        When a loss is not finite, or there are no models or fewer than two observations.
    """
    observations, models = losses.shape
    if models < 1 or observations < 2 or not np.isfinite(losses).all():
        raise ValueError(
            f"expected finite losses of at least one model at two observations or more, got "
            f"{np.count_nonzero(~np.isfinite(losses))} not finite in shape {losses.shape}"
        )
    generator = np.random.default_rng(seed)
    mean = losses.mean(axis=0)
    sampled = np.empty((draws, models))
    for draw in range(draws):
        sampled[draw] = losses[circular_blocks(observations, block_length, generator)].mean(axis=0)
    difference = mean[:, None] - mean[None, :]
    spread = (sampled - mean)[:, :, None] - (sampled - mean)[:, None, :]
    deviation = np.sqrt(np.mean(spread**2, axis=0))
    # Differences of the size of rounding errors count as zero: the models are equally good.
    rounding = 1e-12 * (np.abs(losses).mean() + 1e-300)
    deviation = np.maximum(deviation, rounding)
    difference = np.where(np.abs(difference) > rounding, difference, 0.0)
    statistic = difference / deviation
    simulated = np.abs(spread) / deviation
    p_values = np.ones(models)
    left = list(range(models))
    largest = 0.0
    while len(left) > 1:
        among = np.ix_(left, left)
        observed = float(statistic[among].max())
        range_drawn = simulated[:, left][:, :, left].max(axis=(1, 2))
        # If no model is worse than another, the hypothesis of equal models is not rejected.
        p_value = float(np.mean(range_drawn > observed)) if observed > 0.0 else 1.0
        largest = max(largest, p_value)
        worst = left[int(np.argmax(statistic[among].max(axis=1)))]
        p_values[worst] = largest
        left.remove(worst)
    return p_values
