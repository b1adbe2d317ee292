"""Braid of threads that stretch: b grows with the tension that the pressure causes.

T = P b L/(2 pi n^2 N) per thread, b = b0/(1 - b0 P L/(2 pi n^2 N EA)), F = P (3 L^2 - b^2)/(4 pi
n^2); the stored energy adds no term (envelope theorem). Named without an equation in "A Review of
Design and Modeling of Pneumatic Artificial Muscle"; derived here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from pam_model.errors import DomainError
from pam_model.muscles.braid import ThinCylinder, require_length, require_positive
from pam_model.muscles.elastic_wall import CurvedMuscle
from pam_model.muscles.elementary import all_true
from pam_model.muscles.force_model import ModelParameter, register


def thread_tension(
    pressure: Any, thread_length: Any, turns: float, length: Any, threads: float
) -> Any:
    """Tension of one thread, P b L/(2 pi n^2 N) [N], by the force balance of the braid.

    Parameters
    ----------
    pressure : float or array
        Gauge [Pa].
    thread_length, length : float or array
        b and L [m].
    turns, threads : float
        n, and the number of threads of both families.
    """
    return pressure * thread_length * length / (2.0 * math.pi * turns * turns * threads)


@register(
    equations="-",
    status="derived",
    summary="ideal braid of threads that stretch under pressure",
)
class ExtensibleBraid(CurvedMuscle):
    """Not affine in pressure; `volume` holds without pressure, `volume_under_pressure` is exact.

    Parameters
    ----------
    thread_length : float
        b0 without tension [m].
    turns : float
        n [-].
    threads : float
        N, number of threads of both families [-].
    thread_stiffness : float
        EA, force over strain of one thread [N].

    Raises
    ------
    DomainError
        For a quantity not above zero; by the methods for a length outside (0, b0] or a pressure
        at which a thread would stretch without bound.
    """

    name: ClassVar[str] = "extensible_braid"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "threads": ModelParameter(48.0, "-", 2.0, 10000.0, "number of threads, both families"),
        "thread_stiffness": ModelParameter(
            5e3, "N", 1.0, 1e7, "EA of one thread, force over strain"
        ),
    }

    def __init__(
        self, thread_length: float, turns: float, threads: float, thread_stiffness: float
    ) -> None:
        require_positive(threads=threads, thread_stiffness=thread_stiffness)
        self.braid = ThinCylinder(thread_length, turns)
        self.threads = threads
        self.thread_stiffness = thread_stiffness
        self._scale = 1.0 / (4.0 * math.pi * turns**2)
        # b = b0/(1 - compliance P L)
        self._compliance = 2.0 * self._scale * thread_length / (threads * thread_stiffness)

    def stretched_thread(self, pressure: Any, length: Any) -> Any:
        """Thread length b [m] at gauge pressure [Pa] and length [m]."""
        reason = "the thread length without tension"
        length = require_length(length, 0.0, self.braid.thread_length, reason)
        left = 1.0 - self._compliance * pressure * length
        if not all_true(left > 0.0):
            raise DomainError(
                f"pressure {np.max(pressure):g} Pa stretches a thread of "
                f"{self.thread_stiffness:g} N without bound"
            )
        return self.braid.thread_length / left

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N] at gauge pressure [Pa] and length [m]; it does not depend on speed."""
        thread = self.stretched_thread(pressure, length)
        return pressure * self._scale * (3.0 * length * length - thread * thread)

    def stiffness(self, pressure: Any, length: Any) -> Any:
        """dF/dL at constant pressure [N/m]."""
        thread = self.stretched_thread(pressure, length)
        growth = thread**3 * self._compliance * pressure / self.braid.thread_length
        return pressure * self._scale * (6.0 * length - 2.0 * growth)

    def pressure_slope(self, pressure: Any, length: Any) -> Any:
        """dF/dP at constant length [m^2]; its negative is dV/dL at constant pressure."""
        thread = self.stretched_thread(pressure, length)
        growth = thread**3 * self._compliance * pressure * length / self.braid.thread_length
        return self._scale * (3.0 * length * length - thread * thread - 2.0 * growth)

    def volume_under_pressure(self, pressure: Any, length: Any) -> Any:
        """Gas volume [m^3] with the threads stretched."""
        thread = self.stretched_thread(pressure, length)
        return length * (thread * thread - length * length) * self._scale

    def closed_stiffness(
        self,
        pressure: Any,
        length: Any,
        *,
        dead_volume: float,
        ambient_pressure: float,
        exponent: float,
    ) -> Any:
        """dF/dL [N/m] with the gas shut in; the pressure also expands the braid."""
        slope = self.pressure_slope(pressure, length)
        thread = self.stretched_thread(pressure, length)
        swell = (
            2.0 * thread**3 * self._compliance * length**2 * self._scale / self.braid.thread_length
        )
        absolute = exponent * (pressure + ambient_pressure)
        room = self.volume_under_pressure(pressure, length) + dead_volume
        gas = absolute * slope / (room + absolute * swell)
        return self.stiffness(pressure, length) + slope * gas
