"""What to plot of a robot: the curves of each joint, and the fields of messages they are in."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress

from pam_model.rig import Joint, Rig

FIRST, SECOND, ASKED_FIRST, ASKED_SECOND = "#1f77b4", "#d62728", "#9ecae1", "#fcae91"
"""Colours; what is asked for is paler than what is there."""


@dataclass(frozen=True, slots=True)
class Curve:
    """One number of a message over time."""

    topic: str  # with its leading slash and namespace
    field: str  # the list in the message that holds the number
    place: int  # place in this list
    name: str  # of the joint or muscle, where the message names its numbers; else empty
    label: str  # for the legend
    colour: str  # "#rrggbb"


@dataclass(frozen=True, slots=True)
class Plot:
    """Curves of one quantity; the title states it with its unit."""

    title: str
    curves: tuple[Curve, ...]


def plots_of(rig: Rig, joint: Joint, prefix: str = "") -> tuple[Plot, ...]:
    """The plots of one joint.

    Parameters
    ----------
    rig : Rig
        The robot.
    prefix : str, optional
        Namespace of the robot, with a leading slash.
    """
    place = rig.joint_names.index(joint.name)
    # joint_states leaves out a joint that is not measured
    measured = [each.name for each in rig.joints if each.encoder is not None]
    shown = measured.index(joint.name) if joint.name in measured else place

    def of_joint(topic: str, at: int, label: str, colour: str) -> Curve:
        return Curve(f"{prefix}/{topic}", "position", at, joint.name, label, colour)

    def stiffness(topic: str, label: str, colour: str) -> Curve:
        return Curve(f"{prefix}/{topic}", "data", place, "", label, colour)

    muscles = [(name, rig.muscle_names.index(name)) for name in joint.muscles]

    def of_muscles(
        topic: str, field: str, colours: tuple[str, str], asked: str = ""
    ) -> list[Curve]:
        return [
            Curve(f"{prefix}/{topic}", field, at, name, name + asked, colour)
            for (name, at), colour in zip(muscles, colours, strict=True)
        ]

    # a flow valve is sent an opening, a regulator a pressure
    opened = of_muscles("sent_valve_commands", "position", (FIRST, SECOND))
    asked = of_muscles("sent_valve_commands", "effort", (ASKED_FIRST, ASKED_SECOND), ", asked for")
    flow = [rig.muscle(name).valve.kind == "flow" for name in joint.muscles]
    plots = (
        Plot(
            "angle and reference [rad]",
            (
                of_joint("joint_states", shown, "measured", FIRST),
                of_joint("pam_controller/reference", place, "reference", SECOND),
            ),
        ),
        Plot(
            "tracking error [rad]",
            (of_joint("pam_controller/error", place, "error", FIRST),),
        ),
        Plot(
            "gauge pressure [Pa]",
            (
                *of_muscles("pressure_states", "effort", (FIRST, SECOND)),
                *(curve for curve, is_flow in zip(asked, flow, strict=True) if not is_flow),
            ),
        ),
        Plot("valve opening [-1 to 1]", tuple(compress(opened, flow))),
        Plot(
            "stiffness [N m/rad]",
            (
                stiffness("joint_stiffness", "given", FIRST),
                stiffness("pam_controller/stiffness_commands", "asked for", SECOND),
            ),
        ),
        Plot("muscle force [N]", tuple(of_muscles("muscle_states", "effort", (FIRST, SECOND)))),
    )
    return tuple(plot for plot in plots if plot.curves)
