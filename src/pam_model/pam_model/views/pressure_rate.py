"""How fast a valve changes the pressure of a muscle.

Source: ISO 6358-1 for the valve, polytropic chamber (`pam_model.gas`). A tube between valve and
muscle is a second restriction in series: the flow is the one that passes both.
"""

from __future__ import annotations

from pam_model.gas import pressure_rate as chamber_rate
from pam_model.gas import reference_density, reference_flow, valve_flow
from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.views.gas_volume import neutral_gas_volume, tube_volume

_HALVINGS = 60


def valve_mass_flow(
    robot: Robot,
    muscle: RobotMuscle,
    opening: float,
    pressure: float,
    supply: float | None = None,
) -> float:
    """Flow through the valve towards the muscle [kg/s].

    Parameters
    ----------
    robot : Robot
        Gives gas and supply.
    opening : float
        -1 (exhaust fully open) to 1 (supply fully open).
    pressure : float
        Behind the valve [Pa absolute].
    supply : float, optional
        Before it [Pa absolute]; by default that of the full supply.
    """
    valve = muscle.valve
    ratio = valve.exhaust_ratio if opening < 0.0 else 1.0
    return float(
        valve_flow(
            opening * ratio,
            pressure,
            supply_pressure=robot.supply.pressure if supply is None else supply,
            ambient_pressure=robot.gas.ambient_pressure,
            conductance=valve.sonic_conductance,
            critical_ratio=valve.critical_ratio,
            temperature=robot.gas.temperature,
        )
    )


def entering_flow(
    robot: Robot,
    muscle: RobotMuscle,
    opening: float,
    pressure: float,
    supply: float | None = None,
) -> float:
    """Flow into the muscle through valve and tube in steady state [kg/s].

    Parameters are those of `valve_mass_flow`; `pressure` is that in the muscle.
    """
    tube = muscle.valve.tube
    if tube is None:
        return valve_mass_flow(robot, muscle, opening, pressure, supply)
    density = reference_density(robot.gas.temperature)
    # Between valve and tube, the pressure is that at which both pass the same flow.
    source = robot.supply.pressure if supply is None else supply
    low, high = sorted((pressure, source if opening > 0.0 else robot.gas.ambient_pressure))
    through = 0.0
    for _ in range(_HALVINGS):
        between = 0.5 * (low + high)
        through = density * reference_flow(
            tube.conductance, muscle.valve.critical_ratio, between, pressure
        )
        if valve_mass_flow(robot, muscle, opening, between, supply) > through:
            low = between
        else:
            high = between
    return through


def pressure_rate(
    robot: Robot,
    muscle: RobotMuscle,
    opening: float,
    pressure: float,
    volume: float,
    supply: float | None = None,
) -> float:
    """How fast the pressure of a muscle at rest changes [Pa/s].

    Parameters
    ----------
    robot, muscle, opening, supply
        As for `valve_mass_flow`.
    pressure : float
        In the muscle [Pa absolute].
    volume : float
        Gas volume of the muscle without its tube [m^3]; the volume of the tube is added.
    """
    flow = entering_flow(robot, muscle, opening, pressure, supply)
    return _chamber_rate(robot, flow, pressure, volume + tube_volume(muscle))


def filling_rate(robot: Robot, muscle: RobotMuscle) -> float:
    """How fast the open valve fills an empty muscle at joint position 0, with its tube [Pa/s].

    At this moment the full supply is before the valve, and nothing flows through the tube yet.
    """
    return _opened_rate(robot, muscle, neutral_gas_volume(muscle) + tube_volume(muscle))


def fastest_sensor_rate(robot: Robot, muscle: RobotMuscle) -> float:
    """How fast the open valve raises the pressure at the sensor at first [Pa/s].

    Behind a valve with a tube, the gas at the sensor is that of the tube alone.
    """
    return _opened_rate(robot, muscle, tube_volume(muscle) or neutral_gas_volume(muscle))


def _opened_rate(robot: Robot, muscle: RobotMuscle, volume: float) -> float:
    ambient = robot.gas.ambient_pressure
    flow = valve_mass_flow(robot, muscle, 1.0, ambient)
    return _chamber_rate(robot, flow, ambient, volume)


def _chamber_rate(robot: Robot, flow: float, pressure: float, volume: float) -> float:
    return float(
        chamber_rate(
            flow,
            pressure,
            volume,
            temperature=robot.gas.temperature,
            exponent=robot.gas.polytropic_exponent,
        )
    )
