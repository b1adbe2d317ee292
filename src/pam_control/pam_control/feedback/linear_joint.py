"""The joint, its gas and its pressure loops, linearised about an equilibrium.

With deviations q, pa, pb, ... of any number of muscles, the controller's output w and s the Laplace
variable:

    (J s^2 + B s + K) q = na pa + nb pb + ...
    s pi = H(s) ui - ci s q
    ui = k (gi w + hi q - D pi) + [ci s q/(Tf s + 1)]   (bracket: measured-velocity feedforward)
    H(s) = exp(-T s)/(alpha tau s + 1),  D(s) = exp(-Tp s) of late pressures

ci is the pressure change per angle in a closed chamber, H the sampled, delayed and lead-compensated
valve, gi the gain from the law's output to the pressures, and hi the gain from the measured
position to the pressures. At the equilibrium the valves are closed, so that their flow does not
depend on the pressure; the inverse of the ISO 6358 flow makes their gain one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.views.linearised_joint import OperatingPoint, PerMuscle

Complex = npt.NDArray[np.complex128]
Frequencies = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LoopTiming:
    """Delays and lags between a measurement and its effect."""

    period: float  # period of the control loop [s]; half of it counts as delay (zero-order hold)
    transport_delay: float  # from the sensor's sample to the valve [s]
    valve_time_constant: float  # tau [s]
    # alpha: share of the valve's lag that remains after lead compensation [-]; 1: none
    lead_ratio: float
    velocity_filter: float  # tf, filter time constant of a measured velocity [s]
    # the valves are pressure regulators: pi = exp(-T s)/(tau^2 s^2 + 2 zeta tau s + 1) of its
    # reference
    regulated: bool = False
    # additional delay of a measured position compared with a measured pressure [s]
    position_delay: float = 0.0
    valve_damping: float = 1.0  # zeta of regulators [-]
    pressure_lag: float = 0.0  # of the pressure sensors, which counts as a delay as well [s]
    pressure_delay: float = 0.0  # of a measured pressure compared with a measured position [s]

    @property
    def delay(self) -> float:
        """T: transport delay and half a period for the hold [s]."""
        return self.transport_delay + 0.5 * self.period

    @property
    def residual_lag(self) -> float:
        """The valve's lag that remains after lead compensation, alpha tau [s]."""
        return self.lead_ratio * self.valve_time_constant


@dataclass(frozen=True, slots=True)
class LoopStructure:
    """How a control law is connected to the pressure loops."""

    pressure_gain: float  # k [1/s]
    input: PerMuscle  # ga, gb, ... [Pa per unit of output]
    position_feedback: PerMuscle = ()  # ha, hb, ... [Pa/rad]; by default 0 for each muscle
    measured_velocity: bool = False  # whether the dV/dt feedforward uses the measured velocity

    def __post_init__(self) -> None:
        """Let the default be that of as many muscles as there are."""
        if not self.position_feedback:
            object.__setattr__(self, "position_feedback", (0.0,) * len(self.input))


def frequency_response(
    point: OperatingPoint, loop: LoopStructure, timing: LoopTiming, omega: npt.NDArray[np.float64]
) -> Complex:
    """Frequency response from w to the measured position, with exact delays [rad per unit of w]."""
    drive, spring, late = response_parts(point, loop, timing, omega)
    result: Complex = drive / spring * late
    return result


def response_parts(
    point: OperatingPoint, loop: LoopStructure, timing: LoopTiming, omega: npt.NDArray[np.float64]
) -> tuple[Complex, Complex, Complex]:
    """The factors of `frequency_response`, which is drive / spring * late.

    Returns
    -------
    drive : ndarray
        Torque of the pressures per unit of w, at a fixed position [N m].
    spring : ndarray
        Torque per position, of the joint with its pressure loops [N m/rad].
    late : ndarray
        Delay of the measured position [-].
    """
    s = 1j * omega
    H = np.exp(-timing.delay * s) / (timing.residual_lag * s + 1.0)
    k = loop.pressure_gain
    if timing.regulated:
        lag = timing.valve_time_constant * s
        follow = np.exp(-timing.delay * s) / (lag * lag + 2.0 * timing.valve_damping * lag + 1.0)
    late = np.exp(-timing.position_delay * s)
    spring: Any = point.dynamic_stiffness(s)
    drive: Any = 0.0
    for n, c, g, h in zip(
        point.torque_slopes,
        point.motion_pressure,
        loop.input,
        loop.position_feedback,
        strict=True,
    ):
        if timing.regulated:
            spring = spring - n * follow * h * late
            drive = drive + n * follow * g
            continue
        feedforward = c * s / (timing.velocity_filter * s + 1.0) if loop.measured_velocity else 0.0
        inner = s + k * H * np.exp(-timing.pressure_delay * s)
        spring = spring - n * (H * (k * h + feedforward) * late - c * s) / inner
        drive = drive + n * H * k * g / inner
    return drive, spring, late
