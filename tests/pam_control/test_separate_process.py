"""What a running controller has to compute at length is computed in another process."""

import math
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from pam_control.feedback.separate_process import NICE, SeparateProcess
from pam_model.errors import PamError
from pam_model.rig import load_rig

CHANGED = """
import sys
from pathlib import Path
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.separate_process import SeparateProcess
from pam_control.controller import Controller
from pam_control.settings import ControlSettings
from pam_model.rig import load_rig
designs = KeptDesigns(Path(sys.argv[1]))
settings = ControlSettings(safe_delay=0.0, stiffness_grid=(12.0,))
controller = Controller(load_rig("config/elbow.yaml"), settings, designs)
if sys.argv[2] == "separate":
    process = SeparateProcess()
    designs.compute_in(process)
    controller.prepare(settings.replace(phase_margin=0.95))
    process.close()
    print("control" in sys.modules, "scipy.optimize" in sys.modules)
"""


@pytest.fixture
def process():
    started = SeparateProcess()
    yield started
    started.close()


def test_results_and_errors_come_back(process):
    assert process.call(math.hypot, 3.0, 4.0) == 5.0
    with pytest.raises(PamError, match=r"nowhere\.yaml"):
        process.call(load_rig, "nowhere.yaml")
    assert process.call(math.hypot, 5.0, 12.0) == 13.0


def test_it_leaves_the_processor_to_the_nodes(process):
    assert process.call(os.nice, 0) == os.nice(0) + NICE
    assert process.call(os.sched_getscheduler, 0) == os.SCHED_OTHER


def test_a_process_that_dies_is_told_and_replaced(process):
    with pytest.raises(PamError, match=r"computes abort has ended with code -6"):
        process.call(os.abort)
    assert process.call(math.hypot, 3.0, 4.0) == 5.0


def test_a_call_that_takes_too_long_is_given_up_and_the_next_one_is_answered(process):
    with pytest.raises(PamError, match=r"sleep took more than 0\.2 s and was given up"):
        process.call_within(0.2, time.sleep, 60.0)
    assert process.call(math.hypot, 3.0, 4.0) == 5.0


def test_closing_ends_a_call_in_another_thread(process):
    told = []

    def call():
        try:
            process.call(time.sleep, 60.0)
        except PamError as error:
            told.append(str(error))

    thread = threading.Thread(target=call)
    thread.start()
    process.close()
    thread.join(20.0)
    assert not thread.is_alive()
    assert len(told) == 1
    with pytest.raises(PamError, match="the node ends"):
        process.call(math.hypot, 3.0, 4.0)


def test_it_ends_with_the_process_that_it_serves():
    """Also when that one is killed."""
    program = (
        "import os, signal\n"
        "from pam_control.feedback.separate_process import SeparateProcess\n"
        "print(SeparateProcess().call(os.getpid), flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    served_by = Path(f"/proc/{int(told.stdout)}/cmdline")
    end = time.monotonic() + 60.0
    while served_by.exists() and served_by.read_bytes():  # empty: ended, but not collected yet
        assert time.monotonic() < end, "it is still running"
        time.sleep(0.02)


def test_a_changed_setting_brings_no_large_library_into_a_running_controller(tmp_path):
    """Their import stopped the control loop for more than 0.1 s, and the driver vented."""
    words = [sys.executable, "-c", CHANGED, str(tmp_path)]
    subprocess.run([*words, "here"], check=True, timeout=120)  # designs the gains of the start
    told = subprocess.run(
        [*words, "separate"], capture_output=True, text=True, check=True, timeout=120
    )
    assert told.stdout.split() == ["False", "False"]
    assert len(list(tmp_path.glob("*.gains.json"))) == 2
