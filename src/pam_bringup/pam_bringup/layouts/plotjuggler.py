"""A layout of PlotJuggler: a tab for each joint, with one plot below the other in two columns."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from pam_bringup.layouts.plots import Curve, Plot, plots_of
from pam_model.rig import Rig

COLUMNS = 2


def plotjuggler_layout(rig: Rig, prefix: str = "") -> str:
    """The layout as XML; parameters as for `foxglove_layout`."""
    root = Element("root")
    window = SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for joint in rig.joints:
        tab = SubElement(window, "Tab", tab_name=joint.name, containers="1")
        plots = plots_of(rig, joint, prefix)
        columns = [plots[at::COLUMNS] for at in range(min(COLUMNS, len(plots)))]
        beside = _splitter(SubElement(tab, "Container"), "|", len(columns))
        for column in columns:
            below = _splitter(beside, "-", len(column))
            for plot in column:
                _add_plot(below, plot)
    SubElement(window, "currentTabIndex", index="0")
    SubElement(root, "use_relative_time_offset", enabled="1")
    SubElement(root, "previouslyLoaded_Streamer", name="ROS2 Topic Subscriber")
    ElementTree.indent(root, " ")
    text = ElementTree.tostring(root, encoding="unicode")
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{text}\n"


def name_of(curve: Curve) -> str:
    """How PlotJuggler names a series; of a JointState by the name of the joint or muscle."""
    if curve.name:
        return f"{curve.topic}/{curve.name}/{curve.field}"
    return f"{curve.topic}/{curve.field}[{curve.place}]"


def _splitter(parent: Element, orientation: str, count: int) -> Element:
    sizes: Sequence[str] = [f"{1.0 / count:.6f}"] * count
    return SubElement(
        parent, "DockSplitter", orientation=orientation, sizes=";".join(sizes), count=str(count)
    )


def _add_plot(parent: Element, plot: Plot) -> None:
    area = SubElement(parent, "DockArea", name=plot.title)
    drawn = SubElement(
        area, "plot", mode="TimeSeries", style="Lines", flip_x="false", flip_y="false"
    )
    SubElement(drawn, "range", left="0", right="30", bottom="-1", top="1")
    SubElement(drawn, "limitY")
    for curve in plot.curves:
        SubElement(drawn, "curve", name=name_of(curve), color=curve.colour)
