"""The demo: `pam demo` or `make demo`.

Starts the simulated rig, the program of the robot and a recorder as processes, plays the motions
with the full controller and then with two simpler ones, computes the tracking errors and writes a
page.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from pam_demo.chain import Chain, best_bus, private_domain
from pam_demo.figures import TIMING, evaluate, show, target_text
from pam_demo.loop_rate import (
    RATES,
    RateNotHeld,
    TooSlowError,
    judge,
    rate_sentence,
    trial,
)
from pam_demo.motions import APPROACH, DemoMotion, all_motions
from pam_demo.page import write_page, write_picture
from pam_demo.player import TAIL, NotPlayedError, OpenPlayer, Player
from pam_demo.processes import NodeProcess, Setting
from pam_demo.programs import RECORDER, recorder_words
from pam_gap.answer.user_units import told
from pam_model.command_line import Arguments, Outcome, Progress, progress
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.names import unknown
from pam_model.rig import Rig, load_rig
from pam_ros.periodic import LOWEST_PRIORITY
from pam_sim.rig import parse_effects
from pam_sim.simulated_rig import apply_effects

SIMULATING = "simulating"  # in the line that the rig's node writes when its boards run
MOST_REPEATS = 2  # of one motion; a busy host may exceed the driver's time-outs
COMPILE_TIMEOUT = 600.0  # s; a first start compiles the plant and designs gains
START_TIMEOUT = 60.0  # s, until a node is ready
LAWS: dict[str, dict[str, Setting]] = {
    "full": {"stream.bandwidth": 15.0},
    "no_feedforward": {"feedforward.enabled": False},
    "pressure_ratio_pid": {"law": "pressure_ratio_pid"},
}
COMPARED = ("arm", "chirp")  # motions that the simpler laws play as well


def node_settings(rate: float) -> dict[str, dict[str, Setting]]:
    """Parameters of rig, driver and controller with loops of this rate [Hz].

    The priorities are those of a robot. That of the rig is the highest, since real boards do not
    wait for their host.
    """
    return {
        "rig": {"rate": 2.0 * rate, "measurement_rate": rate, "realtime_priority": 21},
        "driver": {
            "rate": rate,
            "realtime_priority": 20,
            "activate_on_start": True,
            "startup_timeout": START_TIMEOUT,
        },
        "controller": {"loop.rate": rate, "loop.realtime_priority": 20},
    }


def hidden_settings(rig: Rig, effects: Sequence[str]) -> dict[str, Setting]:
    """Parameters of the simulated rig for the effects of --true-effects.

    Raises
    ------
    PamError
        For an effect that the rig cannot have.
    """
    if not effects:
        return {}
    apply_effects(rig, rig, parse_effects(effects, "--true-effects"))
    return {"hidden_effects": " ".join(effects)}


def programme(motions: list[DemoMotion], with_baselines: bool) -> list[tuple[str, DemoMotion]]:
    """Pairs of control law and motion, in the order in which they are played."""
    laws = list(LAWS) if with_baselines else ["full"]
    return [
        (law, motion)
        for law in laws
        for motion in motions
        if law == "full" or motion.name in COMPARED
    ]


def _advance(bar: Progress, before: float, gone: float) -> None:
    bar.show(before + gone)


def _play(
    player: Player, motion: DemoMotion, chain: Chain, advance: Callable[[float], None]
) -> tuple[float, list[str]]:
    """Play a motion, again if it is interrupted or refused; return its start and the reasons.

    Raises
    ------
    TooSlowError
        If it was not played after `MOST_REPEATS` repetitions.
    """
    repeats: list[str] = []
    while True:
        try:
            return player.play(motion, chain.check, advance), repeats
        except NotPlayedError as error:
            repeats.append(str(error))
            if len(repeats) > MOST_REPEATS:
                raise TooSlowError(f"{motion.title}: not played again: {error}") from None
            player.clear_faults(chain.check)
            player.activate(chain.check)
            player.wait_for_controller(COMPILE_TIMEOUT, chain.check)


def perform(
    chain: Chain,
    player: Player,
    bag: Path,
    plays: list[tuple[str, DemoMotion]],
    plant: dict[str, Setting],
    rate: float = RATES[0],
    *,
    tries: bool = False,
    separate: bool = False,
) -> list[dict[str, Any]]:
    """Run and record the programme; return law, motion, start time [s] and rate of each run.

    Only the simulated rig gets the parameters in `plant`. With `tries`, a trial comes first. With
    `separate`, driver, model and controller are processes of their own.

    Raises
    ------
    TooSlowError
        If the loops do not keep the rate [Hz] in the trial, or a motion cannot be played.
    PamError
        If a process ends or does not become ready.
    """
    runs: list[dict[str, Any]] = []
    settings = node_settings(rate)
    total = sum(APPROACH + motion.duration + TAIL for _, motion in plays)
    with progress(total, "starting the rig") as bar:
        chain.processes["recorder"] = NodeProcess(
            RECORDER,
            environment=chain.environment,
            arguments=recorder_words(chain.params_files[0], bag, LOWEST_PRIORITY),
        )
        rig = chain.start("rig", plant | settings["rig"])
        rig.wait_for_output(SIMULATING, COMPILE_TIMEOUT)  # before that, no board answers the driver
        bar.show(0.0, "starting the nodes")
        if separate:
            chain.start("driver", settings["driver"])
            chain.start("model")
            player.wait_for_driver(COMPILE_TIMEOUT, chain.check)
        law_now = ""
        done = 0.0
        for law, motion in plays:
            if law != law_now:
                if law_now:
                    player.vent(chain.check)
                    chain.stop("controller" if separate else "robot")
                    if separate:
                        player.activate(chain.check)
                bar.show(done, "starting the controller")
                controller = LAWS[law] | settings["controller"]
                if separate:
                    chain.start("controller", controller)
                else:
                    chain.start_robot({"driver": settings["driver"], "controller": controller})
                    player.wait_for_driver(COMPILE_TIMEOUT, chain.check)
                player.wait_for_controller(COMPILE_TIMEOUT, chain.check)
                if tries and not runs:
                    bar.show(done, f"trying {rate:g} Hz")
                    _try(player, chain)
                law_now = law
            label = f"{motion.title}, {law.replace('_', ' ')}"
            bar.show(done, label)
            advance = partial(_advance, bar, done)
            start, repeats = _play(player, motion, chain, advance)
            runs.append(
                {"law": law, "motion": motion.name, "start": start, "repeats": repeats}
                | {"rate": rate}
            )
            done += APPROACH + motion.duration + TAIL
        bar.show(total, "done")
    return runs


def _try(player: Player, chain: Chain) -> None:
    """Play the trial, and once more if the loops did not keep the rate in the first one.

    What else a computer does at that moment, for instance the rest of a start, is over in the
    second trial; a computer that is too slow is so in both.

    Raises
    ------
    TooSlowError
        If too many cycles are late in both trials, or the driver vents in both.
    """
    try:
        judge(_late_in_trial(player, chain))
    except TooSlowError:
        judge(_late_in_trial(player, chain))


def _late_in_trial(player: Player, chain: Chain) -> float:
    player.start_counting()
    try:
        player.play(trial(), chain.check, lambda gone: None)
    except NotPlayedError as error:
        print(f"the trial ended early: {error}", flush=True)
        raise TooSlowError("its loops were so late that a motion was interrupted") from None
    return player.late_share()


def perform_at_a_rate_that_is_held(
    chain: Chain,
    player: Player,
    bag: Path,
    plays: list[tuple[str, DemoMotion]],
    plant: dict[str, Setting],
    *,
    separate: bool = False,
) -> tuple[list[dict[str, Any]], list[RateNotHeld]]:
    """Run and record the programme at the first of the `RATES` that this computer holds.

    The last one is taken as it is. Returns what `perform` does, and the rates that were not held.

    Raises
    ------
    PamError
        As `perform`, at the last rate.
    """
    not_held: list[RateNotHeld] = []
    for rate in RATES[:-1]:
        try:
            runs = perform(chain, player, bag, plays, plant, rate, tries=True, separate=separate)
            return runs, not_held
        except TooSlowError as error:
            print(f"{rate:g} Hz is too fast for this computer: {error}", flush=True)
            not_held.append(RateNotHeld(rate, str(error)))
            chain.stop_all()
            shutil.rmtree(bag, ignore_errors=True)
    return perform(chain, player, bag, plays, plant, RATES[-1], separate=separate), not_held


def chosen_joint(rig: Rig, name: str) -> str:
    """The joint that moves: the one that was named, or the first.

    Raises
    ------
    PamError
        If the rig has no such joint.
    """
    if name and name not in rig.joint_names:
        raise PamError(f"--joint: {unknown('joint', name, rig.joint_names)}")
    return name or rig.joint_names[0]


def _first(joint: str, rig: Rig) -> tuple[str, ...]:
    """The joints of the rig, beginning with the one that moves."""
    return (joint, *(name for name in rig.joint_names if name != joint))


def run(given: Arguments, open_player: OpenPlayer) -> Outcome:
    """Run the demo for the command line (`pam_demo.__main__`).

    Parameters
    ----------
    open_player : callable
        Creates the player of the motions.

    Raises
    ------
    PamError
        When the demo cannot run; the message says what to do.
    """
    began = time.monotonic()
    rig_path = chosen_rig(given)
    rig = load_rig(rig_path)
    joint = chosen_joint(rig, given.joint)
    bus = best_bus(given.can)
    plant = hidden_settings(rig, given.true_effects)
    if given.true_rig:
        load_rig(given.true_rig)
        plant["true_rig"] = str(given.true_rig)
    if given.firmware:
        plant["firmware"] = str(given.firmware.resolve())
    out: Path = given.out
    bag = out / "bag"
    shutil.rmtree(bag, ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    motions = [motion for motion in all_motions() if not given.short or motion.name in COMPARED]
    print(f"rig {rig_path}, bus: {bus}")
    environment = private_domain()
    # a domain that the user has set is kept, so that the user can watch the topics in it
    environment["ROS_DOMAIN_ID"] = os.environ.get("ROS_DOMAIN_ID", environment["ROS_DOMAIN_ID"])
    chain = Chain([rig_path], bus, environment)
    not_held: list[RateNotHeld] = []
    try:
        with chain, open_player(_first(joint, rig), environment) as player:
            plays = programme(motions, not (given.no_baselines or given.short))
            if given.rate is None:
                runs, not_held = perform_at_a_rate_that_is_held(
                    chain, player, bag, plays, plant, separate=given.separate
                )
            else:
                runs = perform(
                    chain, player, bag, plays, plant, given.rate, separate=given.separate
                )
    finally:
        chain.write_logs(out)
    (out / "runs.json").write_text(json.dumps(runs, indent=1))
    results = evaluate(bag, runs, {motion.name: motion for motion in motions}, rig, joint)
    (out / "figures.json").write_text(json.dumps(results.as_json(), indent=1))
    muscles = {name: rig.valve_kinds[name] for name in rig.joint(joint).muscles}
    late = any(figure.met is False for figure in results.figures if figure.key in TIMING)
    sentence = rate_sentence(results.rate, not_held, chosen=given.rate is not None, late=late)
    page = write_page(
        out / "demo.html", results, str(bus), muscles, sentence, separate=given.separate
    )
    write_picture(out / "demo.png", results, muscles)
    show(results, Console())
    print(sentence)
    print(f"recording: {bag}\npage:      {page}\ntook {time.monotonic() - began:.0f} s")
    missed = [figure for figure in results.figures if figure.met is False]
    return Outcome(
        {**results.as_json(), "recording": bag, "page": page, "rate_sentence": sentence},
        [
            f"{figure.text}: {told(figure.value, figure.unit, 3)}, expected {target_text(figure)}; "
            f"{figure.reason}"
            for figure in missed
        ],
    )
