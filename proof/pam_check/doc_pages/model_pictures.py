"""Pictures of all models other than length-force models: bending, losses, supply and others.

Each function draws one row of the catalogue, under the row's key, for a muscle of typical size.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from pam_model import gas
from pam_model.atlas.bending.contraction_bending import ContractionBending
from pam_model.atlas.bending.extensor_bending import ExtensorBending
from pam_model.atlas.bending.extensor_contractor_bending import ExtensorContractorBending
from pam_model.atlas.bending.inflated_beam import InflatedBeam
from pam_model.atlas.bending.reinforced_braid import ReinforcedBraid
from pam_model.atlas.bending.symmetric_pair import SymmetricBendingPair
from pam_model.atlas.bending.three_muscle_segment import Arc, ThreeMuscleSegment
from pam_model.atlas.losses.bouc_wen import BoucWen
from pam_model.atlas.losses.maxwell_slip import MaxwellSlip
from pam_model.atlas.losses.prandtl_ishlinskii import PrandtlIshlinskii
from pam_model.atlas.losses.standard_linear_solid import StandardLinearSolid
from pam_model.atlas.phenomenological.colbrunn import ColbrunnMuscle
from pam_model.atlas.phenomenological.three_element import ThreeElementMuscle
from pam_model.atlas.supply.bandwidth import SupplyLine
from pam_model.atlas.supply.fill_time import fill_time
from pam_model.atlas.supply.thermal_chamber import ThermalChamber
from pam_model.atlas.supply.tube import StraightTube
from pam_model.identify.fit import fit
from pam_model.identify.fit_figures import draw_fit
from pam_model.identify.measurements import Measurements
from pam_model.identify.show import CONTRACTOR, EXTENSOR, PRESSURES, new_figure
from pam_model.muscles.force_model import create_force_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Picture = Callable[[], "Figure"]
PICTURES: dict[str, Picture] = {}
_AMBIENT, _SUPPLY = 1e5, 7e5
_BRAID_BENT = (0.4, 3.0, math.radians(75.0))


def _picture(key: str) -> Callable[[Picture], Picture]:
    def enter(draw: Picture) -> Picture:
        PICTURES[key] = draw
        return draw

    return enter


def _label(axis: Axes, x: str, y: str, legend: bool = True) -> None:
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    if legend:
        axis.legend(fontsize="x-small")


def _moments_and_stiffness(muscle: ExtensorBending | ContractionBending, largest: float) -> Figure:
    figure, (left, right) = new_figure(2)
    angles = np.linspace(0.0, largest, 80)
    degrees = np.degrees(angles)
    for pressure in PRESSURES:
        left.plot(degrees, muscle.moment(pressure, angles), label=f"{pressure / 1e5:g} bar")
        right.plot(degrees, muscle.stiffness(pressure, angles))
    left.axhline(0.0, color="0.4", linewidth=0.7)
    _label(left, "bend angle [deg]", "moment [N m]")
    _label(right, "bend angle [deg]", "stiffness [N m/rad]", legend=False)
    return figure


@_picture("extensor_bending")
def extensor_bending() -> Figure:
    """Moment and stiffness against the bend angle."""
    muscle = ExtensorBending(*_BRAID_BENT, wall_thickness=1e-3)
    return _moments_and_stiffness(muscle, muscle.angle_bounds[1])


@_picture("contraction_bending")
def contraction_bending() -> Figure:
    """Moment and stiffness against the bend angle."""
    muscle = ContractionBending(0.25, 2.0, math.radians(20.0), 1e-3)
    return _moments_and_stiffness(muscle, 1.1 * muscle.angle(0.5))


@_picture("symmetric_pair")
def symmetric_pair() -> Figure:
    """Two muscles on one spine; dots show the force balance, lines the virtual work."""
    figure, panels = new_figure(2)
    angles = np.linspace(-1.0, 1.0, 41)
    for axis, angle, name in zip(panels, (75.0, 25.0), ("extensile", "contractile"), strict=True):
        pair = SymmetricBendingPair(ReinforcedBraid(0.4, 3.0, math.radians(angle)))
        for first, second in ((3e5, 0.0), (2e5, 1e5), (1.5e5, 1.5e5)):
            label = f"{first / 1e5:g} and {second / 1e5:g} bar"
            line = axis.plot(np.degrees(angles), pair.moment((first, second), angles), label=label)
            balance = pair.moment((first, second), angles[::5], "force_balance")
            axis.plot(np.degrees(angles[::5]), balance, "o", ms=3, color=line[0].get_color())
        axis.set_title(f"{name}, {angle:g} deg", fontsize="small")
        _label(axis, "bend angle [deg]", "moment [N m]")
    return figure


@_picture("three_muscle_segment")
def three_muscle_segment() -> Figure:
    """The middle line for some sets of lengths, in the bending plane."""
    figure, (axis,) = new_figure()
    segment = ThreeMuscleSegment(0.02)
    for first in (0.20, 0.19, 0.18, 0.165, 0.15):
        arc = segment.arc((first, 0.2, 0.2))
        parts = np.linspace(1e-6, arc.length, 50)
        tips = [segment.tip(Arc(float(s), arc.curvature, arc.direction)) for s in parts]
        x, _, z = np.array(tips).T
        axis.plot(1e3 * x, 1e3 * z, label=f"{1e3 * first:g}, 200, 200 mm")
    axis.set_aspect("equal")
    axis.set_xlim(-20.0, 260.0)
    _label(axis, "towards the first muscle [mm]", "along the base's axis [mm]")
    axis.legend(fontsize="x-small", title="muscle lengths", loc="right")
    return figure


@_picture("extensor_contractor_bending")
def extensor_contractor_bending() -> Figure:
    """Torque and stiffness that are possible at a fixed angle."""
    figure, (axis,) = new_figure()
    limb = ExtensorContractorBending(
        create_force_model("gaylord", CONTRACTOR),
        create_force_model("gaylord", EXTENSOR),
        CONTRACTOR.rest_length,
        EXTENSOR.rest_length,
        0.015,
    )
    steps = np.linspace(0.0, 4e5, 9)
    angle = 0.5
    for contractor in steps[::2]:
        pairs = [(float(contractor), float(p)) for p in steps]
        moments = [limb.moment(*pair, angle) for pair in pairs]
        stiffness = [limb.stiffness(*pair, angle) for pair in pairs]
        axis.plot(moments, stiffness, "o-", ms=3, label=f"contractor {contractor / 1e5:g} bar")
    axis.set_title("at 29 deg, extensor from 0 to 4 bar along each line", fontsize="small")
    _label(axis, "torque [N m]", "stiffness [N m/rad]")
    return figure


@_picture("inflated_beam")
def inflated_beam() -> Figure:
    """Moment against curvature, before and after wrinkling."""
    figure, (axis,) = new_figure()
    beam = InflatedBeam(0.01, 1e6, 1e-3)
    for pressure in (0.5e5, 1e5, 1.5e5):
        onset = beam.wrinkle_onset(pressure)
        wrinkled = np.array([beam.wrinkled(pressure, float(a)) for a in np.linspace(0.0, 1.6, 60)])
        curvature = np.concatenate([[0.0], wrinkled[:, 1]])
        moment = np.concatenate([[0.0], wrinkled[:, 0]])
        line = axis.plot(curvature, moment, label=f"{pressure / 1e5:g} bar")
        color = line[0].get_color()
        axis.plot(wrinkled[0, 1], onset, "o", color=color)
        axis.axhline(beam.collapse_moment(pressure), color=color, linestyle=":")
    axis.set_title("dot: wrinkles begin; dotted: collapse", fontsize="small")
    _label(axis, "curvature [1/m]", "moment [N m]")
    return figure


@_picture("three_element")
def three_element() -> Figure:
    """Shortening after pressure is applied, with Serres' coefficients, for several masses."""
    figure, (axis,) = new_figure()
    times = np.linspace(0.0, 1.2, 150)
    for mass in (5.0, 50.0, 500.0):
        muscle = ThreeElementMuscle.at_pressure(mass, 300e3, contracting=True)
        shortening = [muscle.step_response(100.0, float(t))[0] for t in times]
        axis.plot(times, 1e3 * np.array(shortening), label=f"{mass:g} kg")
    axis.set_title("3 bar, load 100 N", fontsize="small")
    _label(axis, "time [s]", "shortening [mm]")
    return figure


@_picture("colbrunn")
def colbrunn() -> Figure:
    """Loops of force against stretch at two frequencies."""
    figure, (axis,) = new_figure()
    muscle = ColbrunnMuscle(5000.0, 60.0, 12.0)
    phase = np.linspace(0.0, 2.0 * math.pi, 400)
    for frequency in (0.2, 2.0, 6.0):
        speed = 0.02 * 2.0 * math.pi * frequency * np.cos(phase)
        stretch = 0.02 * np.sin(phase)
        axis.plot(1e3 * stretch, muscle.force(stretch, speed), label=f"{frequency:g} Hz")
    _label(axis, "stretch [mm]", "force [N]")
    return figure


@_picture("identification")
def identification() -> Figure:
    """A model fitted to noisy points of the same model, with each pressure held out once."""
    model = create_force_model("tondu_lopez", CONTRACTOR, {"k": 1.25})
    pressure = np.repeat(PRESSURES, 12)
    length = CONTRACTOR.rest_length * np.tile(np.linspace(0.78, 1.0, 12), len(PRESSURES))
    noise = np.random.default_rng(1).normal(0.0, 8.0, length.size)
    points = Measurements(
        "synthetic points, k = 1.25, noise 8 N",
        pressure,
        length,
        model.force(pressure, length) + noise,
        np.zeros(length.size),
        np.array([f"{p / 1e5:g} bar" for p in pressure]),
        np.arange(length.size),
        np.full(length.size, ""),
        False,
    )
    return draw_fit(fit("tondu_lopez", points, CONTRACTOR), points)


def _shrinking_path() -> list[float]:
    phase = np.linspace(0.0, 6.0 * math.pi, 600)
    return list((1.0 - phase / (8.0 * math.pi)) * np.sin(phase))


def _loop(axis: Axes, update: Callable[[float], float], scale: float, path: list[float]) -> None:
    axis.plot([scale * x for x in path], [update(x) for x in path], linewidth=1.0)


@_picture("maxwell_slip")
def maxwell_slip() -> Figure:
    """Force against displacement, with shrinking loops."""
    figure, (axis,) = new_figure()
    element = MaxwellSlip([2000.0, 1500.0, 1000.0, 500.0], [5.0, 10.0, 15.0, 20.0])
    _loop(axis, element.update, 1e3, [0.03 * x for x in _shrinking_path()])
    _label(axis, "displacement [mm]", "friction force [N]", legend=False)
    return figure


@_picture("prandtl_ishlinskii")
def prandtl_ishlinskii() -> Figure:
    """Output against input, with shrinking loops."""
    figure, (axis,) = new_figure()
    element = PrandtlIshlinskii([0.0, 0.5, 1.0, 1.5], [0.5, 0.3, 0.2, 0.1])
    _loop(axis, element.update, 1.0, [3.0 * x for x in _shrinking_path()])
    _label(axis, "input [-]", "output [-]", legend=False)
    return figure


@_picture("bouc_wen")
def bouc_wen() -> Figure:
    """Hysteretic variable against displacement."""
    figure, (axis,) = new_figure()
    element = BoucWen(1.0, 0.7, 0.3)
    _loop(axis, element.update, 1.0, [3.0 * x for x in _shrinking_path()])
    _label(axis, "displacement x [-]", "z [-]", legend=False)
    return figure


@_picture("standard_linear_solid")
def standard_linear_solid() -> Figure:
    """Strain after a step of stress."""
    figure, (axis,) = new_figure()
    times = np.linspace(0.0, 120.0, 120)
    for viscosity in (5e6, 1e7, 3e7):
        solid = StandardLinearSolid(1e6, 2e7, viscosity * 40.0)
        axis.plot(
            times, 1e2 * solid.strain(3e4, times), label=f"time constant {solid.time_constant:g} s"
        )
    _label(axis, "time [s]", "strain [%]")
    return figure


@_picture("iso6358")
def iso6358() -> Figure:
    """Mass flow against the pressure ratio, compared with the ideal nozzle."""
    figure, (axis,) = new_figure()
    ratios = np.linspace(0.0, 1.0, 200)
    for critical in (0.2, 0.3, 0.5):
        flow = [gas.mass_flow(1e-8, critical, _SUPPLY, float(r) * _SUPPLY, 293.15) for r in ratios]
        axis.plot(ratios, 1e3 * np.array(flow), label=f"ISO 6358, b = {critical:g}")
    nozzle = [gas.orifice_flow(0.8, 6.33e-6, _SUPPLY, float(r) * _SUPPLY, 293.15) for r in ratios]
    axis.plot(ratios, 1e3 * np.array(nozzle), "k--", linewidth=0.9, label="ideal nozzle")
    axis.set_title("C = 1 L/(s bar) at 7 bar absolute", fontsize="small")
    _label(axis, "downstream/upstream pressure [-]", "mass flow [g/s]")
    return figure


@_picture("chambers")
def chambers() -> Figure:
    """A rigid chamber that is filled and shut: polytropic exponents and the first law compared."""
    figure, (left, right) = new_figure(2)
    volume, conductance, step = 1e-4, 2e-9, 1e-3
    times = np.arange(0.0, 1.2, step)

    def flow(pressure: float, time: float) -> float:
        if time > 0.4:
            return 0.0
        return float(gas.mass_flow(conductance, 0.3, _SUPPLY, pressure, 293.15))

    for exponent in (1.0, 1.2, 1.4):
        pressure, trace = _AMBIENT, []
        for time in times:
            trace.append(pressure)
            rate = gas.pressure_rate(
                flow(pressure, float(time)),
                pressure,
                volume,
                0.0,
                temperature=293.15,
                exponent=exponent,
            )
            pressure += step * float(rate)
        left.plot(times, np.array(trace) / 1e5, "--", linewidth=0.9, label=f"exponent {exponent:g}")
    for transfer in (0.0, 30.0, 100.0):
        wall = ThermalChamber(transfer, 0.02, 293.15)
        pressure, temperature, pressures, temperatures = _AMBIENT, 293.15, [], []
        for time in times:
            pressures.append(pressure)
            temperatures.append(temperature)
            pressure_rate, temperature_rate = wall.rates(
                pressure,
                temperature,
                volume=volume,
                volume_rate=0.0,
                inflow=flow(pressure, float(time)),
                inflow_temperature=293.15,
                outflow=0.0,
            )
            pressure += step * pressure_rate
            temperature += step * temperature_rate
        left.plot(times, np.array(pressures) / 1e5, label=f"h = {transfer:g} W/(m² K)")
        right.plot(times, np.array(temperatures) - 273.15, label=f"h = {transfer:g} W/(m² K)")
    _label(left, "time [s]", "pressure [bar absolute]")
    _label(right, "time [s]", "gas temperature [°C]")
    return figure


@_picture("fill_time")
def filling() -> Figure:
    """Time to fill a muscle to a pressure, for several valves."""
    figure, (axis,) = new_figure()
    ends = np.linspace(_AMBIENT, _SUPPLY, 120)
    for conductance in (3e-9, 1e-8, 3e-8):
        times = [
            fill_time(
                1e-4,
                conductance,
                0.3,
                supply_pressure=_SUPPLY,
                start_pressure=_AMBIENT,
                end_pressure=float(end),
            )
            for end in ends
        ]
        axis.plot(1e3 * np.array(times), ends / 1e5, label=f"C = {conductance * 1e8:g} L/(s bar)")
    axis.set_xscale("log")
    axis.set_title("0.1 L from a 7 bar supply", fontsize="small")
    _label(axis, "time [ms]", "pressure reached [bar absolute]")
    return figure


@_picture("tube")
def tube() -> Figure:
    """Conductance and delay of tubes."""
    figure, (left, right) = new_figure(2)
    lengths = np.linspace(0.1, 5.0, 60)
    for diameter in (2e-3, 4e-3, 6e-3):
        tubes = [StraightTube(float(length), diameter) for length in lengths]
        label = f"{1e3 * diameter:g} mm"
        left.plot(lengths, [t.conductance * 1e8 for t in tubes], label=label)
        right.plot(lengths, [t.attenuation(3e5) for t in tubes], label=label)
    left.set_yscale("log")
    _label(left, "tube length [m]", "ISO 6358 C [L/(s bar)]")
    _label(right, "tube length [m]", "amplitude ratio at 3 bar absolute [-]")
    return figure


@_picture("supply_bandwidth")
def supply_bandwidth() -> Figure:
    """Bandwidth against the share of the gas space that a filler takes, with and without a tube."""
    figure, (axis,) = new_figure()
    filled = np.linspace(0.0, 0.8, 60)
    for line, length in (("-", 0.0), ("--", 2.0)):
        for diameter in (0.002, 0.004) if length else (0.004,):
            pipe = StraightTube(length, diameter) if length else None
            rates = [
                SupplyLine(
                    1e-4, 1e-8, dead_volume=2e-5, filler_volume=1e-4 * float(f), tube=pipe
                ).cycle_bandwidth(
                    supply_pressure=_SUPPLY,
                    ambient_pressure=_AMBIENT,
                    low_pressure=1.5e5,
                    high_pressure=4e5,
                )
                for f in filled
            ]
            name = f"tube 2 m, {1e3 * diameter:g} mm" if length else "valve at the muscle"
            axis.plot(100.0 * filled, rates, line, label=name)
    axis.set_title("0.1 L muscle, 20 cm³ dead volume, 0.5 to 3 bar and back", fontsize="small")
    _label(axis, "muscle volume filled with solid [%]", "cycles per second [Hz]")
    return figure
