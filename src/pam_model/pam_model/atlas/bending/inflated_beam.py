"""The inflated tube under a moment: a beam until it wrinkles, a membrane until it collapses.

Derived here from membrane stresses (as in the beam of Comer and Levy). It represents Chen's beam
and membrane models, which "A Review of Design and Modeling of Pneumatic Artificial Muscle" names
without a formula; it is not verified that Chen's models are the same (stand-in).

Beam: M = E I kappa, I = pi r^3 t, until the compressed fibre becomes slack at M = pi P r^3/2.
Wrinkled over the half-angle phi0, s = (pi - phi0) cos(phi0) + sin(phi0):
M = pi P r^3 (2 pi - 2 phi0 + sin 2 phi0)/(4 s), kappa = pi P/(2 E t s); collapse at pi P r^3.
"""

from __future__ import annotations

import math

from scipy.optimize import brentq

from pam_model.domain import require


class InflatedBeam:
    """A thin-walled tube of an isotropic sheet that is pressurised and bent.

    Parameters
    ----------
    radius : float
        r [m].
    modulus : float
        E of the wall [Pa].
    wall_thickness : float
        t [m].

    Raises
    ------
    DomainError
        For a parameter not above 0; by the methods for a pressure not above 0, a moment outside
        [0, collapse) and a wrinkle half-angle outside [0, pi).
    """

    def __init__(self, radius: float, modulus: float, wall_thickness: float) -> None:
        require("radius [m]", radius, 0.0, open_low=True)
        require("modulus [Pa]", modulus, 0.0, open_low=True)
        require("wall_thickness [m]", wall_thickness, 0.0, open_low=True)
        self.radius = radius
        self.modulus = modulus
        self.wall_thickness = wall_thickness

    def wrinkle_onset(self, pressure: float) -> float:
        """Moment [N m] at which the compressed fibre becomes slack: pi P r^3/2."""
        require("pressure [Pa]", pressure, 0.0, open_low=True)
        return 0.5 * math.pi * pressure * self.radius**3

    def collapse_moment(self, pressure: float) -> float:
        """Moment [N m] that folds the tube: pi P r^3."""
        return 2.0 * self.wrinkle_onset(pressure)

    def beam_curvature(self, moment: float) -> float:
        """M/(E I) [1/m], curvature of the beam without wrinkles."""
        return moment / (self.modulus * math.pi * self.radius**3 * self.wall_thickness)

    def wrinkled(self, pressure: float, wrinkle_angle: float) -> tuple[float, float]:
        """Moment [N m] and curvature [1/m] with the wall slack over a half-angle phi0 [rad]."""
        require("pressure [Pa]", pressure, 0.0, open_low=True)
        require("wrinkle_angle [rad]", wrinkle_angle, 0.0, math.pi, open_high=True)
        taut = math.pi - wrinkle_angle
        shape = taut * math.cos(wrinkle_angle) + math.sin(wrinkle_angle)
        fullness = (2.0 * taut + math.sin(2.0 * wrinkle_angle)) / (4.0 * shape)
        moment = math.pi * pressure * self.radius**3 * fullness
        curvature = math.pi * pressure / (2.0 * self.modulus * self.wall_thickness * shape)
        return moment, curvature

    def curvature(self, pressure: float, moment: float) -> float:
        """Curvature [1/m] under a moment [N m] at gauge pressure [Pa], as beam or membrane."""
        collapse = self.collapse_moment(pressure)
        require("moment [N m]", moment, 0.0, collapse, open_high=True, why="the tube collapses")
        if moment <= 0.5 * collapse:
            return self.beam_curvature(moment)
        # Near pi, numerator and denominator of M vanish; 3.1 rad is 0.9999 of collapse.
        last = 3.1
        high = self.wrinkled(pressure, last)[0]
        require("moment [N m]", moment, 0.0, high, why="within 0.01 % of collapse")
        angle = brentq(lambda a: self.wrinkled(pressure, a)[0] - moment, 0.0, last, xtol=1e-14)
        return self.wrinkled(pressure, float(angle))[1]
