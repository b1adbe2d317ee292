"""The page of effects, each with its signature drawn from the plant.

All pictures show the same rig under the same valve commands. Each picture shows the difference
between the rig with the effect, of the size in the caption, and the ideal rig. This difference is
what a diagnosis has to explain.
"""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt

from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate, simulate_measured
from pam_model.rig import Rig

Array = npt.NDArray[np.float64]

SAMPLE_TIME = 0.002  # s
DURATION = 12.0  # s


def commands_of_a_motion(rig: Rig) -> tuple[Array, PlantParameters]:
    """Valve commands that keep the ideal rig in varied motion, and its parameters.

    A proportional pressure loop around the ideal plant computes them sample by sample.
    """
    parameters = PlantParameters.from_rig(rig.without_effects())
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
    """Plant parameters of the effect at the size that its portrait states.

    Raises
    ------
    PamError
        For an effect that is not known.
    """
    if name not in EFFECTS:
        raise PamError(f"no effect {name!r}; known: {', '.join(EFFECTS)}")
    effect = EFFECTS[name]
    side = "agonist." if effect.search.is_one_sided else ""
    return {f"{side}{name}.{key}": value for key, value in effect.portrait.sizes.items()}


def draw_signature(name: str, commands: Array, ideal: PlantParameters, path: Path) -> None:
    """Draw the change of angle and pressures that the effect causes."""
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
    """Draw the motion of the ideal rig, with which all signatures are compared."""
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


def effects_page() -> str:
    """Return the page as Markdown."""
    lines = [
        "# The effects that a diagnosis can name",
        "",
        "This page is written by `./pam check pages`. All pictures show the rig of "
        "`config/elbow.yaml` under the same sequence of valve commands. Each picture shows the "
        "change that the effect causes: of the measured angle above, of the two measured pressures "
        "below. The first picture shows the motion without any effect:",
        "",
        "![the motion of the ideal rig](images/effects/motion.png)",
        "",
    ]
    stage = None
    for name, effect in EFFECTS.items():
        portrait = effect.portrait
        if effect.stage != stage:
            stage = effect.stage
            lines += [f"## Stage: {stage}", ""]
        sizes = ", ".join(
            f"{key} = {value:g} {effect.parameters[key].unit}".removesuffix(" -")
            for key, value in portrait.sizes.items()
        )
        where = " on the agonist" if effect.search.is_one_sided else ""
        lines += [
            f"### `{name}`",
            "",
            f"{effect.description[0].upper()}{effect.description[1:]}. {portrait.signature}",
            "",
            f"- Law: `{effect.law}` ({effect.source}).",
            f"- Easily confused with: {portrait.easily_taken_for}",
            f"- How to distinguish them: {portrait.told_apart_by}",
            "",
            f"![{name}: {sizes}{where}](images/effects/{name}.png)",
            "",
            f"*{sizes}{where}*",
            "",
        ]
    return "\n".join(lines)


def draw_effects(rig: Rig, folder: Path) -> None:
    """Draw the motion of the ideal rig, and the signature of every effect."""
    mpl.use("Agg")
    folder.mkdir(parents=True, exist_ok=True)
    commands, ideal = commands_of_a_motion(rig)
    draw_motion(commands, ideal, folder / "motion.png")
    for name in EFFECTS:
        draw_signature(name, commands, ideal, folder / f"{name}.png")
