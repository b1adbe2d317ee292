"""The row of each joint that the watches of the guard work with."""

from __future__ import annotations

from typing import Final

# what holds for the joint, and what was found in this cycle
(B_LARGEST_SPEED, B_LARGEST_ERROR, B_FOUND) = range(3)
"""Limits of speed [rad/s] and tracking error [rad]; what `motion_watch` has found."""
# error that lasts, and oscillation (`motion_watch`)
(B_LOST_SINCE, B_SIGN, B_SINCE, B_PEAK, B_BEFORE, B_COUNT, B_EXCESS, B_REFERENCE_SIGN,
 B_TURNED) = range(3, 12)  # fmt: skip
"""Since when the error is too large [s]; of the half period of the speed error: sign, begin [s],
peak, peak of the one before, how many count, largest excess in those [rad/s]; sign of the
reference's speed, and whether it turned round in this half period."""
# tubes
B_TUBES, B_FADES_UNTIL = range(12, 14)
"""How many were found, and until when the oscillation that the last one caused may fade [s]."""
# changes of the reference, and swings (`swing_watch`)
(B_PUSH_SIGN, B_MOVES, B_BEGAN, B_DIRECTION, B_FARTHEST, B_REACHED_AT, B_LAST, B_LAST_AT, B_TIME,
 B_ERROR, B_CHANGE, B_BEND, B_CHANGES, B_RESTS, B_SWUNG, B_N_SWINGS) = range(14, 30)  # fmt: skip
B_SWINGS: Final = 30
"""Sign of the reference's acceleration, and whether it moves; when the watch began [s]; direction
of the error, its present extreme and its last turning point, with the times of both; time, error
and its change of the last sample; largest second difference of the error lately [rad]; changes of
all references in this swing, and whether all of them rested; whether a swing has ended in this
cycle; how many swings are kept, which follow, the newest last."""
SWING_SIZE, SWING_DURATION, SWING_CHANGES, SWING_RESTS, N_SWING = range(5)
"""Of a swing: size [rad], duration [s], changes of the references meanwhile, whether they rested.
"""
SWINGS: Final = 4
"""This many equal ones in a row are an oscillation."""
N_WATCH: Final = B_SWINGS + SWINGS * N_SWING
