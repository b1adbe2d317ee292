"""Tondu and Lopez with friction between threads that depends on speed.

F = F_static - [f_k + (f_s - f_k) exp(-|v|/v_s)] S P sgn(v), v the shortening speed,
S = 2 pi r0 l0 sin theta0/[(1 - eps) sqrt(1 - cos^2 theta0 (1 - eps)^2)].
Source: form and constants f_s = 0.015, f_k = 0.105, v_s = 0.15 m/s are from public code that names
Tondu and Lopez; the paper itself was not checked (f_k is unusually above f_s). That code has
exp(+v/v_s), which is an error. The static part is (11) of "A Review of Design and Modeling of
Pneumatic Artificial Muscle".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.elementary import direction, exponential, sine, square_root
from pam_model.muscles.force_model import ModelParameter, register
from pam_model.muscles.models.tondu_lopez import TonduLopez


@register(
    equations="(11)",
    status="published",
    summary="contraction ratio with end factor k and thread friction that depends on speed",
)
class TonduLopezFriction(TonduLopez):
    """Affine in pressure; the friction is zero at zero speed.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        l0 [m].
    k : float
        Factor on the contraction ratio [-].
    static_friction, kinetic_friction : float
        f_s and f_k [-].
    friction_speed : float
        v_s [m/s].

    Raises
    ------
    DomainError
        As `TonduLopez`.
    """

    name: ClassVar[str] = "tondu_lopez_friction"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        **TonduLopez.parameters,
        "static_friction": ModelParameter(0.015, "-", 0.0, 2.0, "f_s, friction at low speed"),
        "kinetic_friction": ModelParameter(0.105, "-", 0.0, 2.0, "f_k, friction at high speed"),
        "friction_speed": ModelParameter(0.15, "m/s", 1e-6, 10.0, "v_s, speed of the transition"),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        k: float = 1.0,
        *,
        static_friction: float = 0.015,
        kinetic_friction: float = 0.105,
        friction_speed: float = 0.15,
    ) -> None:
        super().__init__(thread_length, turns, rest_length, k)
        self.static_friction = static_friction
        self.kinetic_friction = kinetic_friction
        self.friction_speed = friction_speed
        self._contact = 2.0 * math.pi * self.rest_radius * rest_length * sine(self.rest_angle)

    def friction_coefficient(self, velocity: Any) -> Any:
        """f_k + (f_s - f_k) exp(-|v|/v_s) [-] at a speed [m/s]."""
        fade = exponential(-abs(velocity) / self.friction_speed)
        return self.kinetic_friction + (self.static_friction - self.kinetic_friction) * fade

    def contact_area(self, length: Any) -> Any:
        """S [m^2] at a length [m]."""
        length = self._check(length)
        cosine = length / self.thread_length
        left = length / self.rest_length
        return self._contact / (left * square_root(1.0 - cosine * cosine))

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N]; friction adds to it in lengthening [m/s], reduces it in shortening."""
        static = super().force(pressure, length)
        if isinstance(velocity, (float, int)) and velocity == 0.0:
            return static
        loss = self.friction_coefficient(velocity) * self.contact_area(length) * pressure
        return static + direction(velocity) * loss
