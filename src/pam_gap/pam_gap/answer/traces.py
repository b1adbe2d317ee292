"""The traces of a recording as interactive figures: zoom, move, hide single curves.

They are drawn by Bokeh, whose script stands in the page itself, so that the page needs no network.
Bokeh is optional: without it a page has its numbers and tables, and says what is missing.
All figures share one time axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_gap.answer.user_units import user_unit
from pam_ros.missing_packages import what_to_install

Array = npt.NDArray[np.float64]

MEASURED, NOMINAL, IMPROVED, CLOSEST = "#8a8a8a", "#c2410c", "#00798c", "#6b46c1"
BAND = "#d9d9d9"
MAX_POINTS = 4000
"""A longer curve is thinned; the extremes of each bin are kept."""
MOST_POINTS = 110_000
"""Of all curves of a page together, so that it stays below 3 MB."""
WRITTEN, RETUNED, WITH_ANSWER = "rig file as written", "rig file re-tuned", "improved rig file"
_TOOLS = "xpan,xbox_zoom,xwheel_zoom,reset"
_HEIGHT = 160
"""Of a figure without axes and legend [pixels]: as much as its tools need next to it."""


def short_name(name: str) -> str:
    """The name of a rig file in a legend, which has to fit on a phone: "as written", "improved"."""
    return name.replace("rig file", "").strip()


@dataclass(frozen=True)
class Trace:
    """One channel as measured and as predicted, at the same times."""

    channel: str
    unit: str
    time: Array
    measured: Array
    nominal: Array
    improved: Array | None = None
    improved_name: str = WITH_ANSWER
    """What the improved prediction is: the improved rig file, or the rig file re-tuned."""
    closest: Array | None = None
    """Prediction with the effects that come closest, where none explains the gap."""
    closest_name: str = ""
    """The effects that come closest."""
    limit: float = 0.0
    """Error below which a gap does not matter, in the channel's unit; 0 for none."""

    def curves(self) -> list[tuple[str, Array, str]]:
        """The predictions with their short names and colours."""
        found = [(short_name(WRITTEN), self.nominal, NOMINAL)]
        if self.improved is not None:
            found.append((short_name(self.improved_name), self.improved, IMPROVED))
        if self.closest is not None:
            found.append(("closest", self.closest, CLOSEST))
        return found


@dataclass(frozen=True, slots=True)
class Drawn:
    """Interactive figures as parts of a page."""

    script: str  # what the page needs in its head and at its end, as HTML
    parts: tuple[str, ...]  # one HTML element for each figure


NO_FIGURES = Drawn("", ())


def thinned(time: Array, values: Array, points: int = MAX_POINTS) -> tuple[Array, Array]:
    """Keep the smallest and largest value of each bin, so that no peak is lost.

    Parameters
    ----------
    time, values : (n,) ndarray
        A trace.
    points : int
        Largest number of values that are kept.
    """
    if time.size <= points:
        return time, values
    edges = np.linspace(0, time.size, points // 2 + 1).astype(np.intp)
    filled = np.where(np.isfinite(values), values, 0.0)
    picks: list[int] = []
    for start, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        part = filled[start:end]
        picks += sorted((start + int(part.argmin()), start + int(part.argmax())))
    return time[picks], values[picks]


def _size_of(values: Array) -> float:
    return float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0


def _single(values: Array) -> npt.NDArray[np.float32]:
    return values.astype(np.float32)


def time_range(start: float, end: float) -> Any:
    """An axis of time [s] that figures of a page share."""
    from bokeh.models import Range1d  # noqa: PLC0415  (optional)

    return Range1d(start, end, bounds="auto")


def time_figure(label: str, shared: Any, title: str = "") -> Any:
    """An empty figure over the time that several figures share."""
    from bokeh.plotting import figure  # noqa: PLC0415  (optional)

    made: Any = figure(
        frame_height=_HEIGHT, sizing_mode="stretch_width", x_range=shared, tools=_TOOLS,
        active_drag="xbox_zoom", output_backend="canvas", x_axis_label="time [s]",
        y_axis_label=label, min_width=280, title=title or None,
    )  # fmt: skip
    made.toolbar.logo = None
    made.xgrid.grid_line_color = made.ygrid.grid_line_color = "#e6e6e6"
    made.yaxis.ticker.desired_num_ticks = 5
    made.axis.axis_label_text_font_style = "normal"
    made.axis.major_label_text_font_size = made.axis.axis_label_text_font_size = "10pt"
    return made


def embedded(figures: Sequence[Any]) -> Drawn:
    """Figures of Bokeh as parts of a page."""
    from bokeh.embed import components  # noqa: PLC0415  (optional)
    from bokeh.resources import Resources  # noqa: PLC0415

    script, parts = components(tuple(figures))
    library = Resources(mode="inline", components=["bokeh"])
    return Drawn(f"{library.render_js()}\n{script}", tuple(parts))


def drawn_or_reason(draw_all: Callable[[], Drawn]) -> tuple[Drawn, str]:
    """Figures, and an empty reason; without Bokeh no figures, and what to install."""
    try:
        return draw_all(), ""
    except ModuleNotFoundError as error:
        reason = what_to_install(error)
        if reason is None:
            raise
        return NO_FIGURES, reason


class _Page:
    """Draws the figures of one page with a common time axis and a common number of points."""

    def __init__(self, traces: Sequence[Trace]) -> None:
        curves = sum(1 + 2 * len(trace.curves()) for trace in traces)
        self.points = max(min(MAX_POINTS, MOST_POINTS // max(curves, 1)), 500)
        ends = [t for trace in traces for t in (trace.time[0], trace.time[-1])]
        self.range: Any = time_range(min(ends), max(ends))

    def _line(self, place: Any, time: Array, values: Array, **look: Any) -> None:
        x, y = thinned(time, values, self.points)
        place.line(_single(x), _single(y), **look)

    @staticmethod
    def _legend(place: Any) -> None:
        place.add_layout(place.legend[0], "below")
        place.legend.orientation = "horizontal"
        place.legend.ncols = 2
        place.legend.click_policy = "hide"
        place.legend.label_text_font_size = "10pt"
        place.legend.border_line_color = None

    def errors(self, trace: Trace) -> Any:
        """The error of each prediction of a channel."""
        left = [(name, values - trace.measured, colour) for name, values, colour in trace.curves()]
        unit, scale = user_unit(max(_size_of(error) for _, error, _ in left), trace.unit)
        made = time_figure(f"error [{unit}]", self.range)
        if trace.limit > 0.0:
            from bokeh.models import BoxAnnotation  # noqa: PLC0415  (optional)

            reach = scale * trace.limit
            made.add_layout(
                BoxAnnotation(bottom=-reach, top=reach, fill_color=BAND, fill_alpha=0.6)
            )
        for name, error, colour in left:
            self._line(
                made, trace.time, scale * error, color=colour, line_width=1.3, legend_label=name
            )
        self._legend(made)
        return made

    def values(self, trace: Trace) -> Any:
        """A channel as measured, wide and light, and its predictions above it."""
        unit, scale = user_unit(_size_of(trace.measured), trace.unit)
        made = time_figure(f"[{unit}]", self.range)
        self._line(
            made, trace.time, scale * trace.measured, color=MEASURED, line_width=4.0,
            legend_label="measured",
        )  # fmt: skip
        for place, (name, values, colour) in enumerate(trace.curves()):
            self._line(
                made, trace.time, scale * values, color=colour, line_width=1.3,
                line_dash="dashed" if place else "solid", legend_label=name,
            )  # fmt: skip
        self._legend(made)
        return made


def draw(traces: Sequence[Trace], first: Trace | None = None) -> Drawn:
    """Draw the error of one channel, if it is wanted, then values and errors of all channels.

    Parameters
    ----------
    traces : sequence of Trace
        All channels; at least one.
    first : Trace, optional
        The channel whose error is the first figure.

    Returns
    -------
    Drawn
        Its parts: the error of `first`, if it is given; then, for each channel, its values and its
        error. Each part needs its place on the page: without one of them, none is drawn.

    Raises
    ------
    ModuleNotFoundError
        Without Bokeh.
    """
    page = _Page(traces)
    figures = [] if first is None else [page.errors(first)]
    for trace in traces:
        figures += [page.values(trace), page.errors(trace)]
    return embedded(figures)
