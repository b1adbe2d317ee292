"""A layout of Foxglove: a tab with plots for each joint, the robot, its driver and diagnostics.

The keys are those that Foxglove writes when a layout is exported.
"""

from __future__ import annotations

import json
from functools import reduce
from typing import Any

from pam_bringup.layouts.plots import Plot, plots_of
from pam_model.rig import Rig

COLUMNS = 2
ROBOT, DIAGNOSTICS, STATE, VENT, JOINTS = (
    "3D!pam", "DiagnosticSummary!pam", "RawMessages!pam", "CallService!vent", "Tab!joints"
)  # fmt: skip


def foxglove_layout(rig: Rig, prefix: str = "") -> str:
    """The layout as JSON.

    Parameters
    ----------
    rig : Rig
        The robot.
    prefix : str, optional
        Namespace of the robot, with a leading slash.
    """
    panels: dict[str, Any] = {}
    tabs = []
    for joint in rig.joints:
        names = []
        for number, plot in enumerate(plots_of(rig, joint, prefix)):
            names.append(f"Plot!{joint.name}{number}")
            panels[names[-1]] = _plot(plot)
        columns = [names[at::COLUMNS] for at in range(min(COLUMNS, len(names)))]
        side_by_side = _split("row", [_split("column", column) for column in columns])
        tabs.append({"title": joint.name, "layout": side_by_side})
    panels[JOINTS] = {"activeTabIdx": 0, "tabs": tabs}
    panels[ROBOT] = _robot(f"{prefix}/robot_description")
    panels[DIAGNOSTICS] = {
        "topicToRender": "/diagnostics", "hardwareIdFilter": "", "minLevel": 0,
        "sortByLevel": True, "pinnedIds": [],
    }  # fmt: skip
    panels[STATE] = {
        "topicPath": f"{prefix}/pam_driver/state.message", "diffEnabled": False,
        "diffMethod": "custom", "diffTopicPath": "", "showFullMessageForDiff": False,
    }  # fmt: skip
    panels[VENT] = {
        "serviceName": f"{prefix}/pam_driver/vent", "requestPayload": "{}", "layout": "vertical",
        "buttonText": "Vent", "buttonColor": "#b00020",
    }  # fmt: skip
    left = _split("column", [ROBOT, DIAGNOSTICS, STATE, VENT])
    whole = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": left, "second": JOINTS, "splitPercentage": 30},
    }
    return json.dumps(whole, indent=1) + "\n"


def _split(direction: str, parts: list[Any]) -> Any:
    """Parts of equal size beside or below each other, as nested pairs."""

    def pair(rest: tuple[Any, int], part: Any) -> tuple[Any, int]:
        count = rest[1] + 1
        made = {
            "direction": direction, "first": part, "second": rest[0],
            "splitPercentage": round(100.0 / count, 1),
        }  # fmt: skip
        return made, count

    return reduce(pair, reversed(parts[:-1]), (parts[-1], 1))[0]


def _plot(plot: Plot) -> dict[str, Any]:
    return {
        "title": plot.title,
        "paths": [
            {
                "value": f"{curve.topic}.{curve.field}[{curve.place}]",
                "enabled": True,
                # a message without names has no stamp
                "timestampMethod": "headerStamp" if curve.name else "receiveTime",
                "label": curve.label,
                "color": curve.colour,
            }
            for curve in plot.curves
        ],
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "isSynced": True,
        "xAxisVal": "timestamp",
        "followingViewWidth": 30,
    }


def _robot(description: str) -> dict[str, Any]:
    return {
        "followTf": "base_link",
        "followMode": "follow-pose",
        "scene": {},
        "cameraState": {
            "distance": 1.0, "perspective": True, "phi": 70, "thetaOffset": 40,
            "targetOffset": [0, 0, -0.1], "target": [0, 0, 0], "targetOrientation": [0, 0, 0, 1],
            "fovy": 45, "near": 0.01, "far": 100,
        },
        "topics": {description: {"visible": True}},
        "layers": {
            "grid": {
                "visible": True, "layerId": "foxglove.Grid", "instanceId": "grid",
                "label": "Grid", "size": 1, "divisions": 10, "lineWidth": 1,
                "color": "#808080ff", "position": [0, 0, -0.3], "rotation": [0, 0, 0],
            }
        },
    }  # fmt: skip
