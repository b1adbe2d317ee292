"""Gymnasium environments of a robot with its effects, many at once (optional: gymnasium).

The joints of a rig file follow positions that change once in a while. The simulation is that of
the rest of the suite: valves, gas, muscles, friction, sensors, with the effects that the file
names. `Randomisation` draws the numbers of each episode, such as those that a diagnosis left open.

Towers et al.: Gymnasium, a standard interface for reinforcement learning environments, 2024.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from pam_model.bounds import within
from pam_model.errors import PamError
from pam_model.plant.parameters import INDEX, PlantParameters
from pam_model.plant.plant_batch import PlantBatch
from pam_model.plant.simulate import vented_state
from pam_model.rig import Rig
from pam_sim.randomisation import Randomisation

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

PER_JOINT = 5
"""Observed of each joint: position, its change over a period, both pressures, the target."""


@dataclass(frozen=True, slots=True)
class EpisodeTask:
    """What an episode asks for."""

    period: float = 0.02  # between two actions [s]
    seconds: float = 8.0  # length of an episode [s]
    hold: float = 2.0  # how long a target stays [s]
    reach: float = 0.6  # targets are drawn from this share of the position limits [-]
    # what the square of an action costs, where the square of an error in rad costs 1
    effort: float = 1e-3

    def __post_init__(self) -> None:
        for name, unit in (("period", "s"), ("seconds", "s"), ("hold", "s"), ("reach", "-")):
            within(name, getattr(self, name), unit=unit, above=0.0)
        within("reach", self.reach, high=1.0, unit="-")
        within("effort", self.effort, 0.0)


class PamVectorEnv(gym.vector.VectorEnv[Array, Array, Any]):
    """Many robots of one rig file, each with numbers of its own, stepped together.

    An action is a number between -1 and 1 for each muscle, joint after joint, agonist first: the
    spool of a flow valve, or no pressure to `max_pressure` of a regulator. An observation has
    PER_JOINT numbers for each joint: position [rad], velocity by difference [rad/s], both pressures
    over `max_pressure` [-], target [rad]; they are readings of the sensors. The reward is minus the
    sum of the squares of the true errors [rad^2], and minus the `effort` of the action.

    Episodes have equal length and end by truncation; all begin anew with the step after it.

    Parameters
    ----------
    rig : Rig
        The robot with its effects.
    task : EpisodeTask, optional
        What is asked for.
    randomisation : Randomisation, optional
        How the numbers of an episode are drawn; by default, they are those of the rig file.

    Raises
    ------
    PamError
        For a rig of several joints with a supply that sags, because its joints share a reservoir.
    """

    metadata = {  # noqa: RUF012  (as gymnasium declares it)
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        rig: Rig,
        num_envs: int = 1,
        task: EpisodeTask | None = None,
        randomisation: Randomisation | None = None,
    ) -> None:
        within("num_envs", num_envs, 1)
        self.task = EpisodeTask() if task is None else task
        self._randomisation = randomisation or Randomisation({})
        self._nominal = [PlantParameters.from_rig(rig, joint.name) for joint in rig.joints]
        if not self._nominal:
            raise PamError("the rig has no joint; expected at least one")
        self._limits = np.array([joint.position_limits for joint in rig.joints])
        muscles = [
            [rig.muscle(joint.agonist), rig.muscle(joint.antagonist)] for joint in rig.joints
        ]
        self._largest = np.array([[one.max_pressure for one in pair] for pair in muscles])
        regulated = np.array([[one.valve.kind != "flow" for one in pair] for pair in muscles])
        self._offset = np.where(regulated, 0.5 * self._largest, 0.0)
        self._scale = np.where(regulated, 0.5 * self._largest, 1.0)
        n = len(self._nominal)
        self.num_envs = num_envs
        self.single_action_space = Box(-1.0, 1.0, (2 * n,), np.float64)
        self.single_observation_space = Box(-np.inf, np.inf, (PER_JOINT * n,), np.float64)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._batches: list[PlantBatch] = []
        self._steps = round(self.task.seconds / self.task.period)
        self._holds = max(round(self.task.hold / self.task.period), 1)
        self._at = 0
        self._is_over = True
        self._targets = np.zeros((num_envs, n))
        self._positions = np.zeros((num_envs, n))

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode with every robot, vented and at rest; see gymnasium."""
        if seed is not None or getattr(self, "_np_random", None) is None:
            super().reset(seed=seed)
        drawn = [
            self._randomisation.draw(one, self.num_envs, self.np_random) for one in self._nominal
        ]
        self._batches = [self._begun(*pair) for pair in zip(self._nominal, drawn, strict=True)]
        if len(self._batches) > 1 and any(
            values[:, INDEX["supply_droop.conductance"]].any() for values in drawn
        ):
            raise PamError(
                "supply_droop: the joints of a robot share its reservoir, which these environments "
                "do not simulate; use a rig of one joint, or leave the effect out"
            )
        self._at, self._is_over = 0, False
        self._draw_targets()
        everyone = np.full(self.num_envs, True)
        readings = np.stack([batch.observe(everyone) for batch in self._batches], axis=1)
        self._positions = readings[..., 0]
        return self._observed(readings), {}

    def _begun(self, nominal: PlantParameters, values: Array) -> PlantBatch:
        states = np.array([vented_state(replace(nominal, values=row)) for row in values])
        return PlantBatch(nominal, values, states, self.task.period)

    def step(self, actions: npt.ArrayLike) -> tuple[Array, Array, Mask, Mask, dict[str, Any]]:
        """Apply one action with each robot; see gymnasium. After an end, begin anew instead."""
        nobody = np.full(self.num_envs, False)
        if self._is_over:
            observation, info = self.reset()
            return observation, np.zeros(self.num_envs), nobody, nobody, info
        n = len(self._batches)
        given = np.clip(np.asarray(actions, dtype=float), -1.0, 1.0)
        if given.shape != (self.num_envs, 2 * n) or not np.isfinite(given).all():
            raise PamError(
                f"actions {given.shape}: expected finite numbers, ({self.num_envs}, {2 * n})"
            )
        pairs = given.reshape(self.num_envs, n, 2)
        commands = self._offset + self._scale * pairs
        readings = np.stack(
            [batch.step(commands[:, j]) for j, batch in enumerate(self._batches)], axis=1
        )
        true = np.stack([batch.positions for batch in self._batches], axis=1)
        error = self._targets - true
        reward = -(error**2).sum(axis=1) - self.task.effort * (given**2).sum(axis=1)
        self._at += 1
        if self._at % self._holds == 0:
            self._draw_targets()
        self._is_over = self._at >= self._steps
        observation = self._observed(readings)
        return observation, reward, nobody, np.full(self.num_envs, self._is_over), {"error": error}

    def _draw_targets(self) -> None:
        low, high = self.task.reach * self._limits.T
        self._targets = self.np_random.uniform(low, high, (self.num_envs, len(low)))

    def _observed(self, readings: Array) -> Array:
        """Observations from readings (n_env, n_joint, 3)."""
        position = readings[..., 0]
        seen = np.empty((*position.shape, PER_JOINT))
        seen[..., 0] = position
        seen[..., 1] = (position - self._positions) / self.task.period
        seen[..., 2:4] = readings[..., 1:] / self._largest
        seen[..., 4] = self._targets
        self._positions = position
        return seen.reshape(self.num_envs, -1)


class PamEnv(gym.Env[Array, Array]):
    """One robot of a rig file; parameters and errors as for `PamVectorEnv`."""

    metadata = {"render_modes": []}  # noqa: RUF012  (as gymnasium declares it)

    def __init__(
        self,
        rig: Rig,
        task: EpisodeTask | None = None,
        randomisation: Randomisation | None = None,
    ) -> None:
        self._one = PamVectorEnv(rig, 1, task, randomisation)
        self.action_space = self._one.single_action_space
        self.observation_space = self._one.single_observation_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; see gymnasium."""
        super().reset(seed=seed)
        observation, info = self._one.reset(seed=seed)
        return observation[0], info

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply one action; see gymnasium."""
        seen, reward, ended, truncated, info = self._one.step(np.asarray(action)[None])
        told = {name: value[0] for name, value in info.items()}
        return seen[0], float(reward[0]), bool(ended[0]), bool(truncated[0]), told
