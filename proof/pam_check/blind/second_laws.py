"""Laws of the second plant: each effect by another formula, from other literature.

The nominal rig has one form only: braid and flow of the contract between rig file and recording
(ISO 6358-1:2013 for the valve). Every effect that leaves a choice takes another law here than
`truth_plant` says that it takes:

- Thread friction: generalised Bouc-Wen hysteresis with unequal branches (Song and Der Kiureghian,
  J. Eng. Mech. 132(6), 2006; for pneumatic muscles Aschemann and Schindele, IEEE Trans. Ind.
  Electron. 61(7), 2014); polymer threads rub less than in proportion to their load (Howell and
  Mazur, J. Text. Inst. 44(2), 1953).
- Dry friction: generalised Maxwell slip (Al-Bender, Lampaert and Swevers, Chaos 14(2), 2004) with
  the velocity weakening of Hess and Soom (J. Tribol. 112(1), 1990).
- Creep: a Burgers chain, that is one Maxwell and two Kelvin-Voigt elements in series (Findley, Lai
  and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, 1976).
- Bladder: three terms of Ogden (Proc. R. Soc. A 326, 1972) with his ratios for vulcanised rubber.
- Ends: frusta between braid and fittings, pulled by virtual work (cf. Tsagarakis and Caldwell, ICRA
  2000; Doumit, Fahim and Munro, IEEE Trans. Robot. 25(6), 2009).
- Extensible threads: a yarn that stiffens as its crimp is pulled out (Hearle, Grosberg and Backer,
  Structural Mechanics of Fibers, Yarns, and Fabrics, 1969).
- Cable: the exponential law of slack fibres (Fung, Am. J. Physiol. 213(6), 1967), lightly damped.
- Tube: a line of lumps with inertance, and laminar or turbulent resistance (Schuder and Binder, J.
  Basic Eng. 81(4), 1959; Richer and Hurmuzlu, J. Dyn. Syst. Meas. Control 122(3), 2000).
- Dead zone: sharp edges with a radial clearance, both open a little at the centre (Eryilmaz and
  Wilson, J. Dyn. Syst. Meas. Control 128(1), 2006).
- Exhaust: a silencer in series with the valve, which an opening spool begins to feel.
- Supply: a reservoir behind a pressure regulator whose poppet opens with the drop (Beater,
  Pneumatic Drives, 2007).
- Leaks: laminar compressible flow in narrow gaps (Beater, the same).
- Heat: a coefficient that grows with the root of pressure and temperature, and a wall that warms
  (Carneiro and de Almeida, Proc. IMechE I 220(1), 2006, after Eichelberg).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def compiled[F: Callable[..., Any]](function: F) -> F:
    """Compile with numba if it is installed, anew in each process.

    Machine code that numba keeps on disk would not notice that another of these files has changed.
    """
    try:
        from numba import njit  # noqa: PLC0415
    except ImportError:
        return function
    return cast(F, njit(function))


GAS_CONSTANT = 287.05  # J/(kg K)
HEAT_RATIO = 1.4
ISO_DENSITY, ISO_TEMPERATURE = 1.185, 293.15  # kg/m^3, K
VISCOSITY = 1.81e-5  # Pa s, of air
LINEAR_FROM = 0.999  # pressure ratio
OGDEN = ((6.3, 1.3), (0.012, 5.0), (-0.1, -2.0))
OGDEN_SHEAR = 0.5 * sum(modulus * power for modulus, power in OGDEN)
NARROW = 0.8
"""Radius of a relaxed bladder over that of the braid at rest length."""
CABLE_TOE = 400.0  # N
THREAD_TOE = 1500.0  # N, of all threads together
RUB_PRESSURE, RUB_POWER = 3.0e5, 0.85
SHAPE, FORTH, ASYMMETRY, SHARPNESS = 0.6, 0.4, 0.1, 1.5
"""Of the Bouc-Wen hysteresis; forth at most shape, so that no loop gives energy."""
WALL_CAPACITY, WALL_LOSS = 15.0, 0.15  # J/K and W/K: some 10 g of rubber, and still air
HEAT_PRESSURE = 3.0e5  # Pa absolute
PORT_VOLUME = 5e-7  # m^3, between valve and tube
LUMPS = 4


class SecondMuscle(NamedTuple):
    """Numbers of one muscle, its valve and its tube, as the laws need them (SI units)."""

    thread_length: float
    turns: float
    rest_length: float
    neutral_length: float
    dead_volume: float
    conductance: float
    critical_ratio: float
    time_constant: float
    spool_frequency: float
    """rad/s, of the slow spool; 0 for the written one."""
    overlap: float
    null: float
    spool_friction: float
    silencer: float
    """Conductance over that of the open valve; 0 for none."""
    leak: float
    """kg/(s Pa^2)"""
    tube_diameter: float
    tube_length: float
    heat: float
    """W/K at `HEAT_PRESSURE`"""
    rub: float
    """Thread friction over pressure and lateral area."""
    play: float
    creep_stiffness: float
    creep_share: float
    rubber: float
    """N m: volume of the bladder times its shear modulus."""
    taper: float
    """Length of an end over the step in radius."""
    hoop: float
    """Pa, that widens the bladder until its radius has grown by a quarter at rest length."""
    yarn: float
    """1/N, strain of the threads for little tension."""
    cable: float
    """m, stretch at which the tension of the cable is 1.7 times `CABLE_TOE`."""


@compiled
def flow_share(ratio: float, critical: float) -> float:
    """Mass flow over the choked one, for a pressure ratio of at most 1 (ISO 6358)."""
    if ratio <= critical:
        return 1.0
    if ratio <= LINEAR_FROM:
        return math.sqrt(1.0 - ((ratio - critical) / (1.0 - critical)) ** 2)
    last = math.sqrt(1.0 - ((LINEAR_FROM - critical) / (1.0 - critical)) ** 2)
    return last * (1.0 - ratio) / (1.0 - LINEAR_FROM)


@compiled
def iso_flow(c: float, one: float, other: float, t_one: float, t_other: float, b: float) -> float:
    """Mass flow from `one` to `other` [kg/s]; pressures absolute [Pa], temperatures [K]."""
    if one >= other:
        warm = math.sqrt(ISO_TEMPERATURE / t_one)
        return c * ISO_DENSITY * one * warm * flow_share(other / one, b)
    warm = math.sqrt(ISO_TEMPERATURE / t_other)
    return -c * ISO_DENSITY * other * warm * flow_share(one / other, b)


@compiled
def edge_opening(spool: float, overlap: float) -> float:
    """Opening of one edge, with the radial clearance of an overlapped spool."""
    if overlap <= 0.0:
        return min(max(spool, 0.0), 1.0)
    past = (spool - overlap) / (1.0 - overlap)
    clearance = 0.3 * overlap
    return min(0.5 * (past + math.sqrt(past * past + clearance * clearance)), 1.0)


@compiled
def behind_silencer(opening: float, silencer: float) -> float:
    """Opening of an edge that a silencer in series is equivalent to."""
    if silencer <= 0.0 or opening <= 0.0:
        return opening
    return 1.0 / math.sqrt(1.0 / (opening * opening) + 1.0 / (silencer * silencer))


@compiled
def regulated_flow(conductance: float, stated: float, held: float) -> float:
    """Mass flow of a regulator [kg/s] whose poppet is fully open at a drop of 30 %."""
    opening = min(max((1.0 - held / stated) / 0.3, 0.0), 1.0)
    return conductance * ISO_DENSITY * stated * opening


@compiled
def line_resistance(flow: float, density: float, diameter: float) -> float:
    """Rate at which friction stops the gas in a line [1/s]: Hagen-Poiseuille or Blasius."""
    area = 0.25 * math.pi * diameter * diameter
    laminar = 32.0 * VISCOSITY / (density * diameter * diameter)
    reynolds = 4.0 * abs(flow) / (math.pi * diameter * VISCOSITY)
    if reynolds < 1.0:
        return laminar
    factor = 0.3164 / math.sqrt(math.sqrt(reynolds))
    return max(laminar, factor * abs(flow) / (2.0 * density * area * diameter))


@compiled
def thread(m: SecondMuscle, gauge: float, length: float) -> float:
    """Length of a thread under the tension that the gauge pressure gives it [m]."""
    b = m.thread_length
    if m.yarn <= 0.0 or gauge <= 0.0:
        return b
    for _ in range(6):
        tension = gauge * b * length / (2.0 * math.pi * m.turns**2)
        strain = m.yarn * THREAD_TOE * (1.0 - math.exp(-tension / THREAD_TOE))
        b = m.thread_length * (1.0 + strain)
    return b


@compiled
def braid_volume(m: SecondMuscle, b: float, length: float) -> float:
    """Volume inside the braid [m^3]: a cylinder, less what its tapered ends lack."""
    volume = length * (b * b - length * length) / (4.0 * math.pi * m.turns**2)
    if m.taper > 0.0:
        fitting = math.sqrt(m.thread_length**2 - m.rest_length**2) / (math.pi * m.turns)
        step = math.sqrt(b * b - length * length) / (math.pi * m.turns) - fitting
        if step > 0.0:
            volume -= m.taper * math.pi / 12.0 * step * step * (2.0 * step + 3.0 * fitting)
    return volume


@compiled
def gas_volume(m: SecondMuscle, gauge: float, length: float) -> tuple[float, float, float]:
    """Gas volume [m^3], and its derivatives by length [m^2] and by pressure [m^3/Pa]."""
    here = braid_volume(m, thread(m, gauge, length), length)
    d = 1e-6
    more = braid_volume(m, thread(m, gauge, length + d), length + d)
    less = braid_volume(m, thread(m, gauge, length - d), length - d)
    by_pressure = 0.0
    if m.yarn > 0.0:
        higher = braid_volume(m, thread(m, gauge + 10.0, length), length)
        by_pressure = (higher - here) / 10.0
    return here + m.dead_volume, (more - less) / (2.0 * d), by_pressure


@compiled
def carried_pressure(m: SecondMuscle, gauge: float, length: float) -> float:
    """The part of the pressure that a bladder narrower than the braid passes on [Pa].

    A thin tube of a neo-Hookean solid takes p = (mu T/R) (1 - (R/r)^4) to widen from R to r at
    constant length (Treloar, The Physics of Rubber Elasticity, chapter 4).
    """
    b, rest = m.thread_length, m.rest_length
    narrower = NARROW**4 * ((b * b - rest * rest) / (b * b - length * length)) ** 2
    taken = m.hoop * (1.0 - min(narrower, 1.0)) / (1.0 - NARROW**4)
    return max(gauge - taken, 0.0)


@compiled
def ogden_pull(m: SecondMuscle, length: float) -> float:
    """Pull of an incompressible bladder that follows the braid [N]."""
    b, rest = m.thread_length, m.rest_length
    along = length / rest
    width = (b * b - rest * rest) / (b * b - length * length)
    around = 1.0 / math.sqrt(width)
    through = 1.0 / (along * around)
    by_around = -length * rest / ((b * b - rest * rest) * around)
    total = 0.0
    for modulus, power in OGDEN:
        slope_along = along ** (power - 1.0) - through**power / along
        slope_around = around ** (power - 1.0) - through**power / around
        total += modulus * (slope_along + slope_around * by_around)
    return m.rubber / OGDEN_SHEAR / rest * total


@compiled
def pull(
    m: SecondMuscle, gauge: float, length: float, hysteresis: float, crept: float, start: float
) -> float:
    """Pull of a muscle [N], never below 0.

    Parameters
    ----------
    m : SecondMuscle
    gauge : float
        Pa.
    length, start : float
        m, now and when the bladder was relaxed.
    hysteresis : float
        State of the thread friction, some -1 to 1.
    crept : float
        m, of the Burgers chain without its spring.
    """
    if gauge <= 0.0:
        force = 0.0
    else:
        b = thread(m, gauge, length)
        carried = carried_pressure(m, gauge, length) if m.hoop > 0.0 else gauge
        if m.taper > 0.0:
            d = 1e-6
            more, less = braid_volume(m, b, length + d), braid_volume(m, b, length - d)
            force = carried * (less - more) / (2.0 * d)
        else:
            force = carried * (3.0 * length * length - b * b) / (4.0 * math.pi * m.turns**2)
        if m.rub > 0.0:
            diameter = math.sqrt(b * b - length * length) / (math.pi * m.turns)
            lateral = math.pi * diameter * length
            load = RUB_PRESSURE * (gauge / RUB_PRESSURE) ** RUB_POWER
            force += m.rub * lateral * load * hysteresis
    if m.rubber > 0.0:
        force += ogden_pull(m, length)
    force += m.creep_stiffness * (length - start - crept)
    return max(force, 0.0)


@compiled
def hysteresis_rate(m: SecondMuscle, state: float, speed: float) -> float:
    """Rate of the Bouc-Wen state [1/s] at a rate of the length [m/s]."""
    if m.rub <= 0.0:
        return 0.0
    forth = 1.0 if speed > 0.0 else -1.0
    along = 1.0 if state * speed > 0.0 else -1.0
    psi = SHAPE * along + FORTH + ASYMMETRY * forth
    return 2.0 * speed / m.play * (1.0 - math.pow(abs(state), SHARPNESS) * psi)


@compiled
def cable_tension(m: SecondMuscle, stretch: float) -> float:
    """Tension of the cable [N]; a slack one has none."""
    if stretch <= 0.0:
        return 0.0
    return CABLE_TOE * (math.exp(min(stretch / m.cable, 8.0)) - 1.0)


@compiled
def heat_flow(m: SecondMuscle, pressure: float, gas: float, wall: float, ambient: float) -> float:
    """Heat from the wall into the gas [W]."""
    share = math.sqrt(pressure * gas / (HEAT_PRESSURE * ambient))
    return m.heat * share * (wall - gas)
