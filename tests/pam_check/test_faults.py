"""Faults as data, how they are brought about, and a short campaign over all of them."""

from __future__ import annotations

import json
import math
import random
import re
from pathlib import Path

import pytest

from pam_check.__main__ import main
from pam_check.doc_pages.safety_tables import diagram_as_mermaid
from pam_check.fault_kinds.fault_kind import STOPS, Reaction, Stays
from pam_check.fault_kinds.kinds import ALL_KINDS, KINDS
from pam_check.faults.campaign import in_a_fork
from pam_check.faults.injections import INJECTIONS
from pam_check.faults.process_campaign import KEPT, REPEAT, Observation, judge, time_outs
from pam_check.faults.report import write_report
from pam_check.faults.rig_bounds import bounds_of
from pam_check.faults.trial import Trial, draw_values, error_bound, problem_of, run_trial
from pam_driver.boards.pam_board.codec import BoardCodec, BoardState, FrameError
from pam_driver.safety.states import TRANSITIONS, SafetyState
from pam_model.errors import PamError
from pam_sim.boards.pam_board_twin import SimulatedPamBoard
from pam_sim.boards.protocol import BoardValve
from pam_sim.fault_injection import parse_injection
from pam_sim.faults import rig_faults
from pam_sim.faults.frame_faults import FrameFault, FrameFaults
from pam_sim.faults.rig_faults import POSITION, RigFaults
from support.fault_kinds import kind_called
from support.rigs import ELBOW

CAMPAIGN_PAGE = Path(__file__).parents[2] / "docs/faults_table.md"
FRAME = (0x100, bytes(range(8)))


def test_every_kind_can_be_brought_about_and_once_only():
    names = [kind.name for kind in ALL_KINDS]
    assert len(set(names)) == len(names)
    assert set(INJECTIONS) == set(names)
    assert len(KINDS) >= 110


def test_a_kind_that_nobody_notices_says_why():
    for kind in KINDS:
        assert kind.detected_by or kind.reason, kind.name
        assert kind.bound > 0.0


def test_the_page_of_the_campaign_has_every_kind_and_all_are_kept():
    page = CAMPAIGN_PAGE.read_text(encoding="utf-8")
    kept = re.findall(r"^\| (\w+) \|.*\| kept \|$", page, re.MULTILINE)
    assert kept == [kind.name for kind in KINDS]
    for kind in KINDS:
        if kind.reaction in STOPS:
            row = next(line for line in page.splitlines() if line.startswith(f"| {kind.name} |"))
            assert f" | {1e3 * kind.bound:.0f} | " in row


def test_the_diagram_has_every_change_of_state_and_no_other():
    drawn = {
        (SafetyState(source), SafetyState(target), event)
        for source, target, events in re.findall(
            r"^ +(\w+) --> (\w+) : (.+)$", diagram_as_mermaid(), re.MULTILINE
        )
        for event in events.split(", ")
    }
    assert drawn == {
        (state, target, event.value)
        for state, row in TRANSITIONS.items()
        for event, target in row.items()
        if target is not state
    }


@pytest.mark.sampled(
    "one kind for each reaction in each layer, and one of those that may end either way",
    alike=lambda kind: (kind.reaction, kind.reaction is not Reaction.EITHER and kind.layer),
)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_fault_is_noticed_and_ends_as_promised(chain, kind):
    """Each in a copy of one chain in motion, so that no test depends on another."""
    draw = random.Random(kind.name)
    values = draw_values(kind, draw, chain.rig)
    trial = in_a_fork(lambda: run_trial(chain, kind, values, draw.randrange(1 << 30)))
    assert trial.problem == ""
    assert trial.peak_pressure < chain.rig.supply_gauge_pressure + 1.0


def test_a_trial_finds_fault_with_a_chain_that_does_not_keep_its_promise(chain):
    """Without watchdog and checks the same fault is out of bounds."""

    def spoilt() -> Trial:
        for board in chain.sim.boards.values():
            board._watchdog = math.inf
        return run_trial(chain, kind_called("driver_killed"), {}, 1)

    assert in_a_fork(spoilt).problem
    harmless = kind_called("pressure_noisier")
    quiet = in_a_fork(lambda: run_trial(chain, harmless, {"amplitude": 0.0}, 1))
    assert "noticed by" in quiet.problem


def test_the_model_of_the_chain_tells_forces_and_nothing_once_it_is_deaf(chain):
    def look() -> Trial:
        told = [*chain.estimate.joint_torques, *chain.estimate.muscle_forces]
        known = all(map(math.isfinite, told)) and not chain.estimate.problems
        trial = run_trial(chain, kind_called("driver_killed"), {}, 1)
        silent = all(map(math.isnan, chain.estimate.joint_torques))
        return Trial("", {}, [str(known), str(silent), *trial.noticed], problem=trial.problem)

    trial = in_a_fork(look)
    assert trial.problem == ""
    assert trial.noticed[:2] == ["True", "True"]
    assert "model" in trial.noticed


@pytest.mark.sampled("each step once, with or without a command on its way")
@pytest.mark.parametrize("on_way", [True, False])
@pytest.mark.parametrize(
    ("by", "refusal"),
    [(3600.0, "old"), (0.12, "old"), (0.05, ""), (0.005, ""),
     (-0.005, ""), (-0.05, "stamp"), (-3600.0, "stamp")],
)  # fmt: skip
def test_a_clock_step_meets_the_stamp_of_a_command_on_its_way(chain, by, refusal, on_way):
    """One command is refused by its stamp, or none; the joint goes on either way."""

    def step() -> Trial:
        while bool(chain.on_way) is not on_way:
            chain.step()
        return run_trial(chain, kind_called("clock_step"), {"by": by}, 1)

    trial = in_a_fork(step)
    assert trial.problem == ""
    assert {"old", "stamp"} & set(trial.noticed) == ({refusal} if refusal and on_way else set())


def test_a_driver_that_goes_on_finds_one_command_with_its_age(chain):
    """The topic keeps the newest; after a long stop it is refused as old, not taken as fresh."""

    def look() -> Trial:
        chain.driver_runs = False
        heard = chain.driver.intake.accepted
        until = chain.now + 0.3
        while chain.now < until:
            chain.step()
        waiting = len(chain.on_way)
        chain.driver_runs = True
        chain.controller_runs = False
        chain.step()
        late = chain.driver.intake.accepted - heard
        return Trial("", {}, [str(waiting), str(late), *chain.noticed])

    seen = in_a_fork(look).noticed
    assert int(seen[0]) <= 2
    assert seen[1] in {"0", "1"}


def test_a_hung_board_is_held_to_the_driver_s_reaction_and_not_to_its_own_reset(chain):
    """With a driver that does not look, the board's reset alone is no success."""
    kind = kind_called("board_frozen")
    values = {"reset_after": 0.3}
    trial = in_a_fork(lambda: run_trial(chain, kind, values, 1))
    assert trial.problem == ""
    assert trial.stopped_after <= kind.bound < 0.25 < trial.safe_after

    def inattentive() -> Trial:
        # overlooks sensors that are silent until long after the bound
        object.__setattr__(chain.driver._settings, "sensor_timeout", 0.25)
        return run_trial(chain, kind, values, 1)

    spoilt = in_a_fork(inattentive)
    assert spoilt.problem
    assert spoilt.stopped_after > kind.bound + 0.05


@pytest.mark.parametrize(
    "kind",
    [kind for kind in KINDS if kind.reaction not in STOPS],
    ids=lambda kind: kind.name,
)
def test_a_joint_that_need_not_stop_is_held_to_its_error(chain, kind):
    """Also where a fault may end either way: the error counts while air moves."""
    bound = error_bound(kind, bounds_of(chain.rig))
    trial = Trial(kind.name, {}, list(kind.detected_by), peak_error=bound - 1e-3)
    assert problem_of(chain, kind, trial) == ""
    trial.peak_error = bound + 1e-3
    assert "angle off by" in problem_of(chain, kind, trial)


def test_a_fault_that_hides_the_angle_may_move_the_joint_within_its_limits_and_no_further(chain):
    kind = kind_called("encoder_drift")
    limits = chain.rig.joints[0].position_limits
    stop = chain.rig.plausibility.position_margin
    bound = error_bound(kind, bounds_of(chain.rig))
    assert bound == pytest.approx(max(limits) + stop + 0.35 + 0.1)
    assert {each.name for each in ALL_KINDS if each.stays is Stays.IN_LIMITS} == {
        kind.name, "encoder_stuck", "acts_at_random", "acts_and_faults_at_random",
        "measurements_of_a_second_node_in_degrees", "measurements_of_a_second_node_in_kpa",
        "recording_played_into_the_rig",
    }  # fmt: skip


def test_a_trial_finds_fault_with_a_model_that_tells_what_is_old(chain):
    def forgetful() -> Trial:
        class Dreamer(type(chain.model)):
            def estimate(self, now):
                last = [stamp for stamp, _ in self._pressures.values()]
                return super().estimate(min([now, *last]))

        chain.model.__class__ = Dreamer
        return run_trial(chain, kind_called("driver_killed"), {}, 1)

    assert in_a_fork(forgetful).problem == "the model publishes an old estimate"


@pytest.mark.sampled("two of the four faults", cases=2)
@pytest.mark.parametrize(
    "name", ["pressure_drift", "encoder_drift", "valve_stuck_shut", "muscle_burst"]
)
def test_a_fault_that_grows_is_suspected_before_it_stops_the_joint(chain, name):
    kind = kind_called(name)
    values = {key: low for key, (low, _) in kind.parameters.items()}
    trial = in_a_fork(lambda: run_trial(chain, kind, values, 3))
    assert trial.problem == ""
    assert any(name.startswith("suspected") for name in trial.noticed)
    assert trial.suspected_after + 0.01 < trial.safe_after


def test_ends_of_a_range_are_drawn_often(rig):
    kind = kind_called("pressure_drift")
    draw = random.Random(1)
    low, high = kind.parameters["rate"]
    drawn = [draw_values(kind, draw, rig)["rate"] for _ in range(200)]
    assert all(low <= value <= high for value in drawn)
    assert drawn.count(low) > 5 and drawn.count(high) > 5


def test_a_board_whose_turn_is_early_by_rounding_sends_each_frame_once():
    """Two heartbeats in a row, overtaking each other, would look like a restart."""
    board = SimulatedPamBoard(0, BoardCodec.from_dbc())
    board.poll(0.0, (0.0, 0.0), (0.0,), 7e5)
    first = board.poll(0.1 - 5e-10, (0.0, 0.0), (0.0,), 7e5)
    again = board.poll(0.101, (0.0, 0.0), (0.0,), 7e5)
    assert 0x700 in [frame_id for frame_id, _ in first]
    assert 0x700 not in [frame_id for frame_id, _ in again]


def test_a_trial_that_crashes_is_no_result(chain, capfd):
    def crash() -> Trial:
        raise RuntimeError("on purpose")

    with pytest.raises(PamError, match="without a result"):
        in_a_fork(crash)
    assert "on purpose" in capfd.readouterr().err


def test_the_command_writes_a_report_and_its_exit_code_is_the_verdict(tmp_path):
    arguments = ["faults", "--check", "--rig", str(ELBOW), "--out", str(tmp_path), "--trials", "2"]
    assert main([*arguments, "--kind", "vent_called", "--kind", "encoder_jump"]) == 0
    assert len(json.loads((tmp_path / "faults.json").read_text())) == 2
    assert "encoder_jump" in (tmp_path / "faults.md").read_text()
    page = tmp_path / "page.md"
    assert main([*arguments, "--kind", "vent_called", "--page", str(page)]) == 0
    assert "pam check faults --rig" in (text := page.read_text())
    assert "--trials 2 --kind vent_called --seed 1 --page" in text
    assert (tmp_path / "faults.png").stat().st_size > 1000
    assert main([*arguments, "--kind", "no_such"]) == 2
    assert main([*arguments, "--rig", str(tmp_path / "none.yaml")]) == 2


def test_the_report_escapes_what_it_shows_and_names_failures(tmp_path):
    kind = next(kind for kind in KINDS if kind.reaction is Reaction.VENT)
    trial = Trial(
        kind.name, {}, ["<script>"], safe_after=0.5, peak_error=0.1, problem="<b>late</b>"
    )
    page = write_report([kind], [trial], tmp_path).read_text()
    assert "<b>" not in page
    assert "<script>" not in page
    assert "1 of 1 fail" in page


@pytest.mark.parametrize(
    ("kind", "count"),
    [("lost", 0), ("repeated", 2), ("corrupted", 1), ("wrong_length", 1), ("foreign", 2)],
)
def test_frame_faults_hit_one_direction_for_a_time(kind, count):
    faults = FrameFaults(1)
    faults.faults.append(FrameFault(kind, "down", 1.0, 0.0, 5.0))
    assert len(faults.pass_on(FRAME, "down", 1.0)) == count
    assert faults.pass_on(FRAME, "up", 1.0) == [FRAME]
    assert faults.pass_on(FRAME, "down", 5.0) == [FRAME]
    assert faults.hit == 1


def test_late_frames_come_later_in_order():
    faults = FrameFaults()
    faults.faults.append(FrameFault("late", "up", 1.0, 0.01, math.inf))
    later = [(0x200 + k, b"") for k in range(3)]
    for k, frame in enumerate(later):
        assert faults.pass_on(frame, "up", 0.001 * k) == []
    assert faults.due("up", 0.009) == []
    assert faults.due("up", 0.0115) == later[:2]
    assert faults.due("up", 1.0) == later[2:]


def test_a_corrupted_command_never_passes_the_checksum_by_one_bit(rig):
    codec = BoardCodec.from_dbc()
    from pam_driver.boards.pam_board.codec import ValveCommand

    identifier, data = codec.encode(0, ValveCommand((0.3, -0.2), (True, True), 7))
    for bit in range(64):
        word = int.from_bytes(data, "little") ^ (1 << bit)
        with pytest.raises(FrameError):
            codec.decode(identifier, word.to_bytes(8, "little"))


def test_sensor_faults_change_what_is_shown():
    faults = RigFaults()
    faults.sensors[0, 0] = rig_faults.stuck()
    faults.sensors[0, 1] = rig_faults.drifting(10.0, 1.0)
    faults.sensors[0, POSITION] = rig_faults.offset(0.5)
    assert faults.readings(0, [1.0, 2.0], [0.1], 2.0) == ([1.0, 12.0], [0.6])
    assert faults.readings(0, [5.0, 2.0], [0.1], 3.0) == ([1.0, 22.0], [0.6])
    assert faults.readings(1, [5.0, 2.0], [0.1], 3.0) == ([5.0, 2.0], [0.1])
    faults.clear()
    faults.swapped.add(0)
    assert faults.readings(0, [5.0, 2.0], [0.1], 3.0) == ([2.0, 5.0], [0.1])


def test_a_stuck_valve_ignores_its_board():
    faults = RigFaults()
    kinds = (BoardValve(), BoardValve(True, 6e5))
    faults.valves[0, 0] = 1.0
    faults.valves[0, 1] = math.nan
    assert faults.spools(0, (-1.0, 3e5), kinds) == (1.0, 3e5)
    assert faults.spools(0, (-1.0, 0.0), kinds) == (1.0, 3e5)
    assert faults.spools(1, (-1.0, 0.0), kinds) == (-1.0, 0.0)


def test_a_frozen_board_holds_its_valves_until_its_hardware_watchdog_bites(chain):
    def look() -> Trial:
        board = chain.sim.boards[0]
        chain.sim.faults.frozen[0] = chain.now + 0.05
        held = board.valve_commands
        start = chain.now
        while chain.now < start + 0.045:
            chain.step()
        same = chain.sim.boards[0] is board and board.valve_commands == held
        while chain.now < start + 0.06:
            chain.step()
        state = chain.sim.boards[0].state
        return Trial("", {}, [str(same), state.name])

    assert in_a_fork(look).noticed[0] == "True"
    assert in_a_fork(look).noticed[1] in {BoardState.BOOT.name, BoardState.VENTED.name}


@pytest.mark.parametrize(
    "text", ["", "no_such", "supply_lost share=nan", "supply_lost shear=0.1", "supply_lost share"]
)
def test_bad_injections_are_refused_in_one_line(text, rig):
    with pytest.raises(PamError) as error:
        parse_injection(text, rig)
    assert "\n" not in str(error.value)


def test_values_left_out_lie_in_the_middle(rig):
    assert parse_injection("supply_lost", rig) == ("supply_lost", {"share": 0.2})
    assert parse_injection("supply_lost share=0.1", rig)[1] == {"share": 0.1}


WATCHDOG_TOLD = "vented, latched: board 0: fault: watchdog"


@pytest.mark.parametrize(
    ("name", "stopped", "after", "told", "verdict"),
    [
        ("frames_reordered_down", False, 0.8, "", KEPT),
        ("frames_reordered_down", True, 0.3, WATCHDOG_TOLD, REPEAT),
        ("frames_reordered_down", True, 0.3, "", REPEAT),
        ("frames_reordered_down", True, 0.3, "vented, latched: elbow: noise 0.1 rad", "failed"),
        ("encoder_stuck", True, 0.3, WATCHDOG_TOLD, REPEAT),
        ("encoder_stuck", True, 0.3, "vented, latched: elbow: pressures disagree", KEPT),
        ("encoder_stuck", True, 1.3, "vented, latched: elbow: pressures disagree", REPEAT),
        ("encoder_stuck", False, 1.5, "", "failed"),
        ("host_stall", True, 0.1, WATCHDOG_TOLD, KEPT),
        ("all_frames_lost_down", True, 0.1, WATCHDOG_TOLD, KEPT),
        ("all_frames_lost_down", True, 0.02, WATCHDOG_TOLD, REPEAT),
        ("vent_called", True, 0.0, "", KEPT),
        ("frames_foreign", True, 0.2, WATCHDOG_TOLD, KEPT),
        ("muscle_leak", True, 0.2, WATCHDOG_TOLD, REPEAT),
    ],
)
def test_what_a_busy_host_does_is_tried_again_and_not_held_against_the_fault(
    name, stopped, after, told, verdict
):
    seen = Observation(stopped, False, after, told)
    assert judge(kind_called(name), seen)[0] == verdict


@pytest.mark.parametrize(
    "kind", ["controller_killed", "all_frames_lost_down", "all_frames_lost_up"]
)
def test_time_outs_are_known_by_what_diagnostics_say(chain, kind):
    """The texts are the driver's; a change of them must not make a time-out something else."""

    def look() -> Trial:
        run_trial(chain, kind_called(kind), {"duration": 0.5}, 1)
        told = "; ".join(str(fault) for fault in chain.driver.faults)
        return Trial("", {}, sorted(time_outs(f"vented, latched: {told}")))

    found = in_a_fork(look).noticed
    assert set(found) & set(kind_called(kind).detected_by) or found == ["WATCHDOG"]
    assert time_outs("vented, latched: elbow: noise 0.1 rad; board 0: fault: watchdog") == set()
    refused = "vented, latched: valve_commands: no valid command for 0.1 s; last refused: NaN"
    assert time_outs(refused) == {"command_timeout"}
