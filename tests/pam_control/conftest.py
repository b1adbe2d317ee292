"""A closed loop without ROS: controller, delays, sensors and the simulated plant."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.references.trajectory import TrajectoryPoint
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.sensors import SensorFilter
from pam_model.plant.simulate import Plant
from pam_model.rig import Rig, load_rig, rig_from_parameters

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
TICK = 1e-3  # s
QUANTUM = 2.0 * math.pi / 2**14  # rad, a 14 bit encoder


@dataclass
class Record:
    """What happened, one row per control cycle."""

    rows: list[tuple[float, ...]] = field(default_factory=list)

    def column(self, index: int, start: float = -math.inf, end: float = math.inf) -> Any:
        return np.array([row[index] for row in self.rows if start <= row[0] < end])

    def error(self, start: float, end: float = math.inf) -> Any:
        return self.column(1, start, end) - self.column(2, start, end)

    def rms(self, start: float, end: float = math.inf) -> float:
        return float(np.sqrt(np.mean(self.error(start, end) ** 2)))


def _first_reading(plant: Plant) -> tuple[float, ...]:
    """Position and pressures as the plant's sensors show them before it moves."""
    now = plant.output
    return SensorFilter(plant.parameters.values).update(
        0.0, now["position"], [now["agonist.pressure"], now["antagonist.pressure"]]
    )


class ClosedLoop:
    """One or more joints under a controller at 500 Hz; sensors at 500 Hz.

    `before_step(time)` may act on the controller. Rows are time, then for the first joint:
    reference, position, agonist and antagonist pressure, their commands, delivered stiffness.
    """

    def __init__(
        self,
        controller: Controller,
        *,
        measurement_delay: float = 0.001,
        command_delay: float = 0.003,
        pressure_noise: float = 70.0,
        quantum: float = QUANTUM,
        effects: dict[str, float] | None = None,
        state: Any = None,
    ) -> None:
        self.controller = controller
        self.measurement_delay = measurement_delay
        self.command_delay = command_delay
        self.noise, self.quantum = pressure_noise, quantum
        rig = controller.rig
        self.plants = []
        for index in range(len(rig.joints)):
            parameters = PlantParameters.from_rig(rig, index).replaced(effects or {})
            self.plants.append(Plant(parameters, state=state))
        self._shown = [_first_reading(plant) for plant in self.plants]
        self.time = 0.0
        self.ticks = 0
        self._random = random.Random(4)
        self._sensed: deque[tuple[float, list[float], list[float]]] = deque(maxlen=32)
        self._sent: deque[tuple[float, Sequence[float]]] = deque()
        self._applied: Sequence[float] = [0.0] * len(rig.muscles)

    def _true(self) -> tuple[list[float], list[float]]:
        outputs = [plant.output for plant in self.plants]
        positions = [output["position"] for output in outputs]
        pressures = [
            output[f"{side}.pressure"] for output in outputs for side in ("agonist", "antagonist")
        ]
        return positions, pressures

    def run(self, duration: float, before_step: Callable[[float], None] | None = None) -> Record:
        record = Record()
        for _ in range(round(duration / TICK)):
            if self.ticks % 2 == 0:
                self._cycle(record, before_step)
            while self._sent and self._sent[0][0] <= self.time + 1e-9:
                self._applied = self._sent.popleft()[1]
            for index, plant in enumerate(self.plants):
                applied = self._applied[2 * index : 2 * index + 2]
                self._shown[index] = plant.step(applied, TICK)
            self.ticks += 1
            self.time = self.ticks * TICK
        return record

    def _cycle(self, record: Record, before_step: Callable[[float], None] | None) -> None:
        positions, pressures = self._true()
        step = self.quantum
        shown_positions = [shown[0] for shown in self._shown]
        shown_pressures = [pressure for shown in self._shown for pressure in shown[1:]]
        self._sensed.append(
            (
                self.time,
                [round(q / step) * step if step else q for q in shown_positions],
                [p + self._random.gauss(0.0, self.noise) for p in shown_pressures],
            )
        )
        due = [s for s in self._sensed if s[0] <= self.time - self.measurement_delay + 1e-9]
        if not due:
            return
        sampled, seen, felt = due[-1]
        # the controller is told this delay from the sample to the stamp
        stamp = sampled + self.controller.settings.measurement_delay
        if before_step is not None:
            before_step(self.time)
        output = self.controller.step(self.time, Measurement(seen, felt, stamp, stamp))
        assert output.commands is not None, output.reason
        self._sent.append((self.time + self.command_delay, output.commands))
        joint = self.controller.rig.joints[0].name
        record.rows.append(
            (
                self.time,
                self.controller.references.sample(joint, self.time).position,
                positions[0],
                *pressures[:2],
                *output.commands[:2],
                self.controller.channels[0].models.model.stiffness(pressures[:2], positions[0]),
            )
        )


@pytest.fixture(scope="session", autouse=True)
def designs_are_shared(shared_designs: KeptDesigns) -> None:
    """Before any controller is made."""


@pytest.fixture(scope="session")
def rig() -> Rig:
    return load_rig(ELBOW)


@pytest.fixture(scope="session")
def two_joint_rig(rig) -> Rig:
    """An elbow and a heavier, weaker-geared shoulder."""
    tree = rig.to_parameters()
    tree["joints"] = ["shoulder", "elbow"]
    tree["shoulder"] = {**tree["elbow"], "muscles": ["deltoid", "dorsal"], "inertia": 0.08}
    tree["shoulder"]["encoder"] = {"board": 1, "channel": 0}
    tree["shoulder"]["gravity_torque"] = 3.0
    for channel, name in enumerate(("deltoid", "dorsal")):
        tree[name] = {**tree["elbow_flexor"], "board": 1, "channel": channel}
    return rig_from_parameters(tree)


@pytest.fixture(scope="session")
def closed_loop():
    return ClosedLoop


def points_of(position: Callable[[Any], Any], duration: float, every: float = 0.02) -> list[Any]:
    """Waypoints with velocity and acceleration of a smooth motion that starts and ends at rest."""
    h = 1e-4
    points = []
    for index in range(1, round(duration / every) + 1):
        t = index * every
        low, middle, high = position(t - h), position(t), position(t + h)
        velocity = (high - low) / (2 * h) if t < duration - 1e-9 else 0.0
        acceleration = (high - 2 * middle + low) / h**2 if t < duration - 1e-9 else 0.0
        points.append(TrajectoryPoint(t, [middle], [velocity], [acceleration]))
    return points


def _window(t: float, duration: float) -> float:
    x = max(0.0, min(1.0, t, duration - t))
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


@pytest.fixture(scope="session")
def chirp() -> tuple[list[Any], float]:
    """0.1 to 1 Hz in 10 s, 0.3 rad."""
    duration = 10.0

    def position(t: float) -> float:
        phase = 2.0 * math.pi * (0.1 * t + 0.5 * 0.9 / duration * t * t)
        return 0.3 * _window(t, duration) * math.sin(phase)

    return points_of(position, duration), duration


@pytest.fixture(scope="session")
def reaching() -> tuple[list[Any], float]:
    """Like an arm at work: reaches of different size and speed, 2 rad/s at the fastest."""
    duration = 6.0

    def position(t: float) -> float:
        swing = 0.45 * math.sin(1.9 * t) + 0.25 * math.sin(4.1 * t + 0.4) + 0.1 * math.sin(7.3 * t)
        return _window(t, duration) * swing

    return points_of(position, duration), duration
