"""What a cycle of the driver costs, counted in calls, because times depend on the machine."""

import sys
from collections import deque
from statistics import median

from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.robot import compose
from pam_sim.simulated_rig import SimulatedRig

PERIOD = 0.002
CYCLES = 300
MOST = 420
"""Calls in a usual cycle of one joint, those of built-in functions included. There were 380 when
this was written, and 488 before a cycle looked quickly whether anything was wrong at all."""


class Line:
    """A bus that delivers at once."""

    state = BusState.ERROR_ACTIVE

    def __init__(self):
        self.up, self.down = [], deque()

    def receive_all(self, now):
        waiting, self.up = self.up, []
        return waiting

    def send(self, frame_id, data, now):
        self.down.append((frame_id, data))
        return SendOutcome.SENT


def test_a_cycle_of_one_joint_makes_few_calls(rig):
    sim, line = SimulatedRig(rig), Line()
    driver = Driver(rig, line, DriverSettings(), PressurePlausibility(compose(rig), PERIOD))
    position, effort = driver.intake.in_units([0.02] * len(rig.muscles))
    command = NamedCommand(rig.muscle_names, position, (), effort)
    calls, counts = 0, []

    def count(frame, event, argument):
        nonlocal calls
        calls += event in ("call", "c_call")

    for cycle in range(CYCLES):
        now = (1 + cycle) * PERIOD
        while line.down:
            sim.on_frame(*line.down.popleft(), now)
        line.up += [ReceivedFrame(*frame, now) for frame in sim.advance(now)]
        if cycle == 100:
            driver.activate(now)
        elif cycle > 100:
            driver.set_commands(command, now)
        calls = 0
        sys.setprofile(count)
        try:
            driver.cycle(now, now)
        finally:
            sys.setprofile(None)
        counts.append(calls)
    assert driver.state is SafetyState.ACTIVE, driver.faults
    assert median(counts[150:]) < MOST
