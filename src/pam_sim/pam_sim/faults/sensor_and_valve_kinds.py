"""Faults of sensors, valves, muscles and the supply of air, as data."""

from __future__ import annotations

from typing import Final

from pam_sim.faults.fault_kind import (
    VENT,
    WATCH,
    FaultKind,
    Reaction,
)

_K = FaultKind
_R = Reaction

SENSOR_AND_VALVE_KINDS: Final = (
    # --- sensors ---
    _K("pressure_stuck", "sensor", "a pressure reading freezes", {},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 2.5,
       "detected when the pressure should change"),
    _K("pressure_noisy", "sensor", "a pressure sensor becomes very noisy",
       {"amplitude": (2e4, 1e5)},
       ("sensor_noise", "pressure_rate", "sensor_range", "over_pressure", "OVER_PRESSURE"),
       _R.VENT, 0.08, "25 samples"),
    _K("pressure_noisier", "sensor", "a pressure sensor becomes noisier",
       {"amplitude": (5.4e3, 6.2e3)}, ("suspected sensor_noise",), _R.WARN, WATCH),
    _K("pressure_too_high", "sensor", "a pressure sensor is shorted",
       {"shown": (6.7e5, 1.2e6)}, ("over_pressure", "pressure_rate", "OVER_PRESSURE"), _R.VENT,
       VENT, "one sample, on the board and in the driver"),
    _K("pressure_too_low", "sensor", "a pressure sensor shows a vacuum",
       {"shown": (-1e5, -4e4)}, ("sensor_range", "pressure_rate"), _R.VENT, VENT, "one sample"),
    _K("pressure_lost", "sensor", "a pressure sensor is disconnected", {},
       ("board_fault", "SENSOR", "stale_sensor"), _R.VENT, VENT, "one sample, on the board"),
    _K("pressure_drift", "sensor", "a pressure sensor drifts", {"rate": (3e4, 1.5e5)},
       ("torque_implausible", "pressure_implausible", "sensor_range", "over_pressure"), _R.VENT,
       5.6, "detected when the error of the torque exceeds its limit"),
    _K("pressure_offset", "sensor", "a pressure reading jumps", {"by": (6e4, 3e5)},
       ("pressure_rate", "pressure_implausible", "over_pressure", "OVER_PRESSURE"), _R.VENT, VENT,
       "one sample"),
    _K("pressures_swapped", "sensor", "two pressure sensors are exchanged", {},
       ("pressure_rate", "pressure_implausible", "torque_implausible", "sensor_range"), _R.VENT,
       0.5, "detected when the two pressures differ"),
    _K("encoder_stuck", "sensor", "the angle freezes", {},
       ("torque_implausible", "pressure_implausible", "over_pressure"), _R.VENT, 1.0,
       "detected when pressures and angle disagree"),
    _K("encoder_noisy", "sensor", "the encoder becomes noisy", {"amplitude": (0.05, 0.3)},
       ("sensor_noise", "position_jump", "position_limit", "torque_implausible"), _R.VENT, 0.08,
       "25 samples, or sooner, since the noise implies torques that do not exist"),
    _K("encoder_jump", "sensor", "the angle jumps and keeps the offset", {"by": (0.25, 1.0)},
       ("position_jump", "position_limit"), _R.VENT, VENT, "one sample"),
    _K("encoder_drift", "sensor", "the encoder slips", {"rate": (0.2, 1.0)},
       ("torque_implausible", "position_limit", "pressure_implausible"), _R.VENT, 4.0,
       "detected when the error of the torque exceeds its limit"),
    _K("encoder_out_of_range", "sensor", "the encoder shows an impossible angle",
       {"shown": (1.5, 8.0)}, ("position_limit", "position_jump"), _R.VENT, VENT, "one sample"),
    _K("encoder_lost", "sensor", "the encoder is disconnected", {},
       ("board_fault", "SENSOR", "stale_sensor"), _R.VENT, VENT, "one sample, on the board"),
    # --- valves and air ---
    _K("valve_stuck_open", "valve", "a valve stays open to the supply", {},
       ("pressure_implausible", "over_pressure", "torque_implausible", "OVER_PRESSURE"), _R.VENT,
       0.15, "the board commands a vent; only a shut-off valve in the supply can stop the air",
       keeps_air=True),
    _K("valve_stuck_shut", "valve", "a valve stays shut", {},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 1.0,
       "detected when the pressure should change", keeps_air=True),
    _K("valve_stuck_exhausting", "valve", "a valve stays open to ambient", {},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 0.2,
       "detected when the pressure falls"),
    _K("muscle_burst", "valve", "a muscle or hose bursts; the hole is at least as large as "
       "the fully open valve", {"conductance": (4e-9, 1e-8)},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 0.4,
       "detected when the pressure falls"),
    _K("muscle_leak", "valve", "a muscle leaks through a smaller hole",
       {"conductance": (1.2e-9, 4e-9)}, ("suspected pressure_implausible", "pressure_implausible"),
       _R.NOTICED, 2.0, "a deviation below the limit is a warning"),
    _K("muscle_leak_small", "valve", "a muscle leaks a little", {"conductance": (1e-10, 1.2e-9)},
       (), _R.RIDE, 2.0, "the valve compensates the leak; the diagnosis of a recording finds it"),
    _K("supply_lost", "valve", "the supply pressure is lost", {"share": (0.0, 0.4)},
       ("supply_low",), _R.LOWER, 0.02 + VENT, "the next status"),
    _K("supply_sags", "valve", "the supply pressure falls a little", {"share": (0.6, 0.72)},
       ("suspected supply_low",), _R.WARN, WATCH),
)  # fmt: skip
