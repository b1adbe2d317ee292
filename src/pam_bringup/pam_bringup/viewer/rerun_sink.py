"""The viewer of rerun-sdk: its layout, and how numbers, texts and lines get there.

rerun-sdk is optional, since it takes 500 MB of disk space. Its web page is part of the package
and works without a network.
"""

from __future__ import annotations

import atexit
import contextlib
import math
import os
import signal
import socket
import subprocess
import sys
import time as clock
import webbrowser
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pam_bringup.viewer.arm_drawing import Stroke, eye_of
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_model.robot import compose

HOST = "127.0.0.1"  # nobody else may see the robot
START_TIME = 30.0  # s; of the viewer's server
LIVE_SPAN = 20.0  # s, that the curves of a running robot show
HAND_OVER_EVERY = 0.1  # s, while a robot runs; single points would be slow for their headers
MOST_KEPT = 200_000  # numbers, lines and texts of a recording that are handed over together
TIME = "time"
"""The viewer's name for its axis of time."""
MEASURED, ASKED = (0, 121, 140), (138, 138, 138)
COLOURS = {"measured": MEASURED, "given": MEASURED, "reference": ASKED, "asked": ASKED}
"""Of the curves with these last names, so that the two of a pair cannot be taken for each other."""
CURVES = (
    ("angle", "Angle and reference [rad]"),
    ("error", "Tracking error [mrad]"),
    ("pressure", "Pressure [kPa gauge]"),
    ("valve", "Valve opening [-1 to 1]"),
    ("stiffness", "Stiffness asked and given [N m/rad]"),
    ("gap", "Gap by stage [times the noise]"),
)


def rerun() -> Any:
    """The module of the viewer.

    Raises
    ------
    PamError
        If it is not installed.
    """
    try:
        import rerun  # noqa: PLC0415  (optional)
    except ImportError:
        raise PamError(
            "the viewer needs rerun-sdk, which is not installed: pip install rerun-sdk"
        ) from None
    return rerun


def layout(rig: Rig, *, live: bool, narrow: bool) -> Any:
    """Arrangement of the views: side by side, or one at a time for a narrow screen."""
    rerun()
    import rerun.blueprint as rrb  # noqa: PLC0415  (optional)

    ranges = None
    if live:
        start = rrb.TimeRangeBoundary.cursor_relative(seconds=-LIVE_SPAN)
        end = rrb.TimeRangeBoundary.cursor_relative()
        ranges = [rrb.VisibleTimeRange(TIME, start=start, end=end)]
    curves = {
        name: rrb.TimeSeriesView(origin=f"/{name}", name=title, time_ranges=ranges)
        for name, title in CURVES
    }
    eye, target = eye_of(compose(rig))
    look = rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0))
    arm = rrb.Spatial3DView(origin="/arm", name="Arm and muscles", eye_controls=look)
    driver = rrb.TextDocumentView(origin="/driver", name="Driver and faults")
    views: Any
    if narrow:
        views = rrb.Vertical(
            rrb.Tabs(arm, driver, curves["gap"]),
            rrb.Tabs(*(view for name, view in curves.items() if name != "gap")),
        )
    else:
        # three plots above each other are so low that an axis has a single number
        views = rrb.Horizontal(
            rrb.Vertical(arm, driver, row_shares=[3, 2]),
            rrb.Vertical(curves["angle"], curves["error"]),
            rrb.Vertical(
                curves["pressure"], rrb.Tabs(curves["valve"], curves["stiffness"], curves["gap"])
            ),
        )
    return rrb.Blueprint(
        views,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="hidden" if narrow and live else "collapsed")
        if live
        # the curves show the whole recording, and the arm moves through it again and again
        else rrb.TimePanel(state="collapsed", timeline=TIME, play_state="playing", loop_mode="all"),
    )


def _wait_for_server(server: subprocess.Popen[bytes], ports: Sequence[int]) -> None:
    deadline = clock.monotonic() + START_TIME
    for port in ports:
        while True:
            if server.poll() is not None or clock.monotonic() > deadline:
                raise PamError(
                    f"the viewer's server did not start on the ports {ports[0]} and {ports[1]}"
                )
            with contextlib.suppress(OSError), socket.create_connection((HOST, port), 0.5):
                break
            clock.sleep(0.05)


def _end_server(server: subprocess.Popen[bytes]) -> None:
    """End the server and the program that it starts in turn."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(server.pid, signal.SIGTERM)
    server.wait()


class RerunSink:
    """Hands everything to the viewer's recording stream.

    A recording is handed over in a few large parts, curves first, so that its page shows all of it
    at once. Thousands of small parts keep a viewer busy for a minute.

    Parameters
    ----------
    live : bool, optional
        Times are times of day, and otherwise count from the first one, as on the report's axes.
    """

    def __init__(self, *, live: bool = False) -> None:
        self._live, self._first = live, math.nan
        self._rr = rerun()
        self._stream = self._rr.RecordingStream("pam_suite")
        self._points: dict[str, list[tuple[float, float]]] = defaultdict(list)
        self._strokes: dict[str, list[tuple[float, Stroke]]] = defaultdict(list)
        self._texts: dict[str, list[tuple[float, str]]] = defaultdict(list)
        self._kept = 0
        self._coloured: set[str] = set()
        self._handed_over = clock.monotonic()

    def serve(self, web_port: int, data_port: int, blueprint: Any, *, open_browser: bool) -> str:
        """Serve the page and its data to this machine alone; returns the address of the page.

        The server is the program of the viewer: that of the Python module listens to the network.

        Raises
        ------
        PamError
            If a port is in use, or the server does not start.
        """
        for port in (web_port, data_port):
            with contextlib.suppress(OSError), socket.create_connection((HOST, port), 0.5):
                raise PamError(f"port {port} is in use; choose --web-port and --data-port")
        words = [sys.executable, "-m", "rerun_cli", "--serve-web", "--bind", HOST]
        words += ["--port", str(data_port), "--web-viewer-port", str(web_port)]
        # otherwise the server itself opens a browser, with an address that shows no data
        quiet = {**os.environ, "BROWSER": "true"}
        server = subprocess.Popen(
            words,
            env=quiet,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C must not end it before its last points are sent
        )
        atexit.register(_end_server, server)
        _wait_for_server(server, (web_port, data_port))
        address = f"rerun+http://{HOST}:{data_port}/proxy"
        self._stream.connect_grpc(address, default_blueprint=blueprint)
        page = f"http://{HOST}:{web_port}/?url={address.replace('+', '%2B')}"
        if open_browser:
            webbrowser.open(page)
        return page

    def save(self, path: Path, blueprint: Any) -> None:
        """Write to a file of the viewer instead of a page."""
        self._stream.save(path, default_blueprint=blueprint)

    def finish(self) -> None:
        """Hand over what is still on its way."""
        self._hand_over()
        self._stream.flush()

    def _hand_over(self) -> None:
        """Give the viewer all that was kept since the last time, each entity in one part."""
        rr = self._rr
        for path, points in self._points.items():
            colour = COLOURS.get(path.rpartition("/")[2])
            if colour and path not in self._coloured:
                self._coloured.add(path)
                look = rr.SeriesLines(colors=[colour])
                self._stream.log(path.replace(" ", "-"), look, static=True)
            times, values = zip(*points, strict=True)
            self._send(path.replace(" ", "-"), times, rr.Scalars.columns(scalars=values))
        for name, drawn in self._strokes.items():
            times, strokes = zip(*drawn, strict=True)
            lines = rr.LineStrips3D.columns(
                strips=[stroke.points for stroke in strokes],
                radii=[stroke.radius for stroke in strokes],
                colors=[stroke.colour for stroke in strokes],
            )
            self._send(f"arm/{name}", times, lines)
        for path, told in self._texts.items():
            times, texts = zip(*told, strict=True)
            kinds = ["text/markdown"] * len(texts)
            self._send(path, times, rr.TextDocument.columns(text=texts, media_type=kinds))
        for kept in (self._points, self._strokes, self._texts):
            kept.clear()
        self._kept = 0
        self._handed_over = clock.monotonic()

    def _send(self, path: str, times: Sequence[float], columns: Any) -> None:
        moments: dict[str, Sequence[float]] = (
            {"timestamp": times}
            if self._live
            else {"duration": [time - self._first for time in times]}
        )
        index = self._rr.TimeColumn(TIME, **moments)
        self._stream.send_columns(path, indexes=[index], columns=columns)

    def _keep(self, time: float, count: int, *, is_urgent: bool = False) -> None:
        if math.isnan(self._first):
            self._first = time
        self._kept += count
        waited = self._live and clock.monotonic() - self._handed_over > HAND_OVER_EVERY
        if waited or self._kept > MOST_KEPT or (is_urgent and self._live):
            self._hand_over()

    def number(self, path: str, time: float, value: float) -> None:
        """A point of a curve."""
        self._points[path].append((time, value))
        self._keep(time, 1)

    def text(self, path: str, time: float, markdown: str) -> None:
        """A text that replaces the one before."""
        self._texts[path].append((time, markdown))
        self._keep(time, 1, is_urgent=True)  # perhaps nothing more comes after a fault

    def lines(self, time: float, strokes: Sequence[Stroke]) -> None:
        """Lines of the 3-D view."""
        for stroke in strokes:
            self._strokes[stroke.name].append((time, stroke))
        self._keep(time, len(strokes))
