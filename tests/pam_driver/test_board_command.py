"""`pam driver check-board` as a process, against a simulated board in another process."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pam_demo.chain import BusChoice, multicast_bus
from pam_driver.can_bus.bus import open_bus
from support.processes import end
from support.rigs import ELBOW

# what a shared machine may delay: the simulated board runs in real time on it
TIMED = {"heartbeat", "status_period", "measurement_period", "watchdog_time", "repeated_counter"}
# what needs a person, or a limit that the supply can reach
UNTRIED = {"over_pressure", "restart", "emergency_stop", "enabling_switch"}
PATIENCE = 120.0


@pytest.fixture(scope="module")
def bus() -> Iterator[BusChoice]:
    """A bus with the elbow's board 0."""
    bus = multicast_bus()
    command = [sys.executable, "-m", "pam_sim", "rig", "--rig", str(ELBOW)]
    command += ["--interface", bus.interface, "--channel", bus.channel, "--port", str(bus.port)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    port = open_bus(bus.interface, bus.channel, port=bus.port)
    try:
        waited = 0
        while not port.receive_all(0.0):
            waited += 1
            assert process.poll() is None and waited < PATIENCE / 0.1
            subprocess.run(["sleep", "0.1"], check=True)
        yield bus
    finally:
        port.close()
        end(process)


def check(bus: BusChoice, *options: str, answer: str = "") -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pam_driver", "check-board", "--tolerance", "0.05"]
    command += ["--interface", bus.interface, "--channel", bus.channel, "--port", str(bus.port)]
    return subprocess.run(
        [*command, *options],
        input=answer,
        check=False,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


@pytest.mark.long("test_board_rules plays the same rules against the same board without a process")
@pytest.mark.system
def test_the_simulated_board_keeps_the_rules_in_real_time(bus: BusChoice, tmp_path: Path) -> None:
    page = tmp_path / "board.html"
    done = check(bus, "--yes", "--json", "--out", str(page))
    assert done.returncode == 0, done.stderr
    rules = {rule["rule"]: rule for rule in json.loads(done.stdout)["rules"]}
    passed = {name for name, rule in rules.items() if rule["verdict"] == "pass"}
    assert set(rules) - passed <= TIMED | UNTRIED, done.stdout
    assert "watchdog_latches" in page.read_text()


@pytest.mark.long("test_board_rules asks the same question and opens nothing without permission")
@pytest.mark.system
def test_valves_open_only_after_a_yes(bus: BusChoice, tmp_path: Path) -> None:
    done = check(bus, "--json", "--out", str(tmp_path / "board.md"), answer="no\n")
    assert done.returncode == 0, done.stderr
    assert "the joint moves" in done.stderr
    verdicts = {rule["rule"]: rule["verdict"] for rule in json.loads(done.stdout)["rules"]}
    assert verdicts["watchdog_time"] == verdicts["enable_bits"] == "not tried"
    assert verdicts["echo"] == "pass"


@pytest.mark.sampled("one of the three mistakes", cases=1)
@pytest.mark.system
@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--board", "3"), "no frame from board 3"),
        (("--board", "16"), "expected 0 to 15"),
        (("--over-pressure", "100000"), "must be above --max-pressure"),
    ],
)
def test_a_mistake_is_one_line(bus: BusChoice, options: tuple[str, ...], expected: str) -> None:
    done = check(bus, *options)
    assert done.returncode == 2
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1
    assert expected in done.stderr
