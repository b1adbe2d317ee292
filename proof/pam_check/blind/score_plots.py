"""Pictures of the score of a blind check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from pam_check.blind.effect_cases import KNOWN, OUTSIDE

QUESTIONS = {
    "reliability": "most probable explanation is exactly what is hidden",
    "reliability_of_causes": "named cause is hidden",
}


def draw_confusion(pairs: list[tuple[str, str]], path: Path) -> None:
    """Plot the confusion matrix of single effects: true effect in rows, first name in columns."""
    truths = ["none", *KNOWN, *OUTSIDE]
    answers = ["none", *KNOWN, "unknown", "not_identifiable", "crash"]
    counts = np.zeros((len(truths), len(answers)), dtype=int)
    for truth, answer in pairs:
        counts[truths.index(truth), answers.index(answer)] += 1
    figure, axis = plt.subplots(figsize=(11, 11), layout="constrained")
    axis.imshow(counts > 0, cmap="Blues", vmin=0, vmax=2)
    for i, j in zip(*np.nonzero(counts), strict=True):
        axis.text(float(j), float(i), str(counts[i, j]), ha="center", va="center")
    axis.set_xticks(range(len(answers)), answers, rotation=90)
    axis.set_yticks(range(len(truths)), truths)
    axis.set_xlabel("first effect named in the answer")
    axis.set_ylabel("hidden effect (at the bottom: effects outside the diagnosis's table)")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_reliability(result: Mapping[str, Any], path: Path) -> None:
    """Plot how often answers are right over the probability that they state.

    Parameters
    ----------
    result : mapping
        With the tables of `score.reliability` and `score.reliability_of_causes`.
    path : Path
        Of the picture.
    """
    figure, axis = plt.subplots(figsize=(6, 6), layout="constrained")
    axis.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linestyle="--", label="stated as it is")
    below, above = ((6, -14), "left"), ((-6, 8), "right")
    for (key, label), (shift, side) in zip(QUESTIONS.items(), (below, above), strict=True):
        rows: Sequence[Mapping[str, Any]] = [row for row in result[key] if row["right"]["of"]]
        stated = np.array([row["stated_mean"] for row in rows])
        right = np.array([row["right"]["value"] for row in rows])
        ends = np.array([row["right"]["interval"] for row in rows]).reshape(-1, 2).T
        reach = np.abs(ends - right)
        axis.errorbar(stated, right, yerr=reach, marker="o", capsize=4, label=label)
        for row, x, y in zip(rows, stated, right, strict=True):
            text = f"{row['right']['hits']} of {row['right']['of']}"
            axis.annotate(
                text, (x, y), xytext=shift, textcoords="offset points", ha=side, fontsize=8
            )
    axis.set_xlim(0.0, 1.12)
    axis.set_ylim(-0.08, 1.08)  # room for the counts
    axis.set_xlabel("stated probability, mean of each class")
    axis.set_ylabel("share that is right, with its 90 % interval")
    figure.legend(loc="outside lower center", fontsize=9)
    figure.savefig(path, dpi=110)
    plt.close(figure)
