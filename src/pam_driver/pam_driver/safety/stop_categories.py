"""Which fault gets which stop category, and why.

The categories are those of IEC 60204-1, section 9.2.2, applied to air instead of electric power:

- **0**: every valve opens its exhaust at once. The arm is limp and falls.
- **1**: the driver lowers the joints slowly (`pam_driver.safety.lowering`), then vents. This needs
  sensors, boards, valves and bus that work: a loaded arm is better lowered than dropped, but only
  on measurements that can be trusted.
  After some faults the time for this is short (`BRAKING_TIME`): the joint is braked with the air
  that it has, then everything vents.
- **2**: decelerate and hold. Holding needs a control law, so only the controller can do it; the
  driver knows 0 and 1.

A kind of condition that has no entry here is of category 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from pam_driver.boards.protocol import Condition

BRAKING_TIME: Final = 0.15
"""Longest time in which a joint is braked with the air that it has [s].

A joint on the air of its muscles comes to rest within half a period of its oscillation, 0.14 s for
the elbow at its default stiffness.
"""


class StopCategory(NamedTuple):
    """The stop category of a kind of condition."""

    number: int  # 0 or 1
    reason: str  # why
    longest: float = math.inf  # longest time for lowering, in addition to `lowering_timeout` [s]


_BUS = "commands and measurements no longer arrive reliably"
_BOARD = "the board may not follow its commands"
_SENSOR = "lowering relies on this measurement"
_ONE_MUSCLE: Final = "pressure_implausible"
_DOUBT = "sensor, valve or muscle is not what lowering assumes"

STOP_CATEGORIES: Final[Mapping[str, StopCategory]] = {
    "command_timeout": StopCategory(1, "no commands arrive; sensors, boards and bus work"),
    "driver_paused": StopCategory(1, "the driver runs again; the faults after the pause decide"),
    "internal_error": StopCategory(
        1, "the cycle of the driver still runs; where it does not, everything vents at once"
    ),
    "two_publishers": StopCategory(
        1, "which command is right is unknown; sensors, boards and bus work"
    ),
    "joint_too_fast": StopCategory(
        1, "the muscle that moves the joint empties; the other one brakes", BRAKING_TIME
    ),
    "loop_too_slow": StopCategory(0, "lowering is a loop with the same delay"),
    "supply_low": StopCategory(1, "lowering only lets air out, so it needs no supply"),
    "supply_high": StopCategory(1, "lowering closes the supply side of every valve"),
    "stale_sensor": StopCategory(0, _SENSOR),
    "sensor_intermittent": StopCategory(0, _SENSOR),
    "counter_frozen": StopCategory(0, _SENSOR),
    "over_pressure": StopCategory(0, "the pressure must fall as fast as possible"),
    "board_lost": StopCategory(0, _BOARD),
    "board_fault": StopCategory(0, "the board has vented already"),
    "board_not_active": StopCategory(0, "the board has vented already"),
    "board_restarted": StopCategory(0, "the board has vented already"),
    "board_number": StopCategory(0, _BOARD),
    "command_not_heard": StopCategory(0, _BOARD),
    "protocol_version": StopCategory(0, _BOARD),
    "foreign_command": StopCategory(0, "another driver moves the same valves"),
    "send_blocked": StopCategory(0, _BUS),
    "bus_down": StopCategory(0, _BUS),
    "bus_off": StopCategory(0, _BUS),
    "position_limit": StopCategory(0, "the joint or its encoder is where it cannot be"),
    "pressure_rate": StopCategory(0, _SENSOR),
    "position_jump": StopCategory(0, _SENSOR),
    "sensor_noise": StopCategory(0, _SENSOR),
    "sensor_range": StopCategory(0, _SENSOR),
    _ONE_MUSCLE: StopCategory(
        1,
        "air that enters or leaves one muscle moves the joint; the other one brakes",
        BRAKING_TIME,
    ),
    "torque_implausible": StopCategory(0, _DOUBT),
    "start_up_check": StopCategory(0, _DOUBT),
    "emergency_stop": StopCategory(0, "a person stops the robot, and its board has vented already"),
    "observers_blind": StopCategory(0, "a sensor, valve or muscle that fails is not seen"),
    "exhaust_blocked": StopCategory(0, "every exhaust is open already"),
}


def can_lower(conditions: Iterable[Condition]) -> bool:
    """Whether the joints may be lowered although these conditions hold.

    If two muscles are not what lowering assumes, no muscle is left that brakes for certain.
    """
    kinds = [condition.kind for condition in conditions]
    return kinds.count(_ONE_MUSCLE) < 2 and all(
        (category := STOP_CATEGORIES.get(kind)) is not None and category.number == 1
        for kind in kinds
    )


def longest_lowering(conditions: Iterable[Condition]) -> float:
    """Longest time for lowering the joints after these conditions [s]."""
    found = (STOP_CATEGORIES.get(condition.kind) for condition in conditions)
    return min((category.longest for category in found if category is not None), default=math.inf)
