"""The muscle section of a rig file from the numbers that a data sheet gives.

Source: the geometry of the braid, equations (2) to (5) of "A Review of Design and Modeling of
Pneumatic Artificial Muscle": L = b cos(angle), D = b sin(angle) / (n pi).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pam_model.errors import PamError
from pam_model.muscle_sizes import SIZES
from pam_model.muscles.braid import NEUTRAL_ANGLE, ThinCylinder, require_positive
from pam_model.muscles.force_model import MuscleGeometry
from pam_ros.program_name import PROGRAM


@dataclass(frozen=True, slots=True)
class BraidFromDatasheet:
    """A braid as the rig file needs it."""

    thread_length: float  # b [m]
    turns: float  # n [-]
    rest_length: float  # [m]
    wall_thickness: float = 0.0  # [m]

    @classmethod
    def measured(
        cls, diameter: float, length: float, angle: float, wall_thickness: float = 0.0
    ) -> BraidFromDatasheet:
        """The braid of a muscle measured at rest.

        Parameters
        ----------
        diameter : float
            Of the braid, at the middle of its threads [m].
        length : float
            Between the fittings, without pressure and load [m].
        angle : float
            Between thread and axis [rad].
        wall_thickness : float
            Of the bladder [m].

        Raises
        ------
        DomainError
            For a diameter or length not above 0.
        PamError
            For an angle at which the braid does not contract.
        """
        require_positive(diameter=diameter, length=length)
        if not 0.0 < angle < NEUTRAL_ANGLE:
            raise PamError(
                f"angle {math.degrees(angle):g} deg: expected more than 0 and less than "
                f"{math.degrees(NEUTRAL_ANGLE):.2f} deg between thread and axis, since a braid "
                "with a larger angle extends under pressure"
            )
        thread = length / math.cos(angle)
        return cls(thread, thread * math.sin(angle) / (math.pi * diameter), length, wall_thickness)

    @classmethod
    def of_geometry(cls, geometry: MuscleGeometry) -> BraidFromDatasheet:
        """The braid of a geometry, if it contracts.

        Raises
        ------
        DomainError
            For a quantity not above 0.
        PamError
            For an angle at which the braid does not contract.
        """
        b, n, rest = geometry.thread_length, geometry.turns, geometry.rest_length
        require_positive(thread_length=b, turns=n, rest_length=rest)
        if rest >= b:
            raise PamError(f"thread_length {b:g} m: expected more than the rest length, {rest:g} m")
        diameter = math.sqrt(max(b * b - rest * rest, 0.0)) / (math.pi * n)
        angle = math.acos(min(rest / b, 1.0))
        cls.measured(diameter, rest, angle, geometry.wall_thickness)
        return cls(b, n, rest, geometry.wall_thickness)

    @classmethod
    def of_force(
        cls, diameter: float, length: float, force: float, pressure: float
    ) -> BraidFromDatasheet:
        """The ideal braid that pulls with `force` at rest length.

        With theta the angle of the threads, F = p pi D^2 / 4 (2 cot^2 theta - 1), which is the
        force of the review's ideal braid at rest, solved for theta.

        Parameters
        ----------
        diameter : float
            Of the braid [m].
        length : float
            Between the fittings, without pressure and load [m].
        force : float
            Pull without contraction [N].
        pressure : float
            Gauge pressure of that pull [Pa].

        Raises
        ------
        DomainError
            For a quantity not above 0.
        """
        require_positive(diameter=diameter, length=length, force=force, pressure=pressure)
        per_area = force / (pressure * math.pi * diameter**2 / 4.0)
        return cls.measured(diameter, length, math.atan(math.sqrt(2.0 / (per_area + 1.0))))

    @classmethod
    def of_size(cls, name: str, length: float) -> BraidFromDatasheet:
        """The ideal braid that has the published force of a muscle that can be bought.

        Parameters
        ----------
        name : str
            A key of `pam_model.muscle_sizes.SIZES`.
        length : float
            Between the fittings, without pressure and load [m].
        """
        bought = SIZES[name]
        return cls.of_force(bought.diameter, length, bought.force, bought.pressure)

    @property
    def force_per_pressure(self) -> float:
        """Pull of the ideal braid at rest length over pressure [N/Pa]."""
        braid = ThinCylinder(self.thread_length, self.turns)
        return float(braid.coefficients(self.rest_length)[0])

    @property
    def largest_contraction(self) -> float:
        """Contraction at which the ideal braid has no pull, over rest length [-]."""
        return 1.0 - self.thread_length * math.cos(NEUTRAL_ANGLE) / self.rest_length

    def section(
        self, name: str, model: str = "chou_hannaford", constants: Mapping[str, float] | None = None
    ) -> str:
        """The keys of a muscle `name` as YAML, in the rig file's order."""
        about = "ideal braid; " if model == "chou_hannaford" else ""
        written = [f"        {key}: {value:.8g}" for key, value in (constants or {}).items()]
        return "\n".join(
            [
                f"    {name}:",
                f"      model: {model:<22s} # {about}{PROGRAM} model list",
                f"      thread_length: {self.thread_length:<14.6g} # m",
                f"      turns: {self.turns:<22.6g} # -",
                f"      wall_thickness: {self.wall_thickness:<13.6g} # m",
                f"      rest_length: {self.rest_length:<16.6g} # m",
                *(["      model_parameters:", *written] if written else []),
            ]
        )
