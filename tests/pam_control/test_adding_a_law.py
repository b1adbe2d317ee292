"""A control law of another package: one file, one entry point; its parameter is everywhere."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pam_check.doc_pages.parameter_tables import controller_parameters_table
from pam_control.controller import Controller
from pam_control.controller_parameters import create_controller, law_from, parameter_table
from pam_control.laws import registry
from pam_control.laws.registry import laws
from pam_control.node_parameters import declared_parameters
from pam_control.parameter_file import yaml_text
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.errors import PamError

ROOT = Path(__file__).parents[2]
SOFT_LAW = '''
"""The model-based law at a share of the commanded stiffness."""

from dataclasses import dataclass, replace
from typing import ClassVar

from pam_control.declared import declared
from pam_control.laws.law import Law
from pam_control.laws.position_stiffness import PositionStiffness, PositionStiffnessState

FULL = PositionStiffness()


@dataclass(frozen=True)
class Soft(Law[PositionStiffnessState]):
    name: ClassVar[str] = "soft"

    share: float = declared("soft.share", 0.5, "-", 0.1, 1.0, "share of the commanded stiffness")

    def cases(self, models, settings):
        return FULL.cases(models, settings)

    def init(self, models):
        return FULL.init(models)

    def begin(self, models, state, start):
        return FULL.begin(models, state, start)

    def plan(self, models, state, request):
        return FULL.plan(models, state, replace(request, stiffness=self.share * request.stiffness))


class NoLaw:
    name = "no_law"


@dataclass(frozen=True)
class Torque(Soft):
    name: ClassVar[str] = "torque"


@dataclass(frozen=True)
class Other(Soft):
    name: ClassVar[str] = "other"

    speed: float = declared("float.speed_limit", 1.0, "rad/s", 0.0, 2.0, "another meaning")
'''


def install(folder: Path, *entries: str) -> None:
    """Make the package `soft_laws` with these entry points."""
    (folder / "soft_laws.py").write_text(SOFT_LAW)
    metadata = folder / "soft_laws-1.0.dist-info"
    metadata.mkdir(exist_ok=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: soft-laws\nVersion: 1.0\n")
    lines = "\n".join((f"[{registry.GROUP}]", *entries))
    (metadata / "entry_points.txt").write_text(lines + "\n")


@pytest.fixture
def other_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder for packages that are found."""
    monkeypatch.syspath_prepend(tmp_path)
    laws.cache_clear()
    yield tmp_path
    laws.cache_clear()
    sys.modules.pop("soft_laws", None)


def test_a_law_of_another_package_brings_its_parameter_to_every_place(other_package, rig):
    before = {each.name for each in parameter_table(["elbow"])}
    install(other_package, "soft = soft_laws:Soft")
    laws.cache_clear()
    entries = {each.name: each for each in parameter_table(["elbow"])}
    assert set(entries) - before == {"soft.share"}
    assert entries["soft.share"].description == "share of the commanded stiffness (law soft)"
    assert entries["law"].description.endswith("gravity_compensation or soft")
    assert "| `soft.share` | `0.5` | -; 0.1, 1 |" in controller_parameters_table()
    assert "    soft:\n      # share of the commanded stiffness (law soft)\n      share: 0.5" in (
        yaml_text()
    )
    values = {name: each.default for name, each in entries.items()}
    assert law_from({**values, "law": "soft", "soft.share": 0.25}).share == 0.25
    controller = create_controller(rig, {**values, "law": "soft", "soft.share": 0.7}, ["elbow"])
    assert controller.prepared.law.share == 0.7


def test_the_node_reads_checks_and_explains_the_parameter_of_such_a_law(other_package):
    """In the node's own program: the file is read as ROS reads it, and refused by name."""
    install(other_package, "soft = soft_laws:Soft")
    path = os.pathsep.join((str(other_package), os.environ.get("PYTHONPATH", "")))
    file = other_package / "mine.yaml"
    file.write_text(
        "/**/pam_controller:\n  ros__parameters:\n    law: soft\n    soft: {share: 7.0}\n"
    )

    def control(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "pam_control", *words],
            env={**os.environ, "PYTHONPATH": path, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"},
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip

    assert "control parameters" in control("node", "--help").stdout
    told = control("parameters").stdout
    assert (
        "    soft:\n      # share of the commanded stiffness (law soft)\n      share: 0.5" in told
    )
    rig = str(ROOT / "config" / "elbow.yaml")
    refused = control("node", "--ros-args", "--params-file", rig, "--params-file", str(file))
    assert refused.returncode != 0
    assert "soft.share = 7 -: must be from 0.1 to 1" in refused.stdout + refused.stderr


def test_such_a_law_controls_and_its_parameter_changes_while_it_runs(
    other_package, rig, closed_loop
):
    install(other_package, "soft = soft_laws:Soft")
    laws.cache_clear()
    soft = laws()["soft"]
    controller = Controller(rig, ControlSettings(stiffness_rate=100.0), law=soft())
    loop = closed_loop(controller)
    loop.run(1.0)
    whole = controller.stiffness_commands[0]
    assert controller.channels[0].telemetry.stiffness == pytest.approx(0.5 * whole)
    controller.change(controller.settings, soft(share=0.8))
    loop.run(0.5)
    assert controller.channels[0].telemetry.stiffness == pytest.approx(0.8 * whole)
    with pytest.raises(PamError, match="can only be changed by a restart"):
        controller.change(controller.settings, laws()["impedance"]())


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("soft = soft_laws:Missing", "soft .soft_laws:Missing. cannot be loaded"),
        ("no_law = soft_laws:NoLaw", "soft_laws:NoLaw: is not a subclass of Law with the name"),
        ("other_name = soft_laws:Soft", "is not a subclass of Law with the name other_name"),
        ("torque = soft_laws:Torque", "two control laws are called torque"),
        ("other = soft_laws:Other", "other declares float.speed_limit, which is another parameter"),
    ],
)
def test_a_law_that_cannot_be_used_is_named(other_package, entry, said):
    install(other_package, entry)
    laws.cache_clear()
    with pytest.raises(PamError, match=said):
        laws()


def test_each_field_of_settings_and_laws_is_a_parameter():
    """Nothing is declared twice, and a default that a file gives is the default of the field."""
    values = {each.key: each.default for each in declared_parameters(())}
    assert len(values) == len(declared_parameters(()))
    for name, law in laws().items():
        assert law_from({**values, "law": name}) == law()


@pytest.mark.parametrize("name", [law.name for law in registry.OWN])
def test_a_law_keeps_nothing_in_itself(rig, closed_loop, name):
    """One object serves two controllers, and neither notices the other."""
    law = laws()[name]()

    def moved(others: int) -> list[tuple[float, ...]]:
        loops = [
            closed_loop(Controller(rig, ControlSettings(), law=law)) for _ in range(1 + others)
        ]
        rows = []
        for tick in range(20):
            for index, loop in enumerate(loops):
                if tick == 5 and not loop.controller.reason_against_motion():
                    goal = [TrajectoryPoint(1.0, [0.2 - 0.3 * index])]
                    loop.controller.references.follow(["elbow"], goal, start=None, now=loop.time)
                rows += loop.run(0.02).rows if index == 0 else loop.run(0.02).rows[:0]
        return rows

    assert moved(0) == moved(1)
