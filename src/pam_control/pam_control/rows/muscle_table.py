"""Which muscles turn which joint, as places of rows: made once from the robot.

Every muscle that turns a joint has a row in the tables of the pressure loops (`loop_rows`), in the
order of the robot. A joint has a row in the tables of the cycle (`plan_rows`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pam_model.plant.compiled import for_kernel
from pam_model.plant.layout import constants_of
from pam_model.robot import Robot

O_JOINT, O_NUMBERS, O_PLACE = range(3)
"""Of a muscle: the row of its joint, where its constants begin in those of this joint, and its
place in the robot."""


@dataclass(frozen=True, slots=True, eq=False)
class MuscleTable:
    """The rows of all muscles and joints."""

    places: tuple[int, ...]  # place of each row's muscle in the robot
    owners: Any  # `O_JOINT` and its like
    owned: Any  # the rows of the muscles that turn a joint, in the order of its arms

    @classmethod
    def of(cls, robot: Robot) -> MuscleTable:
        """The table of a robot; a muscle that turns no joint has no row."""
        places = tuple(muscle.place for muscle in robot.muscles if muscle.arms)
        owned = [[places.index(place) for place in joint.muscles] for joint in robot.joints]
        owners = np.zeros((len(places), 3), dtype=np.int64)
        for joint, rows in enumerate(owned):
            for number, row in enumerate(rows):
                owners[row] = joint, constants_of(number), places[row]
        return cls(places, for_kernel(owners), for_kernel(np.array(owned, dtype=np.int64)))
