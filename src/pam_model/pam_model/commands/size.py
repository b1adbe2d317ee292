"""Command that sizes a joint."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pam_model.argument_types import make_parents, new_file, number, output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INERTIA_PER_TORQUE = 0.004  # kg m^2 for each N m, as of an elbow


def _declare(parser: Parser) -> None:
    for option, unit, above, most, text in (
        ("--torque", "N m", 0.0, None, "wanted at every angle, in both directions"),
        ("--range", "rad", 0.0, math.tau, "the joint turns by +-"),
        ("--speed", "rad/s", 0.0, None, "with which it shall cross the range"),
        ("--pressure", "Pa", 1e4, None, "largest pressure of the muscles, gauge"),
    ):
        parser.add_argument(
            option, required=True, type=number(unit, above=above, most=most), metavar="X",
            help=f"{text} [{unit}]",
        )  # fmt: skip
    parser.add_argument(
        "--muscle-length", type=number("m", above=0.0, most=10.0), default=0.25, metavar="X",
        help="room for a muscle at rest [m] (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--inertia", type=number("kg m^2", above=0.0), metavar="X",
        help=f"for the rig file [kg m^2] (default: {INERTIA_PER_TORQUE:g} for each N m of torque)",
    )  # fmt: skip
    parser.add_argument(
        "--supply", type=number("Pa", above=1e4), metavar="X",
        help="pressure before the valves, gauge [Pa] (default: that of --pressure)",
    )  # fmt: skip
    parser.add_argument("--plot", type=output_file, metavar="FILE", help="torque and stiffness")
    parser.add_argument("--write-rig", type=new_file, metavar="FILE", help="write a rig file")


def _run(chosen: Arguments) -> Outcome:
    import yaml  # noqa: PLC0415

    from pam_model.identify.size import (  # noqa: PLC0415  (scipy)
        size_joint,
        sized_rig,
        torque_and_stiffness,
    )
    from pam_model.rig import rig_from_parameters  # noqa: PLC0415

    found = size_joint(
        chosen.torque,
        chosen.range,
        chosen.speed,
        chosen.pressure,
        chosen.muscle_length,
        chosen.supply,
    )
    print(found.table())
    inertia = chosen.inertia or INERTIA_PER_TORQUE * chosen.torque
    text = sized_rig(found, chosen.range, chosen.pressure, inertia).text()
    rig = rig_from_parameters(yaml.safe_load(text)["/**"]["ros__parameters"])
    curves = torque_and_stiffness(rig, chosen.pressure)
    torques = min(curves["highest_torque"]), max(curves["lowest_torque"])
    least, greatest = max(curves["least_stiffness"]), min(curves["greatest_stiffness"])
    print(f"torque           {torques[1]:.3g} to {torques[0]:.3g} N m at every angle")
    print(f"stiffness        {least:.3g} to {greatest:.3g} N m/rad at every angle without load")
    if chosen.plot:
        from pam_model.identify.show import save_figure  # noqa: PLC0415  (matplotlib)

        print(save_figure(_draw(curves, chosen.torque), make_parents(chosen.plot)))
    if chosen.write_rig:
        make_parents(chosen.write_rig).write_text(text, encoding="utf-8")
        print(f"written: {chosen.write_rig}")
    return Outcome({**found.as_dict(), "curves": curves})


def _draw(curves: dict[str, list[float]], torque: float) -> Figure:
    """Torque and stiffness against the angle."""
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(9, 4), layout="constrained")
    axes: Any = figure.subplots(1, 2)
    angle = curves["angle"]
    axes[0].fill_between(angle, curves["lowest_torque"], curves["highest_torque"], alpha=0.3)
    for wanted in (torque, -torque):
        axes[0].axhline(wanted, linestyle="--", color="black")
    axes[0].set(xlabel="angle [rad]", ylabel="torque [N m]", title="reach; dashed: wanted")
    low, high = curves["least_stiffness"], curves["greatest_stiffness"]
    axes[1].fill_between(angle, low, high, alpha=0.3, color="tab:green")
    axes[1].set(xlabel="angle [rad]", ylabel="stiffness [N m/rad]", title="without load")
    return figure


COMMANDS = (
    Command(
        "size",
        "size a joint: pulley, muscle and valve for a torque, range, speed and pressure",
        _declare,
        _run,
        examples=(
            "pam model size --torque 5 --range 1.0 --speed 3 --pressure 5e5 --plot out/size.png",
        ),
    ),
)
