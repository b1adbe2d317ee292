"""The picture of `rough-rig`: angle and error of each law, a clean and a rough rig side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pam_check.control.closed_loop import PERIOD
from pam_gap.answer.page_style import PLOT_LOOK

ASKED: Final = "#1d2433"
COLOURS: Final = ("#8e5bb5", "#d9822b", "#1f5fbf", "#1a7f4b")
LOOK: Final[Any] = PLOT_LOOK | {"lines.linewidth": 1.4}  # matplotlib's type lists every key


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """How one law played the arm's motion.

    Attributes
    ----------
    name : str
        Of the law.
    position, reference : (n,) array
        True and asked angle [rad], every `PERIOD` of the motion.
    stopped : str
        Why the controller stopped; empty if it did not.
    """

    name: str
    position: npt.NDArray[np.float64]
    reference: npt.NDArray[np.float64]
    stopped: str = ""

    @property
    def error(self) -> npt.NDArray[np.float64]:
        """Asked minus true angle [rad]."""
        return self.reference - self.position

    @property
    def rms(self) -> float:
        """Of the error [rad]; infinite if the controller stopped."""
        return float("inf") if self.stopped else float(np.sqrt(np.mean(self.error**2)))


def draw(path: Path, rigs: Mapping[str, Sequence[Way]]) -> None:
    """Draw the laws of every rig, by the rig's name, in one column each.

    Parameters
    ----------
    path : Path
        PNG file to write.
    rigs : mapping of str to sequence of Way
        At least one way for each rig; the same law has the same colour in all columns.
    """
    names = list(dict.fromkeys(way.name for ways in rigs.values() for way in ways))
    colours = dict(zip(names, COLOURS, strict=False))
    with mpl.rc_context(LOOK):
        # no larger, so that its words can be read where a phone shows it 360 pixels wide
        figure = Figure(figsize=(8.6, 5.6), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(
            2, len(rigs), sharex=True, sharey="row", squeeze=False, height_ratios=(2, 3)
        )
        for (words, ways), angle, error in zip(rigs.items(), *axes, strict=True):
            for way in ways:
                times = PERIOD * np.arange(way.position.size)
                angle.plot(times, way.position, color=colours[way.name])
                rms = f"{1e3 * way.rms:.2f} mrad RMS"
                label = f"{way.name}: {f'stopped ({way.stopped})' if way.stopped else rms}"
                error.plot(times, 1e3 * way.error, color=colours[way.name], label=label)
            angle.plot(times, ways[0].reference, "--", color=ASKED, label="reference")
            angle.set_title(words, loc="left", fontweight="bold")
            angle.legend(loc="lower left")
            error.legend(
                loc="upper left", bbox_to_anchor=(-0.04, -0.2), fontsize="small", handlelength=1.0
            )
            error.set_xlabel("time [s]")
        axes[0, 0].set_ylabel("true angle [rad]")
        axes[1, 0].set_ylabel("error of the true angle [mrad]")
        figure.savefig(path, dpi=150, bbox_inches="tight")
