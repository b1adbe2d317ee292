"""Fixtures of all tests: a bus and a ROS domain that no other test or machine shares."""

from __future__ import annotations

import gc
import math
import os
import re
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import pytest

from pam_demo.chain import BusChoice, multicast_bus, private_domain
from pam_model.rig import Rig, load_rig
from pam_ros.transport import leave_out_shared_memory
from support.frames import FrameListener
from support.long_run import mark_the_long_run
from support.probe import Probe
from support.rigs import ELBOW

if TYPE_CHECKING:
    from pam_control.feedback.kept_designs import KeptDesigns

# before rclpy reads it; the processes inherit it
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
leave_out_shared_memory()
# a shell starts a job in the background with this signal ignored, and processes inherit that
signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parents[1]

# A busy host is slow; how long an example takes says nothing about the code.
hypothesis.settings.register_profile("any_host", deadline=None)
hypothesis.settings.register_profile("short_run", deadline=None, max_examples=40)


def is_short(config: pytest.Config) -> bool:
    """Whether the tests of the long run are left out, as `make test` does."""
    return "not long" in config.option.markexpr


def pytest_configure(config: pytest.Config) -> None:
    """Draw fewer examples in the short run, others every time."""
    hypothesis.settings.load_profile("short_run" if is_short(config) else "any_host")


@pytest.hookimpl(tryfirst=True)  # before pytest selects by `-m`
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the long run, and try those tests up to three times that say why they may fail.

    Raises
    ------
    pytest.UsageError
        For a marker without its reason, or one that `tools/test.sh` does not find.
    """
    mark_the_long_run(items)
    for path in {item.path for item in items if item.get_closest_marker("system")}:
        if not re.search(r"\bsystem\b", path.read_text(encoding="utf-8")):
            raise pytest.UsageError(f"{path}: tools/test.sh looks for `system` in the file itself")
    for item in items:
        marker = item.get_closest_marker("rerun_because")
        if marker is None:
            continue
        if len(marker.args) != 1 or len(str(marker.args[0]).split()) < 5:
            raise pytest.UsageError(f"{item.nodeid}: rerun_because needs the reason as a sentence")
        item.add_marker(pytest.mark.flaky(reruns=2))


def pytest_collection_finish() -> None:
    """Take the tests themselves out of the garbage collection.

    A collection over all of them stops every thread of this process for half a second: boards,
    buses and peers that must answer in time.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _nothing_is_compiled_beside(request: pytest.FixtureRequest) -> Iterator[None]:
    """In the short run a faster kernel takes longer to compile than the diagnoses save by it."""
    if not is_short(request.config):
        yield
        return
    from pam_model.plant import compile_beside

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compile_beside, "WORTH", math.inf)
        yield


@pytest.fixture(scope="session")
def rig_path() -> Path:
    """The rig file of one elbow."""
    return ROOT / "config" / "elbow.yaml"


@pytest.fixture(scope="session")
def rig() -> Rig:
    return load_rig(ELBOW)


@pytest.fixture(scope="session")
def make_rig(rig):
    """The elbow with fields of its gas, joint, both muscles or both valves changed."""

    def make(*, gas=None, joint=None, muscle=None, valve=None, **top) -> Rig:
        result = replace(rig, gas=replace(rig.gas, **(gas or {})), **top)
        result = result.with_joint(replace(result.joints[0], **(joint or {})))
        for entry in result.muscles:
            new_valve = replace(entry.valve, **(valve or {}))
            result = result.with_muscle(replace(entry, valve=new_valve, **(muscle or {})))
        return result

    return make


@pytest.fixture(scope="session")
def designs_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all processes of the tests find the designs that are shared."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    return folder / "designs"


@pytest.fixture(scope="session")
def shared_designs(designs_folder: Path) -> Iterator[KeptDesigns]:
    """Joints of equal tasks are designed once for all tests, and for all of their processes.

    Only controllers share that are given no store of designs.
    """
    from pam_control import controller
    from pam_control.feedback.kept_designs import KeptDesigns

    store = KeptDesigns(designs_folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(controller, "KeptDesigns", lambda: store)
        yield store


@pytest.fixture(scope="session")
def slow_host() -> bool:
    """Whether the processor is emulated (see tools/with_vcan.sh): rates must be low, waits long."""
    return os.environ.get("PAM_TEST_SLOW_HOST") == "1"


@pytest.fixture(scope="session")
def patience(slow_host: bool) -> float:
    """Factor for every time-out."""
    return 30.0 if slow_host else 1.0


@pytest.fixture
def ros_environment() -> dict[str, str]:
    """Environment of processes in a ROS domain of their own, on this machine alone."""
    return private_domain()


@pytest.fixture
def bus(request: pytest.FixtureRequest) -> BusChoice:
    """A CAN bus: SocketCAN for tests marked `vcan`, a loopback multicast bus for others."""
    if request.node.get_closest_marker("vcan"):
        channel = os.environ.get("PAM_TEST_CAN_CHANNEL", "vcan0")
        if not Path("/sys/class/net", channel).exists():
            pytest.fail(f"no CAN interface {channel}: run these tests by tools/with_vcan.sh")
        return BusChoice("socketcan", channel)
    return multicast_bus()


@pytest.fixture
def frames(bus: BusChoice) -> Iterator[FrameListener]:
    """What goes over `bus`, from now on."""
    with FrameListener(bus) as listener:
        yield listener


@pytest.fixture
def probe(ros_environment: dict[str, str]) -> Iterator[Probe]:
    """A node in the test's ROS domain."""
    with Probe(ros_environment) as node:
        yield node
