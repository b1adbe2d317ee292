"""`python -m pam_gap effects`: the page of effects, each with its signature drawn from the plant.

Every picture shows the same motion of the same rig under equal valve commands, once ideal and
once with the effect at the size the caption gives; what differs is what a diagnosis sees.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt

from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate, simulate_measured
from pam_model.rig import Rig, load_rig

Array = npt.NDArray[np.float64]

SAMPLE_TIME = 0.002  # s
DURATION = 12.0  # s


@dataclass(frozen=True)
class Portrait:
    """How an effect is shown and described."""

    sizes: dict[str, float]
    one_sided: bool
    signature: str
    confused_with: str
    remedy: str


PORTRAITS: dict[str, Portrait] = {
    "valve_dead_zone": Portrait(
        {"overlap": 0.05}, False,
        "Small commands move no air: the pressure loop hunts around every hold, and the command "
        "jumps across zero whenever the pressure has to turn round.",
        "leakage and null offset in holds; command_delay in fast motion.",
        "Microsteps around the valve's null."),
    "valve_null_offset": Portrait(
        {"offset": 0.03}, True,
        "One valve needs a constant command to stand still; its pressure drifts where the other "
        "one's does not.",
        "leakage on the same muscle (which grows with pressure, as an offset does not).",
        "Holds at two pressures."),
    "valve_lag": Portrait(
        {"extra_time_constant": 0.02}, False,
        "Pressure follows commands late and rounded, the more the faster they change.",
        "command_delay (late but not rounded), tube_restriction, pressure_lag.",
        "A chirp in the command."),
    "exhaust_restriction": Portrait(
        {"ratio": 0.6}, False,
        "Venting is slower than filling: each cycle of equal commands pumps the pressure up.",
        "valve_null_offset on both valves.",
        "Steps up and down of equal size."),
    "supply_droop": Portrait(
        {"conductance": 3e-10, "volume": 2e-4}, False,
        "After air was drawn, filling is slow for a while; venting is untouched.",
        "exhaust_restriction with the other sign; a measured supply pressure settles it.",
        "Record `supply_pressure`, or fill both muscles at once."),
    "tube_restriction": Portrait(
        {"conductance": 2e-9, "volume": 1.5e-5}, False,
        "The sensor at the valve leads the muscle: pressure jumps, then creeps on while the flow "
        "dies away; the force follows late.",
        "valve_lag and pressure_lag, which leave the force in step with the pressure.",
        "A load cell, or steps with the joint locked."),
    "command_delay": Portrait(
        {"delay": 0.02}, False,
        "Everything happens later by the same time.",
        "position_delay, where only the angle is late.",
        "Steps: the time to the first reaction."),
    "leakage": Portrait(
        {"conductance": 6e-11}, False,
        "Pressure falls with shut valves, the faster the higher it is; holds need a constant "
        "positive command.",
        "valve_null_offset, which does not depend on the pressure.",
        "A leak-down with shut valves."),
    "dead_volume": Portrait(
        {"extra_volume": 4e-5}, False,
        "The same air gives less pressure change; with shut valves the joint is softer.",
        "a smaller sonic_conductance, thermal.",
        "Move the joint with shut valves."),
    "thermal": Portrait(
        {"conductance": 0.5}, False,
        "Fast changes are stiffer than slow ones; after a fast fill the pressure sinks back within "
        "a second with shut valves.",
        "dead_volume, leakage (which does not stop sinking).",
        "A fast fill, then a hold with shut valves."),
    "hysteresis": Portrait(
        {"amplitude": 0.05, "presliding_length": 1e-3}, False,
        "Force on the way out differs from force on the way back, whatever the speed, and more "
        "at high pressure.",
        "coulomb_friction, which does not grow with pressure.",
        "Slow cycles at two co-contraction levels; a load cell."),
    "creep": Portrait(
        {"ratio": 0.08, "time_constant": 5.0}, False,
        "After each step the joint drifts on for seconds to minutes at constant pressure.",
        "leakage without a pressure sensor; bladder_elasticity in short recordings.",
        "Long holds."),
    "bladder_elasticity": Portrait(
        {"linear": 400.0, "cubic": 4e5}, False,
        "A force that depends on length and not on pressure: the joint is stiffer, at low "
        "pressure most visibly.",
        "payload, end_caps, pulley_radius.",
        "A co-contraction sweep, down to low pressure."),
    "end_caps": Portrait(
        {"factor": 1.12}, False,
        "Contracted muscles pull less than the cylinder says, in proportion to pressure.",
        "bladder_elasticity (no pressure), pulley_radius, braid_extensibility.",
        "A co-contraction sweep at two angles."),
    "braid_extensibility": Portrait(
        {"compliance": 1e-7}, False,
        "High pressure makes the threads longer: the muscle pulls less and holds more gas than "
        "it should, the more the higher the pressure.",
        "end_caps, pressure_gain on both sensors.",
        "Holds at several pressures; a load cell."),
    "cable_compliance": Portrait(
        {"compliance": 1e-5}, False,
        "The muscle is shorter than the joint's angle says, under load: softer joint, and the "
        "gas volume moves although the joint does not.",
        "dead_volume, end_caps.",
        "Lock the joint and change the pressure."),
    "coulomb_friction": Portrait(
        {"torque": 0.6}, False,
        "The joint stands still until the torque has grown enough; flat tops on every turn.",
        "hysteresis (grows with pressure), stribeck_friction.",
        "Slow cycles at two co-contraction levels."),
    "stribeck_friction": Portrait(
        {"static_torque": 1.0, "torque": 0.4, "speed": 0.1}, False,
        "As dry friction, but it lets go with a jump: stick and slip at low speed.",
        "coulomb_friction, when the motion never is slow.",
        "Very slow ramps."),
    "viscous_friction": Portrait(
        {"extra": 0.4}, False,
        "Swings die out faster; the joint lags in proportion to its speed.",
        "position_delay, cable_compliance.",
        "A vented swing."),
    "payload": Portrait(
        {"mass": 0.8, "distance": 0.25}, False,
        "More pressure for the same angle away from the vertical, and slower swings.",
        "pulley_radius, bladder_elasticity.",
        "Turn the joint over (gravity flip), or swing it vented."),
    "pulley_radius": Portrait(
        {"scale": 0.9}, False,
        "Torque and muscle travel per radian are both off by the same factor.",
        "payload, end_caps, bladder_elasticity.",
        "Move the joint with shut valves: the pressures tell the travel."),
    "position_offset": Portrait(
        {"offset": 0.05}, False,
        "Everything is in place but the angle's zero; gravity and muscle lengths disagree.",
        "unequal neutral lengths, payload at an angle.",
        "Hang the joint vented."),
    "position_delay": Portrait(
        {"delay": 0.02}, False,
        "Only the angle is late: pressures fit, acceleration leads.",
        "viscous_friction, command_delay.",
        "A chirp of the joint."),
    "pressure_gain": Portrait(
        {"gain": 1.08}, True,
        "One sensor is wrong in proportion: torque and flow disagree on that side.",
        "pressure_bias, when the pressure hardly changes; a valve asymmetry.",
        "Holds at several pressures; vent to zero."),
    "pressure_bias": Portrait(
        {"bias": 1.2e4}, True,
        "One sensor does not read zero when vented.",
        "pressure_gain, when the pressure hardly changes.",
        "Vent, and read the sensor."),
    "pressure_lag": Portrait(
        {"time_constant": 0.03}, False,
        "Pressure is shown late and rounded; the joint moves before the sensor says why.",
        "valve_lag, where the joint waits too.",
        "A chirp: angle against pressure."),
}  # fmt: skip


def commands_of_a_motion(rig: Rig) -> tuple[Array, PlantParameters]:
    """Valve commands that keep the ideal rig in a lively motion, and its parameters.

    Found by a proportional pressure loop around the ideal plant, in chunks of one sample.
    """
    parameters = PlantParameters.from_rig(rig, with_effects=False)
    time = np.arange(round(DURATION / SAMPLE_TIME)) * SAMPLE_TIME
    swing = 5e4 * np.sin(2 * math.pi * 0.35 * time) + 4e4 * np.sign(
        np.sin(2 * math.pi * 0.14 * time)
    )
    wanted = 2.2e5 + np.stack([swing, -swing], axis=1) * np.clip(time, 0.0, 1.0)[:, None]
    state = initial_state(parameters, pressures=(2.2e5, 2.2e5))
    commands = np.zeros((time.size, 2))
    pressures = np.array([2.2e5, 2.2e5])
    for k in range(time.size):
        commands[k] = np.clip(6e-6 * (wanted[k] - pressures), -1.0, 1.0)
        step = simulate(parameters, commands[k : k + 1], SAMPLE_TIME, state)
        state = step.final_state
        ahead = simulate(parameters, np.zeros((1, 2)), 1e-6, state)
        pressures = ahead.pressures[0]
    return commands, parameters


def plant_changes(name: str) -> dict[str, float]:
    """Plant parameters of the effect at the size its portrait has.

    Raises
    ------
    PamError
        For an effect without a portrait.
    """
    if name not in PORTRAITS:
        raise PamError(f"no portrait of {name!r}; known: {', '.join(PORTRAITS)}")
    portrait = PORTRAITS[name]
    side = "agonist." if portrait.one_sided else ""
    return {f"{side}{name}.{key}": value for key, value in portrait.sizes.items()}


def draw_signature(name: str, commands: Array, ideal: PlantParameters, path: Path) -> None:
    """Draw angle and pressures with the effect against those without it."""
    shown = []
    for parameters in (ideal, ideal.replaced(plant_changes(name))):
        state = initial_state(parameters, pressures=(2.2e5, 2.2e5))
        run = simulate(parameters, commands, SAMPLE_TIME, state)
        shown.append((run.time, simulate_measured(parameters, run)))
    figure, (upper, lower) = plt.subplots(
        2, 1, figsize=(6.4, 3.4), sharex=True, layout="constrained"
    )
    (time, plain), (_, hidden) = shown
    upper.plot(time, (hidden.position - plain.position) * 1e3, color="C3", lw=1.0)
    upper.axhline(0.0, color="0.8", lw=0.8)
    upper.set_ylabel("change of\nangle [mrad]")
    for i, muscle in enumerate(("agonist", "antagonist")):
        change = (hidden.pressures[:, i] - plain.pressures[:, i]) / 1e3
        lower.plot(time, change, color=f"C{i}", lw=1.0, label=muscle)
    lower.set_ylabel("change of\npressure [kPa]")
    lower.set_xlabel("time [s]")
    lower.legend(fontsize=7, loc="upper right", ncols=2)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def draw_motion(commands: Array, ideal: PlantParameters, path: Path) -> None:
    """Draw the ideal rig's motion, which all signatures depart from."""
    run = simulate(ideal, commands, SAMPLE_TIME, initial_state(ideal, pressures=(2.2e5, 2.2e5)))
    figure, (upper, lower) = plt.subplots(
        2, 1, figsize=(6.4, 3.4), sharex=True, layout="constrained"
    )
    upper.plot(run.time, run.position, color="0.3", lw=1.0)
    upper.set_ylabel("angle [rad]")
    for i, muscle in enumerate(("agonist", "antagonist")):
        lower.plot(run.time, run.pressures[:, i] / 1e3, color=f"C{i}", lw=1.0, label=muscle)
    lower.set_ylabel("pressure [kPa]")
    lower.set_xlabel("time [s]")
    lower.legend(fontsize=7, loc="upper right", ncols=2)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def page_text() -> str:
    """Write the page in Markdown."""
    lines = [
        "# The effects a diagnosis knows",
        "",
        "Made by `python -m pam_gap effects`. Every picture shows the rig of `config/elbow.yaml` "
        "under one and the same sequence of valve commands, and in it what the effect changes: "
        "the measured angle above, the two measured pressures below. Without any effect the rig "
        "moves like this:",
        "",
        "![the motion of the ideal rig](images/effects/motion.png)",
        "",
    ]
    stage = None
    for name, effect in EFFECTS.items():
        portrait = PORTRAITS[name]
        if effect.stage != stage:
            stage = effect.stage
            lines += [f"## Stage: {stage}", ""]
        sizes = ", ".join(
            f"{key} = {value:g} {effect.parameters[key].unit}".removesuffix(" -")
            for key, value in portrait.sizes.items()
        )
        where = " on the agonist" if portrait.one_sided else ""
        lines += [
            f"### `{name}`",
            "",
            f"{effect.description[0].upper()}{effect.description[1:]}. {portrait.signature}",
            "",
            f"- Law: `{effect.law}` ({effect.source}).",
            f"- Easily taken for: {portrait.confused_with}",
            f"- What tells them apart: {portrait.remedy}",
            "",
            f"![{name}: {sizes}{where}](images/effects/{name}.png)",
            "",
            f"*{sizes}{where}*",
            "",
        ]
    return "\n".join(lines)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--rig", type=Path, default=Path("config/elbow.yaml"))
    parser.add_argument("--out", type=Path, default=Path("docs"))


def main(arguments: argparse.Namespace) -> int:
    """Write docs/effects.md and its pictures."""
    mpl.use("Agg")
    images = arguments.out / "images" / "effects"
    images.mkdir(parents=True, exist_ok=True)
    commands, ideal = commands_of_a_motion(load_rig(arguments.rig))
    draw_motion(commands, ideal, images / "motion.png")
    for name in EFFECTS:
        draw_signature(name, commands, ideal, images / f"{name}.png")
    (arguments.out / "effects.md").write_text(page_text())
    print(f"written: {arguments.out / 'effects.md'} and {len(EFFECTS)} pictures in {images}")
    return 0
