"""Joints that move each other: sticking, sliding and end stops, against an event-driven solver.

The other solver has the textbook's equations of a double pendulum, finds each event by root finding
and tries all combinations of held joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pam_model.body.link import Link
from pam_model.errors import PamError
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.robot_plant import RobotPlant
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config/elbow.yaml"
PERIOD = 2e-3
G = 9.8
BARE = {
    "joint.pulley_radius": 1e-12,  # without muscles
    "joint.viscous_friction": 0.0,
    "joint.gravity_torque": 0.0,
    "joint.inertia": 0.01,
}


@dataclass(frozen=True)
class Pendulum:
    """Two point masses on rods, with dry friction and end stops in the hinges."""

    masses: tuple[float, float] = (1.0, 0.6)
    lengths: tuple[float, float] = (0.4, 0.35)
    static: tuple[float, float] = (0.0, 0.0)  # N m
    sliding: tuple[float, float] = (0.0, 0.0)  # N m
    stribeck: float = 0.5  # rad/s
    stop: float = 100.0  # rad, on both sides
    own: float = BARE["joint.inertia"]

    def links(self) -> list[Link]:
        (m1, m2), (l1, l2) = self.masses, self.lengths
        first, second = np.array([l1, 0.0, 0.0]), np.array([l2, 0.0, 0.0])
        return [Link(mass=m1, centre=first), Link(0, place=first, mass=m2, centre=second)]

    def mass(self, q: np.ndarray) -> np.ndarray:
        (m1, m2), (l1, l2) = self.masses, self.lengths
        c = m2 * l1 * l2 * np.cos(q[1])
        end = m2 * l2**2
        first = (m1 + m2) * l1**2 + end + 2.0 * c
        return np.array([[first + self.own, end + c], [end + c, end + self.own]])

    def bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Gravity acts along x, so that the pendulum hangs at 0."""
        (m1, m2), (l1, l2) = self.masses, self.lengths
        s = m2 * l1 * l2 * np.sin(q[1])
        end = m2 * l2 * G * np.sin(q.sum())
        first = (m1 + m2) * l1 * G * np.sin(q[0])
        return np.array([first + end - s * (2.0 * v[0] * v[1] + v[1] ** 2), end + s * v[0] ** 2])

    def friction(self, v: float, i: int) -> float:
        more = self.static[i] - self.sliding[i]
        return self.sliding[i] + more * float(np.exp(-((v / self.stribeck) ** 2)))

    def energy(self, q: np.ndarray, v: np.ndarray) -> float:
        (m1, m2), (l1, l2) = self.masses, self.lengths
        height = -(m1 + m2) * l1 * np.cos(q[0]) - m2 * l2 * np.cos(q.sum())
        return float(0.5 * v @ self.mass(q) @ v + G * height)

    def plant(self, q: np.ndarray, v: np.ndarray, step: float) -> RobotPlant:
        elbow = PlantParameters.from_rig(load_rig(ELBOW).without_effects())
        parameters = [
            elbow.forced(
                {
                    **BARE,
                    "joint.lower_limit": -self.stop,
                    "joint.upper_limit": self.stop,
                    "stribeck_friction.static_torque": self.static[i],
                    "stribeck_friction.torque": self.sliding[i],
                    "stribeck_friction.speed": self.stribeck,
                }
            )
            for i in range(2)
        ]
        states = [
            initial_state(one, position=q[i], velocity=v[i]) for i, one in enumerate(parameters)
        ]
        return RobotPlant(parameters, step, states, links=self.links(), gravity=(G, 0.0, 0.0))

    def run(self, q: np.ndarray, v: np.ndarray, samples: int, step: float) -> np.ndarray:
        """Angles and speeds after each sample (samples, 4), by the plant."""
        plant = self.plant(q, v, step)
        rows = []
        for _ in range(samples):
            plant.step([(0.0, 0.0)] * 2, PERIOD)
            both = [joint.output for joint in plant.joints]
            rows.append([b["position"] for b in both] + [b["velocity"] for b in both])
        return np.array(rows)


class EventSolver:
    """The same pendulum, from event to event."""

    def __init__(self, pendulum: Pendulum, q: np.ndarray, v: np.ndarray) -> None:
        self.p = pendulum
        self.state = np.concatenate([q, v]).astype(float)
        self.kinds: set[str] = set()

    def bounds(self, q: np.ndarray, i: int) -> tuple[float, float]:
        grip, at = self.p.static[i], 1e-12
        low = -np.inf if q[i] >= self.p.stop - at else -grip
        return low, np.inf if q[i] <= -self.p.stop + at else grip

    def solve(
        self, mass: np.ndarray, right: np.ndarray, held: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        x = np.zeros(2)
        x[~held] = np.linalg.solve(mass[np.ix_(~held, ~held)], right[~held])
        return x, mass @ x - right

    def modes(self) -> tuple[float, float]:
        """By joint: 0 held, or the sign of its motion."""
        q, v = self.state[:2], self.state[2:]
        choices = [(np.sign(v[i]),) if v[i] != 0.0 else (0.0, 1.0, -1.0) for i in range(2)]
        for mode in product(*choices):
            held = np.array(mode) == 0.0
            x, u = self.solve(self.p.mass(q), self.right(q, v, mode), held)
            fits = True
            for i in range(2):
                low, high = self.bounds(q, i)
                if held[i]:
                    fits &= low <= u[i] <= high
                elif v[i] == 0.0:
                    fits &= x[i] * mode[i] > 0.0 and np.isfinite(low if mode[i] > 0.0 else high)
            if fits:
                return mode
        raise AssertionError("no combination of held joints is consistent")

    def right(self, q: np.ndarray, v: np.ndarray, mode: tuple[float, ...]) -> np.ndarray:
        rubs = [mode[i] * self.p.friction(v[i], i) for i in range(2)]
        return -self.p.bias(q, v) - np.array(rubs)

    def rates(self, mode: tuple[float, ...], _: float, y: np.ndarray) -> np.ndarray:
        held = np.array(mode) == 0.0
        x, _held = self.solve(self.p.mass(y[:2]), self.right(y[:2], y[2:], mode), held)
        return np.concatenate([np.where(held, 0.0, y[2:]), x])

    def run(self, samples: int) -> np.ndarray:
        times = np.arange(1, samples + 1) * PERIOD
        rows = np.empty((samples, 4))
        now, end = 0.0, samples * PERIOD
        while now < end - 1e-12:
            mode = self.modes()
            self.kinds |= {("held", "forward", "back")[int(m)] for m in mode}
            events = [one for i in range(2) for one in self.events(i, mode)]
            found = solve_ivp(
                partial(self.rates, mode), (now, end), self.state, "DOP853", events=events,
                rtol=1e-11, atol=1e-12, dense_output=True, max_step=0.02,
            )  # fmt: skip
            inside = (times > now + 1e-12) & (times <= found.t[-1] + 1e-12)
            if inside.any():
                rows[inside] = found.sol(np.minimum(times[inside], found.t[-1])).T
            self.state = found.y[:, -1].copy()
            now = found.t[-1]
            for i in range(2):
                if mode[i] == 0.0:
                    self.state[2 + i] = 0.0
            for event, at in zip(events, found.t_events, strict=True):
                if len(at):
                    event.happens()
        return rows

    def events(self, i: int, mode: tuple[float, ...]) -> list[Callable]:
        low, high = self.bounds(self.state, i)

        def stops(_: float, y: np.ndarray) -> float:
            return y[2 + i]

        def hits(_: float, y: np.ndarray) -> float:
            return self.p.stop - mode[i] * y[i]

        def slips(_: float, y: np.ndarray) -> float:
            right = self.right(y[:2], y[2:], mode)
            u = self.solve(self.p.mass(y[:2]), right, np.array(mode) == 0.0)[1][i]
            return min(high - u, u - low) + 1e-9  # until it is clear that the joint slips

        def at_rest() -> None:
            self.state[2 + i] = 0.0

        def at_stop() -> None:
            self.kinds.add("stop")
            self.state[i] = np.sign(self.state[i]) * self.p.stop
            self.impact()

        found: list[Callable] = []
        named: list[tuple[Callable, Callable, float]] = (
            [(slips, lambda: None, -1.0)]
            if mode[i] == 0.0
            else [(stops, at_rest, -mode[i]), (hits, at_stop, -1.0)]
        )
        for event, happens, direction in named:
            event.terminal, event.direction, event.happens = True, direction, happens  # type: ignore[attr-defined]
            found.append(event)
        return found

    def impact(self) -> None:
        """End stops take the speeds of the joints at them; the impulses move the other ones."""
        q, v = self.state[:2], self.state[2:]
        mass = self.p.mass(q)
        side = np.where(np.abs(q) >= self.p.stop - 1e-9, np.sign(q), 0.0)
        for held in product((False, True), repeat=2):
            x, impulse = self.solve(mass, mass @ v, np.array(held))
            if np.all(np.where(held, impulse * side < 0.0, x * side <= 0.0)):
                self.state[2:] = x
                return
        raise AssertionError("no combination of end stops is consistent")


ROUGH = Pendulum(static=(0.9, 0.4), sliding=(0.5, 0.25))
STILL = np.zeros(2)


@pytest.mark.parametrize(
    ("pendulum", "q", "v", "happens", "error"),
    [
        (ROUGH, (0.3, 0.4), (4.0, -6.0), {"held", "forward", "back"}, 5e-6),
        (ROUGH, (-0.2, 1.2), (0.0, 0.0), {"held", "forward", "back"}, 5e-6),
        (replace(ROUGH, stop=0.5), (0.3, 0.4), (4.0, -6.0), {"held", "stop"}, 5e-4),
        (replace(ROUGH, stop=0.5), (0.5, -0.5), (-5.0, 2.0), {"held", "stop"}, 5e-4),
        (Pendulum(stop=0.5), (0.4, 0.1), (-3.0, 5.0), {"stop"}, 5e-3),
    ],
)
def test_sticking_sliding_and_stops_are_those_of_the_event_solver(
    pendulum: Pendulum,
    q: tuple[float, float],
    v: tuple[float, float],
    happens: set[str],
    error: float,
) -> None:
    """Events cost an error that is small and vanishes with the step."""
    samples = 1000
    other = EventSolver(pendulum, np.array(q), np.array(v))
    truth = other.run(samples)[:, :2]
    assert other.kinds >= happens
    coarse, fine = (
        np.abs(pendulum.run(np.array(q), np.array(v), samples, step)[:, :2] - truth).max()
        for step in (2.5e-4, 2.5e-5)
    )
    assert coarse < error
    assert fine < 0.3 * coarse


def test_a_swing_without_friction_keeps_its_energy() -> None:
    free = Pendulum()
    q, v = np.array([1.5, -0.7]), np.array([2.0, 3.0])
    rows = free.run(q, v, 1000, 2.5e-4)
    energies = np.array([free.energy(row[:2], row[2:]) for row in rows])
    assert np.ptp(rows[:, 1]) > 2.0
    assert np.abs(energies - free.energy(q, v)).max() < 1e-9


def test_friction_takes_exactly_its_work() -> None:
    """Coulomb friction takes its torque times the way of each joint."""
    rough = Pendulum(static=(1.0, 0.5), sliding=(1.0, 0.5))
    q, v = np.array([1.2, 0.3]), np.array([0.0, 4.0])
    rows = np.vstack([np.concatenate([q, v]), rough.run(q, v, 3000, 1e-4)])
    ways = np.abs(np.diff(rows[:, :2], axis=0)).sum(axis=0)
    assert rows[-1, 2:].tolist() == [0.0, 0.0]  # at rest
    lost = rough.energy(q, v) - rough.energy(rows[-1, :2], STILL)
    assert lost == pytest.approx(ways @ np.array(rough.sliding), rel=2e-3)


def test_little_friction_is_nearly_none() -> None:
    """A joint that turns round passes; it does not lose the rest of the step."""
    q, v = np.array([0.9, -0.3]), np.zeros(2)
    almost = Pendulum(static=(1e-7, 1e-7), sliding=(1e-7, 1e-7)).run(q, v, 1000, 2.5e-4)
    none = Pendulum().run(q, v, 1000, 2.5e-4)
    np.testing.assert_allclose(almost, none, atol=1e-5)


def test_a_stuck_joint_does_not_creep_and_the_other_one_swings_like_a_single_pendulum() -> None:
    """The second rod hangs on a joint whose friction is twice its weight."""
    stuck = Pendulum(static=(0.0, 20.0), sliding=(0.0, 20.0))
    q = np.array([0.8, 0.6])
    rows = stuck.run(q, STILL, 1000, 2.5e-4)
    assert np.all(rows[:, 1] == q[1])
    assert np.all(rows[:, 3] == 0.0)

    def rates(_: float, y: np.ndarray) -> list[float]:
        at = np.array([y[0], q[1]])
        return [y[1], -stuck.bias(at, STILL)[0] / stuck.mass(at)[0, 0]]

    time = np.arange(1, 1001) * PERIOD
    truth = solve_ivp(rates, (0.0, 2.0), [q[0], 0.0], "DOP853", time, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(rows[:, 0], truth.y[0], atol=1e-8)


def test_an_end_stop_moves_a_joint_that_friction_holds() -> None:
    """An impulse is more than any friction; the speeds after it are those of M^-1."""
    stop = 0.5
    held = Pendulum(static=(0.0, 5.0), sliding=(0.0, 5.0), stop=stop)
    q, v = np.array([stop - 1e-9, 0.2]), np.array([3.0, 0.0])
    after = held.run(q, v, 1, 1e-6)[0]
    assert after[2] == 0.0
    response = np.linalg.solve(held.mass(q), [1.0, 0.0])
    begin = -response[1] / response[0] * v[0]
    slows = 5.0 / held.mass(q)[1, 1] * PERIOD
    assert begin > 1.0
    assert begin - 2.0 * slows < after[3] < begin


MANY = {
    "hinges": {},
    "Coulomb": {"coulomb_friction.torque": 0.6},
    "Stribeck": {
        "stribeck_friction.static_torque": 1.0,
        "stribeck_friction.torque": 0.4,
        "stribeck_friction.speed": 0.1,
    },
    "presliding": {
        "coulomb_friction.torque": 0.6,
        "coulomb_friction.presliding_angle": 0.01,
        "creep.ratio": 0.2,
    },
    "delay": {"command_delay.delay": 0.005, "tube_restriction.conductance": 2e-9},
}


@pytest.mark.parametrize("effects", MANY.values(), ids=MANY)
def test_joints_without_links_are_those_of_the_single_plant(effects: dict[str, float]) -> None:
    one = PlantParameters.from_rig(load_rig(ELBOW).without_effects()).forced(effects)
    robot, alone = RobotPlant([one, one]), (Plant(one), Plant(one))
    for k in range(600):
        swing = np.sin(9.0 * k * PERIOD), np.sin(3.0 * k * PERIOD)
        commands = [(0.3 * swing[0], 0.02 - 0.3 * swing[0]), (0.2 + swing[1], -swing[1])]
        readings = robot.step(commands, PERIOD)
        for joint, plant, pair, reading in zip(
            robot.joints, alone, commands, readings, strict=True
        ):
            np.testing.assert_allclose(reading, plant.step(pair, PERIOD), rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(joint.state, plant.state, rtol=1e-12, atol=1e-12)
    assert robot.joints[1].output["position"] > 0.99  # near its end stop, where most are


def test_a_link_for_each_joint() -> None:
    one = PlantParameters.from_rig(load_rig(ELBOW))
    with pytest.raises(PamError, match="1 links for 2 joints"):
        RobotPlant([one, one], links=[Link()])
