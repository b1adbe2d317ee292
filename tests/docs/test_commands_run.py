"""The commands in the blocks of the pages are carried out, or there is a reason why not.

They run in a shell that knows nothing but what README says: the folder of the project after
`make setup`, no environment activated, no python on the PATH that has the suite.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from pam_model import MuscleGeometry, create_force_model

from .pages import PAGES, ROOT, commands_in_blocks

NOT_RUN = {
    r"sudo |echo .*\| sudo": "changes the machine",
    r"candump |firmware/out/|.*--channel ": "needs a bus; tests/system",
    r"./pam (driver|control|robot|sim) node |./pam gap (monitor|play) ": "is a node; tests/system",
    r"(\w+=\S+ )?rosdep |colcon |source |export |ros2 ": "needs a ROS installation; tests/system",
    r"make |.*pam model compare |.*pytest |.*benchmarks/|.*pam demo ": "takes minutes",
    r".*pam check (blind|sensitivity) ": "takes hours",
    r".*pam check (rough-rig|trained-policy)": "takes minutes; tests/pam_check runs its parts",
    r".*pam check (calibrate-statement|decide-again) ": "needs a campaign; tests/pam_check has one",
    r".*examples/": "tests/examples runs it",
    r".*pam bringup ": "needs a display; tests/pam_bringup",
    r".*pam gap (calibrate|diagnose|fleet|import|compare) ": "needs recordings; in tests/pam_gap",
    r".*pam gap record ": "needs a running robot; tests/pam_gap runs it",
    r".*pam check pages": "rewrites pages of this project",
    r"git clone ": "needs the network",
    r"firmware": "is built by tests/firmware",
}
"""What is not carried out here, and why; a command that matches none of these is."""

COMMANDS = sorted({command for page in PAGES for command in commands_in_blocks(page.read_text())})


def reasons(command: str) -> list[str]:
    return [reason for pattern, reason in NOT_RUN.items() if re.match(pattern, command)]


RUN = [command for command in COMMANDS if not reasons(command)]


def in_a_fresh_shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """What a shell makes of a command that has neither our environment nor our PATH."""
    return subprocess.run(
        ["/bin/bash", "--noprofile", "--norc", "-c", command],
        cwd=folder,
        env={"HOME": str(folder), "PATH": "/usr/bin:/bin", "MPLBACKEND": "Agg"},
        input="\n" * 99,  # a question is answered with its default
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project's folder as far as the pages use it, with the files that they speak of."""
    folder = tmp_path_factory.mktemp("desk")
    for name in ("pam", ".venv", "config", "tests"):
        (folder / name).symlink_to(ROOT / name)
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
    if new_file := re.search(r"new-rig (\S+)", command):
        (desk / new_file[1]).unlink(missing_ok=True)
    ended = in_a_fresh_shell(command, desk)
    assert ended.returncode == 0, ended.stderr


def test_every_tool_that_a_page_names_is_found_in_a_fresh_shell(desk: Path) -> None:
    """Also those of which no command is carried out here; test_pages.py parses all of them."""
    text = "".join(page.read_text() for page in PAGES)
    tools = sorted(set(re.findall(r"\./pam ([a-z]+)", text)))
    assert {"gap", "driver", "model", "sim", "demo", "check", "control", "bringup"} <= set(tools)
    asked = "; ".join(f"./pam {tool} --help >/dev/null || echo {tool}" for tool in tools)
    ended = in_a_fresh_shell(asked, desk)
    assert (ended.stdout, ended.stderr) == ("", "")


def test_every_reason_not_to_run_a_command_is_needed() -> None:
    for pattern in NOT_RUN:
        assert any(re.match(pattern, command) for command in COMMANDS), pattern


def test_the_python_that_a_user_names_reaches_the_set_up() -> None:
    """docs/install.md: PYTHON=/path/to/python3.12 make setup."""
    rules = "show:\n\t@echo $$PYTHON\n"
    asked = f"PYTHON=/mine make -f Makefile -f - show <<'EOF'\n{rules}EOF"
    assert in_a_fresh_shell(asked, ROOT).stdout == "/mine\n"
