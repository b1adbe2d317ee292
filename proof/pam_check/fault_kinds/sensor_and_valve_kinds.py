"""Faults of sensors, valves, muscles and the supply of air, as data."""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import (
    BRAKING,
    VENT,
    WATCH,
    FaultKind,
    Reaction,
    Stays,
    of_rig,
)

_K = FaultKind
_R = Reaction

SENSOR_AND_VALVE_KINDS: Final = (
    # --- sensors ---
    of_rig("pressure_stuck", "sensor", "a pressure reading freezes", ("pressure_implausible",
       "torque_implausible"), _R.VENT, 2.5, "detected when the pressure should change"),
    of_rig("pressure_noisy", "sensor", "a pressure sensor becomes very noisy", ("sensor_noise",
       "pressure_rate", "sensor_range", "over_pressure", "OVER_PRESSURE"), _R.VENT, 0.08,
       "25 samples"),
    of_rig("pressure_noisier", "sensor", "a pressure sensor becomes noisier",
       ("suspected sensor_noise",), _R.WARN, WATCH),
    of_rig("pressure_too_high", "sensor", "a pressure sensor is shorted", ("over_pressure",
       "pressure_rate", "OVER_PRESSURE"), _R.VENT, VENT,
       "one sample, on the board and in the driver"),
    of_rig("pressure_too_low", "sensor", "a pressure sensor shows a vacuum", ("sensor_range",
       "pressure_rate"), _R.VENT, VENT, "one sample"),
    of_rig("pressure_lost", "sensor", "a pressure sensor is disconnected", ("board_fault",
       "SENSOR", "stale_sensor"), _R.VENT, VENT, "one sample, on the board"),
    of_rig("pressure_drift", "sensor", "a pressure sensor drifts", ("torque_implausible",
       "pressure_implausible", "sensor_range", "over_pressure"), _R.VENT, 5.6,
       "detected when the error of the torque exceeds its limit"),
    of_rig("pressure_offset", "sensor", "a pressure reading jumps", ("pressure_rate",
       "pressure_implausible", "over_pressure", "OVER_PRESSURE"), _R.VENT, VENT, "one sample"),
    of_rig("pressures_swapped", "sensor", "two pressure sensors are exchanged", ("pressure_rate",
       "pressure_implausible", "torque_implausible", "sensor_range"), _R.VENT, 0.5 + BRAKING,
       "detected when the two pressures differ"),
    of_rig("encoder_stuck", "sensor", "the angle freezes", ("torque_implausible",
       "pressure_implausible", "over_pressure", "joint_too_fast"), _R.VENT, 1.2,
       "detected when pressures and angle disagree: latest in a joint that is just turning back",
       stays=Stays.IN_LIMITS),
    of_rig("encoder_noisy", "sensor", "the encoder becomes noisy", ("sensor_noise",
       "position_jump", "position_limit", "torque_implausible"), _R.VENT, 0.08,
       "25 samples, or sooner, since the noise implies torques that do not exist"),
    of_rig("encoder_jump", "sensor", "the angle jumps and keeps the offset", ("position_jump",
       "position_limit"), _R.VENT, VENT, "one sample"),
    of_rig("encoder_drift", "sensor", "the encoder slips", ("torque_implausible", "position_limit",
       "pressure_implausible"), _R.VENT, 4.0,
       "detected when the error of the torque exceeds its limit", stays=Stays.IN_LIMITS),
    of_rig("encoder_out_of_range", "sensor", "the encoder shows an impossible angle",
       ("position_limit", "position_jump"), _R.VENT, VENT, "one sample"),
    of_rig("encoder_lost", "sensor", "the encoder is disconnected", ("board_fault", "SENSOR",
       "stale_sensor"), _R.VENT, VENT, "one sample, on the board"),
    of_rig("pressure_sensors_lag", "sensor", "both pressure sensors become slow",
       ("joint_too_fast", "pressure_implausible"), _R.EITHER, 3.0,
       "the loop tolerates the lag, or stops", stays=Stays.TRACKING),
    of_rig("encoder_lags", "sensor", "the encoder becomes slow", ("joint_too_fast",
       "torque_implausible"), _R.EITHER, 3.0, "the loop tolerates the lag, or stops",
       stays=Stays.TRACKING),
    # --- valves and air ---
    of_rig("valve_stuck_open", "valve", "a valve stays open to the supply",
       ("pressure_implausible", "over_pressure", "torque_implausible", "OVER_PRESSURE"), _R.VENT,
       0.15 + BRAKING,
       "the driver brakes with the other muscle, then vents; only a shut-off valve "
       "in the supply can stop the air", keeps_air=True, air_drives=True),
    of_rig("valve_stuck_shut", "valve", "a valve stays shut", ("pressure_implausible",
       "torque_implausible"), _R.VENT, 1.0 + BRAKING, "detected when the pressure should change",
       keeps_air=True),
    of_rig("valve_stuck_exhausting", "valve", "a valve stays open to ambient",
       ("pressure_implausible", "torque_implausible"), _R.VENT, 0.2 + BRAKING,
       "detected when the pressure falls"),
    of_rig("muscle_burst", "valve", "a muscle or hose bursts; the hole is at least as large as "
       "the fully open valve", ("pressure_implausible", "torque_implausible"), _R.VENT,
       0.4 + BRAKING, "detected when the pressure falls", air_drives=True),
    of_rig("muscle_leak", "valve", "a muscle leaks through a smaller hole",
       ("suspected pressure_implausible", "pressure_implausible"), _R.NOTICED, 2.0,
       "a deviation below the limit is a warning"),
    of_rig("muscle_leak_small", "valve", "a muscle leaks a little", (), _R.RIDE, 2.0,
       "the valve compensates the leak; the diagnosis of a recording finds it"),
    of_rig("supply_lost", "valve", "the supply pressure is lost", ("supply_low",), _R.LOWER,
       0.02 + VENT, "the next status"),
    of_rig("supply_sags", "valve", "the supply pressure falls a little", ("suspected supply_low",),
       _R.WARN, WATCH),
    of_rig("supply_too_high", "valve", "the supply pressure is too high", ("supply_high",
       "suspected supply_high"), _R.NOTICED, 1.0, "the next status"),
    of_rig("exhausts_restricted", "valve", "a silencer clogs: air leaves slowly",
       ("pressure_implausible", "suspected pressure_implausible"), _R.EITHER, 2.0,
       "the joint lags behind, since the valves cannot let the air out faster; a "
       "deviation shows it, or max_tracking_error", stays=Stays.TRACKING),
)  # fmt: skip
