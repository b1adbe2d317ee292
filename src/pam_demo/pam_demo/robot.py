"""`pam demo robot`: the simulated robot, for nodes of one's own, without `ros2 launch`.

The simulated rig, and driver, model and controller in one process, run in the ROS domain of the
terminal until Ctrl-C.
"""

from __future__ import annotations

import time
from pathlib import Path

from pam_demo.chain import Chain, best_bus
from pam_demo.demo import COMPILE_TIMEOUT, SIMULATING, START_TIMEOUT, hidden_settings, node_settings
from pam_demo.loop_rate import RATES
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.rig import load_rig

ACTIVE = "active: valves follow"  # in the line that the driver writes when the robot may move
LOOK_EVERY = 0.5  # s


def _pass_on(chain: Chain, said: dict[str, int]) -> None:
    """Print what the nodes warn of; `said` is how many of their lines were looked at."""
    for name, process in chain.processes.items():
        lines = process.output.splitlines()
        for line in lines[said.get(name, 0) :]:
            if "[WARN]" in line or "[ERROR]" in line:
                print(f"{name}: {line}", flush=True)
        said[name] = len(lines)


def run(given: Arguments) -> Outcome:
    """Run the robot until Ctrl-C or SIGTERM, which lower the arm and vent it.

    Raises
    ------
    PamError
        When a node does not start, or ends by itself; the message has its last output.
    """
    rig_path = chosen_rig(given)
    rig = load_rig(rig_path)
    plant = hidden_settings(rig, given.true_effects)
    bus = best_bus(given.can)
    chain = Chain([rig_path], bus, {})
    settings = node_settings(given.rate or RATES[0])
    out: Path = given.out
    out.mkdir(parents=True, exist_ok=True)
    print(f"rig {rig_path}, bus: {bus}; starting (the first start takes a minute)", flush=True)
    try:
        with chain:
            # before the boards simulate, none answers the driver
            boards = chain.start("rig", plant | settings["rig"])
            boards.wait_for_output(SIMULATING, COMPILE_TIMEOUT)
            if given.separate:
                chain.start("controller", settings["controller"])
                chain.start("model")
                driver = chain.start("driver", settings["driver"])
            else:
                driver = chain.start_robot(
                    {name: settings[name] for name in ("driver", "controller")}
                )
            driver.wait_for_output(ACTIVE, START_TIMEOUT)
            print(f"{', '.join(rig.joint_names)}: ready to move; Ctrl-C ends it", flush=True)
            said: dict[str, int] = {}
            while True:
                chain.check()
                _pass_on(chain, said)
                time.sleep(LOOK_EVERY)
    except KeyboardInterrupt:  # Ctrl-C or SIGTERM; the only way to end it
        pass
    finally:
        chain.write_logs(out)
    print(f"ended; logs of the nodes: {out}")
    return Outcome({"out": out})
