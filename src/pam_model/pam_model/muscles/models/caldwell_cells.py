"""The braid as rhombic cells: equations (13), (14), after Caldwell.

Source: equations (13)-(14) of "A Review of Design and Modeling of Pneumatic Artificial Muscle".
L = 2 A l cos(alpha), D = f sin(alpha), f = 2 B l/pi: A cells along, B around, side l. That is the
ideal cylinder with b = 2 A l, n = A/B, D90 = f.
Erratum: the text calls the rhombi trapezoids. A and B are counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from pam_model.muscles.braid import ThinCylinder, require_positive
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register


@register(
    equations="(13)-(14)",
    status="derived",
    summary="ideal braid counted in rhombic cells along and around",
)
class CaldwellCells(ThinCylinder):
    """The ideal cylinder, described by numbers of cells.

    Parameters
    ----------
    cells_along : float
        A [-].
    cells_around : float
        B [-].
    cell_side : float
        l [m].

    Raises
    ------
    DomainError
        For a count or side not above zero; by the methods for a length outside (0, b].
    """

    name: ClassVar[str] = "caldwell_cells"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "cells_around": ModelParameter(
            24.0, "-", 1.0, 10000.0, "number B of cells around the braid"
        ),
    }

    def __init__(self, cells_along: float, cells_around: float, cell_side: float) -> None:
        require_positive(cells_along=cells_along, cells_around=cells_around, cell_side=cell_side)
        super().__init__(2.0 * cells_along * cell_side, cells_along / cells_around)
        self.cells_along = cells_along
        self.cells_around = cells_around
        self.cell_side = cell_side

    @classmethod
    def from_geometry(
        cls, geometry: MuscleGeometry, constants: Mapping[str, float]
    ) -> CaldwellCells:
        """The model of a muscle in a rig file, with thread and turns converted to cells."""
        require_positive(thread_length=geometry.thread_length, turns=geometry.turns)
        along = geometry.turns * constants["cells_around"]
        return cls(along, constants["cells_around"], geometry.thread_length / (2.0 * along))

    def length(self, cell_angle: Any) -> Any:
        """(13): L = 2 A l cos(alpha) [m] at a cell angle [rad]."""
        return self.thread_length * np.cos(cell_angle)

    def diameter(self, cell_angle: Any) -> Any:
        """(14): D = (2 B l/pi) sin(alpha) [m] at a cell angle [rad]."""
        return 2.0 * self.cells_around * self.cell_side / math.pi * np.sin(cell_angle)
