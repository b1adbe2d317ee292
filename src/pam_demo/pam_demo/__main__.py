"""The demo: `python -m pam_demo`, `ros2 run pam_sim demo` or `make demo`.

Starts the simulated rig, driver, model, controller and a recorder as processes of their own,
plays the motions with the full controller and then with two simpler ones, and ends with figures
and a page.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from pam_check.chain import BusChoice, Chain, best_bus, private_domain, set_environment
from pam_check.processes import NodeProcess, Setting
from pam_demo.figures import evaluate, show
from pam_demo.motions import APPROACH, Motion, all_motions
from pam_demo.page import write_page, write_picture
from pam_demo.player_node import TAIL, Player, VentedError
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_sim.rig import parse_effects

MOST_REPEATS = 2  # of one motion, where the host is too busy to keep the driver's time-outs
START_TIMEOUT = 60.0  # s, for a node to be ready; the rig may have to compile its plant
LAWS: dict[str, dict[str, Setting]] = {
    "full": {"stream.bandwidth": 15.0},
    "no_feedforward": {"feedforward.enabled": False},
    "pressure_ratio_pid": {"law": "pressure_ratio_pid"},
}
# as on a robot; the boards come first: they would not wait for their host
REALTIME: dict[str, dict[str, Setting]] = {
    "rig": {"realtime_priority": 21},
    "driver": {"realtime_priority": 20},
    "controller": {"loop.realtime_priority": 20},
}
COMPARED = ("arm", "chirp")  # what the simpler laws play as well


def default_rig_path() -> Path:
    """The elbow's rig file: beside the source tree, or where colcon installed it."""
    name = Path("config") / "elbow.yaml"
    for folder in (Path.cwd(), *Path(__file__).resolve().parents):
        if (folder / name).is_file():
            return folder / name
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        path = Path(prefix) / "share" / "pam_bringup" / name
        if prefix and path.is_file():
            return path
    raise PamError("config/elbow.yaml: not found; name a rig file with --rig")


def programme(motions: list[Motion], with_baselines: bool) -> list[tuple[str, Motion]]:
    """Which law plays which motion, in order."""
    laws = list(LAWS) if with_baselines else ["full"]
    return [
        (law, motion)
        for law in laws
        for motion in motions
        if law == "full" or motion.name in COMPARED
    ]


def _advance(progress: Progress, task: TaskID, before: float, gone: float) -> None:
    progress.update(task, completed=before + gone)


def _play(
    player: Player, motion: Motion, chain: Chain, advance: Callable[[float], None]
) -> tuple[float, list[str]]:
    """Play a motion, again if the driver vents; when it began, and why it was repeated."""
    repeats: list[str] = []
    while True:
        try:
            return player.play(motion, chain.check, advance), repeats
        except VentedError as error:
            repeats.append(str(error))
            if len(repeats) > MOST_REPEATS:
                raise PamError(f"{motion.title}: the driver vented again: {error}") from None
            player.clear_faults(chain.check)
            player.activate(chain.check)
            player.wait_for_controller(START_TIMEOUT, chain.check)


def perform(
    chain: Chain,
    rig: Rig,
    bag: Path,
    plays: list[tuple[str, Motion]],
    console: Console,
    plant: dict[str, Setting],
) -> list[dict[str, Any]]:
    """Run the programme and record it; which law played which motion from when [s].

    `plant` is what the simulated rig alone is told.

    Raises
    ------
    PamError
        If a process ends or does not become ready.
    """
    runs: list[dict[str, Any]] = []
    total = sum(APPROACH + motion.duration + TAIL for _, motion in plays)
    with set_environment(chain.environment):
        rclpy.init(args=[])
    player = Player(rig.joint_names)
    columns = (TextColumn("{task.description:34}"), BarColumn(None), TimeRemainingColumn())
    try:
        with Progress(*columns, console=console, refresh_per_second=4) as progress:
            task = progress.add_task("starting the nodes", total=total)
            chain.processes["recorder"] = NodeProcess(
                "pam_demo.recorder_node",
                environment=chain.environment,
                arguments=["--out", str(bag)],
            )
            chain.start("rig", plant | REALTIME["rig"])
            chain.start("driver", {"startup_timeout": START_TIMEOUT} | REALTIME["driver"])
            chain.start("model")
            player.wait_for_driver(START_TIMEOUT, chain.check)
            law_now = ""
            done = 0.0
            for law, motion in plays:
                if law != law_now:
                    if law_now:
                        player.vent(chain.check)
                        chain.stop("controller")
                        player.activate(chain.check)
                    progress.update(task, description="starting the controller")
                    chain.start("controller", LAWS[law] | REALTIME["controller"])
                    player.wait_for_controller(START_TIMEOUT, chain.check)
                    law_now = law
                label = f"{motion.title}, {law.replace('_', ' ')}"
                progress.update(task, description=label)
                advance = partial(_advance, progress, task, done)
                start, repeats = _play(player, motion, chain, advance)
                runs.append({"law": law, "motion": motion.name, "start": start, "repeats": repeats})
                done += APPROACH + motion.duration + TAIL
            progress.update(task, description="done", completed=total)
    finally:
        player.destroy_node()
        rclpy.try_shutdown()
    return runs


def run(options: argparse.Namespace, console: Console) -> int:
    """All of the demo.

    Raises
    ------
    PamError
        With what to do about it.
    """
    began = time.monotonic()
    rig_path = options.rig or default_rig_path()
    rig = load_rig(rig_path)
    bus = BusChoice("socketcan", options.can) if options.can else best_bus()
    out: Path = options.out
    bag = out / "bag"
    shutil.rmtree(bag, ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    motions = [motion for motion in all_motions() if not options.short or motion.name in COMPARED]
    plant: dict[str, Setting] = {}
    if options.true_rig:
        load_rig(options.true_rig)
        plant["true_rig"] = str(options.true_rig)
    if options.true_effects:
        parse_effects(options.true_effects)
        plant["hidden_effects"] = " ".join(options.true_effects)
    console.print(f"rig {rig_path}, bus: {bus}")
    environment = private_domain()
    # who has set a domain wants to look on from it
    environment["ROS_DOMAIN_ID"] = os.environ.get("ROS_DOMAIN_ID", environment["ROS_DOMAIN_ID"])
    chain = Chain([rig_path], bus, environment)
    try:
        with chain:
            plays = programme(motions, not (options.no_baselines or options.short))
            runs = perform(chain, rig, bag, plays, console, plant)
    finally:
        for name, text in chain.outputs.items():
            (out / f"{name}.log").write_text(text)
    (out / "runs.json").write_text(json.dumps(runs, indent=1))
    results = evaluate(bag, runs, {motion.name: motion for motion in motions}, rig)
    (out / "figures.json").write_text(json.dumps(results.as_json(), indent=1))
    page = write_page(out / "demo.html", results, str(bus), rig.joints[0].muscles)
    write_picture(out / "demo.png", results, rig.joints[0].muscles)
    show(results, console)
    console.print(f"recording: {bag}\npage:      {page}\ntook {time.monotonic() - began:.0f} s")
    return 0


def main() -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="demo", description="The suite on a simulated rig.")
    parser.add_argument("--rig", type=Path, help="rig file (default: the elbow)")
    parser.add_argument("--can", metavar="INTERFACE", help="CAN interface, for example vcan0")
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder for results")
    parser.add_argument("--no-baselines", action="store_true", help="the full controller only")
    parser.add_argument(
        "--short", action="store_true", help="the full controller only, arm's motion and chirp"
    )
    parser.add_argument(
        "--true-rig", type=Path, metavar="FILE", help="rig file of the plant alone (default: --rig)"
    )
    parser.add_argument(
        "--true-effects",
        nargs="+",
        default=[],
        metavar="EFFECT.PARAMETER=VALUE",
        help="effects of the plant that no other node is told",
    )
    options = parser.parse_args()
    console = Console()
    try:
        return run(options, console)
    except (PamError, OSError) as error:
        console.print(f"demo: {error}", style="red", markup=False, highlight=False)
        return 1
    except KeyboardInterrupt:
        console.print("stopped")
        return 130


if __name__ == "__main__":
    sys.exit(main())
