"""The commands in the blocks of the pages are carried out, or there is a reason why not."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pam_model import MuscleGeometry, create_force_model

from .pages import PAGES, ROOT, commands_in_blocks

NOT_RUN = {
    r"sudo |echo .*\| sudo": "changes the machine",
    r"candump |firmware/out/|.*--channel |.*pam_driver\.driver_node ": "needs a bus; tests/system",
    r"(\w+=\S+ )?rosdep |colcon |source |export |ros2 ": "needs a ROS installation; tests/system",
    r"make |.*pam_model compare |.*pytest |.*benchmarks/|.*pam_demo ": "takes minutes",
    r".*pam_check (blind|sensitivity) ": "takes hours",
    r".*pam_check rough-rig": "takes minutes; tests/pam_check runs its parts",
    r".*examples/": "tests/examples runs it",
    r".*pam_gap (diagnose|fleet|import|compare) ": "needs recordings; tests/pam_gap runs it",
    r".*pam_gap record ": "needs a running robot; tests/pam_gap runs it",
    r".*pam_model gallery|.*--page docs/": "rewrites pages of this project",
    r"firmware": "is built by tests/firmware",
}
"""What is not carried out here, and why; a command that matches none of these is."""

COMMANDS = sorted({command for page in PAGES for command in commands_in_blocks(page.read_text())})


def reasons(command: str) -> list[str]:
    return [reason for pattern, reason in NOT_RUN.items() if re.match(pattern, command)]


RUN = [command for command in COMMANDS if not reasons(command)]


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the pages speak of."""
    folder = tmp_path_factory.mktemp("desk")
    (folder / "config").symlink_to(ROOT / "config")
    (folder / "tests").symlink_to(ROOT / "tests")
    (folder / "out").mkdir()
    for name in ("my_robot.yaml", "my_rig.yaml"):
        shutil.copy(ROOT / "config/elbow.yaml", folder / name)
    shutil.copy(ROOT / "src/pam_bringup/config/security_policy.xml", folder / "my_policy.xml")
    muscle = create_force_model("tondu_lopez", MuscleGeometry(0.25, 2.0, 0.23), {"k": 1.2})
    rows = ["length,pressure,force"]
    rows += [
        f"{length},{pressure},{muscle.force(pressure, length):.2f}"
        for pressure in (2e5, 3e5, 4e5)
        for length in (0.19, 0.20, 0.21, 0.22, 0.23)
    ]
    (folder / "points.csv").write_text("\n".join(rows))
    return folder


@pytest.mark.parametrize("command", RUN)
def test_a_command_does_what_the_page_says(command: str, desk: Path) -> None:
    words = shlex.split(command)
    assert Path(words[0]).name == "python", "neither run nor in the table of reasons"
    asks = "new-rig" in words
    if asks:
        (desk / words[words.index("new-rig") + 1]).unlink(missing_ok=True)
    ended = subprocess.run(
        [sys.executable, *words[1:], *(["--defaults"] if asks else [])],
        cwd=desk,
        env=os.environ | {"MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr


def test_every_reason_not_to_run_a_command_is_needed() -> None:
    for pattern in NOT_RUN:
        assert any(re.match(pattern, command) for command in COMMANDS), pattern
