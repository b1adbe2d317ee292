"""References and settings that ask for more than a joint may do, as data."""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import FaultKind, Reaction, Stays

_K = FaultKind
_R = Reaction
_REFUSED: Final = ("refused references",)

REFERENCE_KINDS: Final = (
    _K("trajectory_too_fast", "reference", "a trajectory from limit to limit in milliseconds",
       {"time": (0.001, 0.2)}, _REFUSED, _R.EITHER, 3.0,
       "refused or made slower, so that the joint stays below max_velocity"),
    _K("trajectory_too_steep", "reference", "waypoints with impossible speeds",
       {"speed": (10.0, 100.0)}, _REFUSED, _R.EITHER, 3.0, "refused or made slower"),
    _K("trajectory_too_long", "reference", "a trajectory of 60000 points", {}, _REFUSED, _R.RIDE,
       1.0, "refused by its size (trajectory.max_points), before it is read"),
    _K("trajectory_in_the_future", "reference", "a trajectory is stamped far in the future",
       {"ahead": (61.0, 3600.0)}, _REFUSED, _R.RIDE, 1.5, "refused; the motion continues"),
    _K("stream_in_degrees", "reference", "the motion is streamed in degrees, or its speed alone",
       {}, _REFUSED, _R.EITHER, 3.0, "refused where it exceeds the limits of the joint",
       stays=Stays.TRACKING),
    _K("stream_jumps", "reference", "a streamed angle jumps between two values",
       {"size": (0.3, 0.95)},
       (), _R.EITHER, 3.0, "the reference is limited in speed and acceleration",
       stays=Stays.TRACKING),
    _K("stream_is_noise", "reference", "the streamed angles are noise", {"size": (0.3, 0.95)},
       (), _R.EITHER, 3.0, "the reference is limited in speed and acceleration",
       stays=Stays.TRACKING),
    _K("stream_with_wrong_speed", "reference", "the streamed speed does not belong to the angle",
       {"angle": (-0.5, 0.5), "speed": (2.0, 50.0)}, _REFUSED, _R.EITHER, 2.0,
       "the reference is limited in speed and acceleration",
       stays=Stays.TRACKING),
    _K("stream_ends", "reference", "the stream of references ends", {}, (), _R.RIDE, 1.5,
       "the joint holds the last reference"),
    _K("stiffness_jumps", "reference", "the stiffness asked for jumps up and down",
       {"stiffness": (10.0, 60.0)}, (), _R.RIDE, 2.0, "max_stiffness_rate"),
    _K("feedforward_switched_off", "reference", "the feedforward is switched off while a joint is "
       "held", {"angle": (-0.9, 0.9)}, (), _R.RIDE, 2.0, "the change is made without a jump"),
)  # fmt: skip
