"""Design a braided muscle for a wanted force, stroke and pressure, and report what limits it.

Equations (1), (2), (6) and the braid limits (15)-(19) of "A Review of Design and Modeling of
Pneumatic Artificial Muscle": the ideal braid must still pull with the wanted force at the end of
the stroke. The braid angle at rest is as small as the strands allow, with a margin, because a
smaller angle gives more force and stroke at the same diameter.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from scipy.optimize import brentq

from pam_model.domain import require
from pam_model.errors import DomainError
from pam_model.muscles.braid import NEUTRAL_ANGLE

DEFAULT_CONTRACTION = 0.2
SMALLEST_ANGLE = math.radians(15.0)
"""Braids below this angle are rare: they slip off their ends and barely hold the bladder [rad]."""
JAM_MARGIN = 1.1
"""The angle at rest is at least this many times the angle at which the strands jam."""
_LARGEST_DIAMETER = 1.0


@dataclass(frozen=True, slots=True)
class MuscleDesign:
    """A muscle to build."""

    # rest_angle, end_angle: thread angle at rest and at the end of the stroke [rad]
    rest_angle: float
    end_angle: float
    jam_angle: float  # (18): thread angle at which neighbouring strands touch [rad]
    # rest_length, end_length, longest_length: active length at rest, at the end of the stroke, and
    # (19) where the braid jams [m]
    rest_length: float
    end_length: float
    longest_length: float
    # rest_diameter, end_diameter, diameter_90: diameter at rest, at the end of the stroke, and b/(n
    # pi) [m]
    rest_diameter: float
    end_diameter: float
    diameter_90: float
    # thread_length, turns: b [m] and n [-]
    thread_length: float
    turns: float
    # contraction, free_contraction: contraction ratio of this stroke, and without load [-]
    contraction: float
    free_contraction: float
    # rest_force, end_force: pull at rest and at the end of the stroke [N]
    rest_force: float
    end_force: float
    end_stiffness: float  # dF/dL at the end of the stroke [N/m]
    thread_tension: float  # largest tension of one strand over the stroke [N]
    gas_volume: float  # gas volume at the end of the stroke [m^3]
    limited_by: str  # constraints that prevent a smaller muscle

    def table(self) -> str:
        """The design as text."""

        def degrees(angle: float) -> str:
            return f"{math.degrees(angle):.1f} deg"

        return "\n".join(
            [
                f"braid angle      {degrees(self.rest_angle)} at rest, {degrees(self.end_angle)} "
                f"at the end of the stroke; strands jam at {degrees(self.jam_angle)}",
                f"diameter         {1e3 * self.rest_diameter:.1f} mm at rest, "
                f"{1e3 * self.end_diameter:.1f} mm at the end of the stroke",
                f"active length    {1e3 * self.rest_length:.1f} mm at rest, "
                f"{1e3 * self.end_length:.1f} mm at the end, at most "
                f"{1e3 * self.longest_length:.1f} mm",
                f"thread           {1e3 * self.thread_length:.1f} mm long, {self.turns:.2f} turns",
                f"contraction      {self.contraction:.1%}, "
                f"{self.free_contraction:.1%} without load",
                f"pull             {self.rest_force:.0f} N at rest, {self.end_force:.0f} N at the "
                f"end; stiffness there {self.end_stiffness:.0f} N/m",
                f"strand tension   up to {self.thread_tension:.1f} N",
                f"gas              {1e6 * self.gas_volume:.1f} cm^3 at the end of the stroke",
                f"limited by       {self.limited_by}",
            ]
        )

    def as_dict(self) -> dict[str, float | str]:
        """Plain values for JSON."""
        return asdict(self)


def jam_angle(strand_width: float, strands: int, diameter_90: float) -> float:
    """(18): thread angle at which strands touch [rad]; `strands` counts both families.

    Raises
    ------
    DomainError
        If the strands do not fit around the braid even at 45 degrees.
    """
    filled = strand_width * strands / (math.pi * diameter_90)
    require(
        "strand_width * strands/(pi D90) [-]",
        filled,
        0.0,
        1.0,
        open_low=True,
        why=f"{strands} strands of {1e3 * strand_width:g} mm do not fit around "
        f"D90 = {1e3 * diameter_90:.3g} mm",
    )
    return 0.5 * math.asin(filled)


def design(
    force: float,
    stroke: float,
    pressure: float,
    *,
    contraction: float | None = None,
    strand_width: float = 0.3e-3,
    strands: int = 96,
    largest_length: float | None = None,
    largest_diameter: float | None = None,
    strand_strength: float | None = None,
) -> MuscleDesign:
    """The thinnest ideal braid that meets the requirements.

    Parameters
    ----------
    force : float
        Pull wanted at the end of the stroke, where it is smallest [N].
    stroke : float
        Shortening wanted [m].
    pressure : float
        Available gauge pressure [Pa].
    contraction : float, optional
        Stroke over rest length [-]. Default: 0.2, or more if `largest_length` requires it.
    strand_width : float
        D_s, width of a strand or bundle [m].
    strands : int
        N, all strands of both families.
    largest_length, largest_diameter : float, optional
        Space available: length at rest, diameter at the end of the stroke [m].
    strand_strength : float, optional
        Largest allowed tension of a strand [N].

    Raises
    ------
    DomainError
        For a value not above 0, or if no such muscle can be built; the message names the limit.
    """
    for quantity, value in (
        ("force [N]", force),
        ("stroke [m]", stroke),
        ("pressure [Pa]", pressure),
        ("strand_width [m]", strand_width),
        ("strands", strands),
    ):
        require(quantity, value, 0.0, open_low=True)
    limits = []
    if contraction is None:
        contraction = DEFAULT_CONTRACTION
        if largest_length is not None and stroke / contraction > largest_length:
            contraction = stroke / largest_length
            limits.append(f"largest_length {1e3 * largest_length:.4g} mm")
    require("contraction [-]", contraction, 0.0, 1.0, open_low=True, open_high=True)
    if largest_length is not None and stroke / contraction > largest_length * (1.0 + 1e-12):
        raise DomainError(
            f"contraction = {contraction:g} with stroke = {stroke:g} m needs a rest length of "
            f"{stroke / contraction:.4g} m, above largest_length = {largest_length:g} m"
        )
    ratio = 1.0 - contraction

    def rest_angle(diameter_90: float) -> float:
        return max(SMALLEST_ANGLE, JAM_MARGIN * jam_angle(strand_width, strands, diameter_90))

    def end_pull(diameter_90: float) -> float:
        cosine = ratio * math.cos(rest_angle(diameter_90))
        return 0.25 * math.pi * diameter_90**2 * pressure * (3.0 * cosine**2 - 1.0)

    tightest = strand_width * strands / math.pi * (1.0 + 1e-9)
    if end_pull(_LARGEST_DIAMETER) <= 0.0:
        free = 1.0 - math.cos(NEUTRAL_ANGLE) / math.cos(rest_angle(_LARGEST_DIAMETER))
        raise DomainError(
            f"contraction = {contraction:.3g} is not below {free:.3g}, the free contraction of the "
            f"smallest braid angle, {math.degrees(rest_angle(_LARGEST_DIAMETER)):.1f} deg: "
            "make the muscle longer"
        )
    if end_pull(_LARGEST_DIAMETER) < force:
        raise DomainError(
            f"force = {force:g} N at {pressure:g} Pa needs a braid of more than 1 m diameter"
        )
    if end_pull(tightest) >= force:
        diameter_90 = tightest
    else:
        found = brentq(
            lambda d: end_pull(d) - force, tightest, _LARGEST_DIAMETER, xtol=1e-16, rtol=1e-14
        )
        diameter_90 = float(found)
    start = rest_angle(diameter_90)
    end = math.acos(ratio * math.cos(start))
    if start > SMALLEST_ANGLE:
        limits.append(
            f"strands: {strands} of {1e3 * strand_width:g} mm jam at "
            f"{math.degrees(start / JAM_MARGIN):.1f} deg; fewer or thinner strands allow a "
            "thinner muscle"
        )
    else:
        limits.append(f"smallest braid angle {math.degrees(SMALLEST_ANGLE):.0f} deg")
    thread = stroke / contraction / math.cos(start)
    made = _describe(
        thread,
        diameter_90,
        (start, end),
        pressure=pressure,
        strand_width=strand_width,
        strands=strands,
        limited_by="; ".join(limits),
    )
    _check_room(made, largest_diameter, strand_strength, strands)
    return made


def _describe(
    thread: float,
    diameter_90: float,
    angles: tuple[float, float],
    *,
    pressure: float,
    strand_width: float,
    strands: int,
    limited_by: str,
) -> MuscleDesign:
    start, end = angles
    area = 0.25 * math.pi * diameter_90**2
    turns = thread / (math.pi * diameter_90)
    jam = jam_angle(strand_width, strands, diameter_90)
    rest_length, end_length = thread * math.cos(start), thread * math.cos(end)
    return MuscleDesign(
        rest_angle=start,
        end_angle=end,
        jam_angle=jam,
        rest_length=rest_length,
        end_length=end_length,
        longest_length=thread * math.cos(jam),
        rest_diameter=diameter_90 * math.sin(start),
        end_diameter=diameter_90 * math.sin(end),
        diameter_90=diameter_90,
        thread_length=thread,
        turns=turns,
        contraction=1.0 - end_length / rest_length,
        free_contraction=1.0 - math.cos(NEUTRAL_ANGLE) / math.cos(start),
        rest_force=area * pressure * (3.0 * math.cos(start) ** 2 - 1.0),
        end_force=area * pressure * (3.0 * math.cos(end) ** 2 - 1.0),
        end_stiffness=1.5 * pressure * end_length / (math.pi * turns**2),
        # T = P b L/(2 pi n^2 N_t): largest where the muscle is longest.
        thread_tension=pressure * thread * rest_length / (2.0 * math.pi * turns**2 * strands),
        gas_volume=area * math.sin(end) ** 2 * end_length,
        limited_by=limited_by,
    )


def _check_room(
    made: MuscleDesign, largest_diameter: float | None, strand_strength: float | None, strands: int
) -> None:
    if largest_diameter is not None and made.end_diameter > largest_diameter:
        raise DomainError(
            f"largest_diameter = {largest_diameter:g} m: {made.end_diameter:.4g} m are needed at "
            "the end of the stroke; use more pressure, a longer muscle or several in parallel"
        )
    if strand_strength is not None and made.thread_tension > strand_strength:
        raise DomainError(
            f"strand_strength = {strand_strength:g} N: each of {strands} strands carries "
            f"{made.thread_tension:.4g} N; use more or stronger strands"
        )
