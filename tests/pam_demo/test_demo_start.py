"""How the demo starts: it waits for the simulated boards, and moves the joint that is asked for."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from std_srvs.srv import Trigger

from pam_control.controller_health import ControllerHealth
from pam_demo.demo import SIMULATING, chosen_joint, perform
from pam_demo.motions import arm_motion
from pam_demo.player import NotPlayedError
from pam_demo.player_node import LostAnswerError, PlayerNode
from pam_model.errors import PamError
from pam_model.rig import load_rig
from pam_sim import rig_node

TWO_BUSES = Path(__file__).parents[2] / "config/two_buses.yaml"


class SlowRig:
    """A rig's process that compiles for a long time."""

    def __init__(self, log: list[str]) -> None:
        self._log = log

    def wait_for_output(self, text: str, timeout: float) -> None:
        assert timeout >= 300.0  # a busy host takes minutes to compile the plant
        self._log.append(f"waited for {text}")


class LoggedChain:
    """Notes what is started, and starts nothing."""

    def __init__(self) -> None:
        self.log: list[str] = []
        self.processes: dict[str, Any] = {}
        self.params_files = [Path("rig.yaml")]
        self.environment: dict[str, str] = {}

    def start(self, name: str, parameters: Any = None) -> Any:
        self.log.append(f"started {name}")
        return SlowRig(self.log)

    def start_robot(self, parameters: Any = None) -> Any:
        self.log.append("started robot")
        assert parameters["driver"]["activate_on_start"]
        assert "loop.rate" in parameters["controller"]
        return SlowRig(self.log)

    def stop(self, name: str) -> int:
        self.log.append(f"stopped {name}")
        return 0

    def check(self) -> None:
        pass


def test_the_driver_is_started_only_when_the_rig_has_compiled_its_plant(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Else its time to wait for the boards passes while a busy host compiles."""
    for separate in (True, False):
        log = performed(monkeypatch, tmp_path, separate=separate)
        assert log[:2] == ["started rig", "waited for simulating"]
        assert log[2] == ("started driver" if separate else "started robot")


def performed(monkeypatch: pytest.MonkeyPatch, folder: Path, *, separate: bool) -> list[str]:
    """What the demo starts and stops for two control laws."""
    monkeypatch.setattr("pam_demo.demo.NodeProcess", lambda *_, **__: None)
    monkeypatch.setattr("pam_demo.demo._play", lambda *_: (0.0, []))
    chain = LoggedChain()
    calls = ("wait_for_driver", "wait_for_controller", "vent", "activate")
    player = SimpleNamespace(**{name: lambda *_: None for name in calls})
    plays = [(law, arm_motion()) for law in ("full", "pressure_ratio_pid")]
    perform(chain, player, folder, plays, {}, separate=separate)  # type: ignore[arg-type]
    return chain.log


def test_another_law_starts_the_process_of_the_controller_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    together = performed(monkeypatch, tmp_path, separate=False)[2:]
    assert together == ["started robot", "stopped robot", "started robot"]
    apart = performed(monkeypatch, tmp_path, separate=True)[2:]
    assert apart == ["started driver", "started model", "started controller",
                     "stopped controller", "started controller"]  # fmt: skip


def test_the_rigs_node_says_that_it_simulates_in_the_words_for_which_the_demo_waits() -> None:
    assert f'info(f"{SIMULATING} ' in Path(rig_node.__file__).read_text()


def test_a_joint_that_the_rig_lacks_is_refused_by_name() -> None:
    rig = load_rig(TWO_BUSES)
    assert chosen_joint(rig, "") == "shoulder"
    assert chosen_joint(rig, "elbow") == "elbow"
    with pytest.raises(PamError, match="--joint: unknown joint 'wrist'; known: shoulder"):
        chosen_joint(rig, "wrist")


class FaultyDriver:
    """A driver whose activation at start-up ended with a latched fault, since the host was busy."""

    def __init__(self, player: PlayerNode) -> None:
        self.state = State.PRIMARY_STATE_INACTIVE
        self.cleared = False
        self.refused = 0
        self.lost = 0  # answers that will not arrive
        self._player = player
        player._fault = "vented, latched: elbow: no angle for 0.05 s"
        player._call = self.answer  # type: ignore[method-assign]

    def answer(self, kind: Any, name: str, request: Any, check: Any, timeout: float = 0.0) -> Any:
        if self.lost:
            self.lost -= 1
            raise LostAnswerError(f"{name}: no answer within {timeout:g} s")
        active = self.state == State.PRIMARY_STATE_ACTIVE
        if kind is GetState:
            return SimpleNamespace(current_state=SimpleNamespace(id=self.state, label="inactive"))
        if kind is Trigger:
            self.cleared = True
            return SimpleNamespace(success=True)
        done = self.cleared and not active
        self.refused += not done
        if done:
            self.state = State.PRIMARY_STATE_ACTIVE
        return SimpleNamespace(success=done)


def test_a_fault_while_the_nodes_start_does_not_end_the_demo() -> None:
    player = PlayerNode.__new__(PlayerNode)
    driver = FaultyDriver(player)
    player.wait_for_driver(50.0, lambda: None)
    assert driver.state == State.PRIMARY_STATE_ACTIVE


def test_a_lost_answer_about_the_state_of_the_driver_does_not_stop_the_demo() -> None:
    """One was lost at the start, and the demo waited ten minutes for it before it gave up."""
    player = PlayerNode.__new__(PlayerNode)
    driver = FaultyDriver(player)
    driver.lost = 3
    player.wait_for_driver(50.0, lambda: None)
    assert driver.state == State.PRIMARY_STATE_ACTIVE
    driver.lost = 100
    with pytest.raises(PamError, match=r"pam_driver/get_state: no answer within 5 s"):
        player.wait_for_driver(5.0, lambda: None)


def test_a_driver_that_is_active_already_is_not_activated_again() -> None:
    """It refuses that, and the demo would ask until its patience ends."""
    player = PlayerNode.__new__(PlayerNode)
    driver = FaultyDriver(player)
    driver.state = State.PRIMARY_STATE_ACTIVE
    player.activate(lambda: None)
    assert driver.refused == 0


def _told(player: PlayerNode, rejected: int, text: str) -> None:
    """Let the player hear what the controller's diagnostics say of its commands."""
    health = ControllerHealth.__new__(ControllerHealth)
    health._name = "pam_controller"
    health._intake = SimpleNamespace(  # type: ignore[assignment]
        rejected=rejected, slowed=0, last_rejection=(text, 0.0), last_note=("", -math.inf)
    )
    player._on_diagnostics(SimpleNamespace(status=[health._commands(0.5)]))


def test_a_motion_that_the_controller_refuses_is_played_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A busy host makes measurements old; nobody would have moved, and the error be the motion."""
    player = PlayerNode.__new__(PlayerNode)
    FaultyDriver(player).state = State.PRIMARY_STATE_ACTIVE
    player._fault = player._refused = ""
    player._refusals = 0
    monkeypatch.setattr("rclpy.spin_once", lambda *_, **__: None)
    player._send_stiffness = lambda *_: None  # type: ignore[method-assign]
    player._send_trajectory = lambda *_: _told(  # type: ignore[method-assign]
        player, 1, "joint_trajectory: trajectory rejected: positions are 51 ms old"
    )
    with pytest.raises(NotPlayedError, match="positions are 51 ms old"):
        player.play(arm_motion(), lambda: None, lambda _: None)
    player._refused = ""
    _told(player, 1, "joint_trajectory: trajectory rejected: positions are 51 ms old")
    assert player._refused == "", "told again, of the same message"
