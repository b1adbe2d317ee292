"""Strands and jam limits of a braid: equations (15)-(19), after Davis and Caldwell.

Source: equations (15)-(19) of "A Review of Design and Modeling of Pneumatic Artificial Muscle";
S. Davis, D. G. Caldwell, "Braid effects on contractile range and friction modeling in pneumatic
muscle actuators", International Journal of Robotics Research 25(4), 2006. Derived again here.
Errata: D_s is the width of a strand (or bundle), N = 2 N_c counts the strands of both families,
D_0 and D_o are both the diameter at 90 degrees; the text defines none of the three. (15) is the
circumference at 90 degrees; I is the thread length between two crossings, not the spacing of the
strands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pam_model.errors import DomainError
from pam_model.muscles.braid import require_positive
from pam_model.muscles.elementary import arc_sine, cosine


@dataclass(frozen=True, slots=True)
class BraidLimits:
    """A braid whose strands touch when it is fully stretched or fully expanded.

    Raises
    ------
    DomainError
        For a quantity not above zero, or strands too wide for the braid: D_s N > pi D90.
    """

    strand_width: float  # d_s [m]
    strands: float  # n, all strands of both families [-]
    diameter_at_90_degrees: float  # d90 [m]
    thread_length: float  # b [m]

    def __post_init__(self) -> None:
        require_positive(
            strand_width=self.strand_width,
            strands=self.strands,
            diameter_at_90_degrees=self.diameter_at_90_degrees,
            thread_length=self.thread_length,
        )
        room = math.pi * self.diameter_at_90_degrees
        if self.strand_width * self.strands > room:
            raise DomainError(
                f"strand_width times strands = {self.strand_width * self.strands:g} m is above "
                f"pi D90 = {room:g} m: such a braid cannot exist"
            )

    @property
    def cover(self) -> float:
        """D_s N/(pi D90) [-], at most 1."""
        return self.strand_width * self.strands / (math.pi * self.diameter_at_90_degrees)

    @property
    def thread_segment(self) -> float:
        """(16): I = pi D90/(2 N_c) = pi D90/N, thread length between neighbouring crossings [m]."""
        return math.pi * self.diameter_at_90_degrees / self.strands

    def node_pitch(self, angle: Any) -> Any:
        """(17): G = 2 I sin(angle), distance of crossings around the braid [m]."""
        return 2.0 * self.thread_segment * np.sin(angle)

    def circumference(self, angle: Any) -> Any:
        """(15): C = N_c G = pi D [m]; at 90 degrees pi D90."""
        return 0.5 * self.strands * self.node_pitch(angle)

    def gap(self, angle: Any) -> Any:
        """I sin(2 angle): distance between the centre lines of adjacent parallel strands [m]."""
        return self.thread_segment * np.sin(2.0 * np.asarray(angle))[()]

    @property
    def minimum_angle(self) -> Any:
        """(18): thread angle at which the stretched braid jams [rad]."""
        return 0.5 * arc_sine(min(1.0, self.cover))

    @property
    def lock_angle(self) -> Any:
        """Thread angle at which the expanded braid jams, 90 degrees minus (18) [rad]."""
        return 0.5 * math.pi - self.minimum_angle

    @property
    def longest_length(self) -> Any:
        """(19): b cos(minimum angle) [m]."""
        return self.thread_length * cosine(self.minimum_angle)

    @property
    def shortest_length(self) -> Any:
        """Length at the lock angle, b cos(lock angle) [m]."""
        return self.thread_length * cosine(self.lock_angle)

    @property
    def contraction_range(self) -> Any:
        """Free contraction from the longest length to zero force [-]."""
        return 1.0 - 1.0 / (math.sqrt(3.0) * cosine(self.minimum_angle))
