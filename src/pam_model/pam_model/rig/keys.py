"""The keys of a rig file with units and bounds, and a reader that collects all problems."""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from pam_model.unit_hints import units_that_fit
from pam_model.within_limits import beyond

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""A name in a rig file."""
# YAML 1.1 reads 2e-05, without a point, as text; ROS reads it as a number
_EXPONENT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")


BETWEEN = "between"
"""Key of a range in place of a number, in a rig file that is to be calibrated."""
FOUND = "; `pam gap calibrate` finds it from a recording"


@dataclass(frozen=True, slots=True)
class Key:
    """A number in a rig file: its unit, bounds, and its default if it is optional.

    A number that is `by_size` may be left out as well: it then follows from the rest of the rig.
    `text` says what it means, in one line. `guess` is where a calibration begins that finds the
    number from a recording; None for a number that no recording determines. One that `is_measured`
    must be written, but a calibration corrects it within its range.
    """

    unit: str
    low: float
    high: float
    default: float | None = None
    by_size: bool = False
    text: str = ""
    guess: float | None = None
    is_measured: bool = False

    @property
    def may_be_range(self) -> bool:
        """Whether a rig file that is to be calibrated may have a range in place of the number."""
        return self.is_measured or self.guess is not None


TURN = 2.0 * math.pi
POSITION_LIMITS = Key("rad", -TURN, TURN, text="lowest and highest position of the joint")
LENGTH_TOLERANCE = Key(
    "-",
    0.0,
    0.5,
    text="the same for pulley radius, thread length, turns, neutral length and wall thickness",
)
"""Optional; without it, lengths have the tolerance of all numbers."""
# a table: unit, lowest, highest and usual value of each key stand in one line
# fmt: off
NUMBERS: Mapping[str, Mapping[str, Key]] = {
    "": {
        "supply_pressure": Key("Pa absolute", 1.05e5, 2.5e6, text="what the valves draw from",
            is_measured=True),
        "parameter_tolerance": Key("-", 0.0, 0.5, 0.02,
            text="how far the true value of a number may be from the written one, relative "
                 "(0.02 = 2 %)"),
    },
    "gas": {
        "temperature": Key("K", 200.0, 400.0, 293.15, text="of gas and ambient"),
        "ambient_pressure": Key("Pa absolute", 3e4, 1.3e5, 101325.0,
            text="pressure around the robot"),
        "polytropic_exponent": Key("-", 1.0, 1.4, 1.0,
            text="1.0 isothermal (nominal) to 1.4 adiabatic"),
    },
    "bus": {
        "bitrate": Key("bit/s", 10_000, 1_000_000, 1_000_000,
            text="for the bus load; with CAN FD, that of the arbitration phase"),
        "data_bitrate": Key("bit/s", 10_000, 8_000_000, 2_000_000,
            text="of the data phase of CAN FD frames"),
        "port": Key("-", 1024, 65535, 43113, text="UDP port, used by udp_multicast only"),
    },
    "joint": {
        "pulley_radius": Key("m", 1e-3, 0.5, is_measured=True,
            text="radius at which the tendons of both muscles pull"),
        "inertia": Key("kg m^2", 1e-8, 1e3, text="about the joint's axis", guess=1e-3),
        "viscous_friction": Key("N m s/rad", 0.0, 1e3, 0.0, guess=1e-3,
            text="torque of the joint's own damping over its speed"),
        "gravity_torque": Key("N m", -1e4, 1e4, 0.0, guess=0.0,
            text="m g l; torque = -gravity_torque sin(position - gravity_angle); 0 on a joint "
                 "with a vertical axis"),
        "gravity_angle": Key("rad", -TURN, TURN, 0.0, guess=0.0,
            text="position at which gravity exerts no torque"),
        "max_velocity": Key("rad/s", 0.01, 100.0, 6.0,
            text="largest speed of the joint; references keep 60 % of it, and the driver stops "
                 "a joint that is measured to be faster"),
        "reduced_velocity": Key("rad/s", 0.01, 100.0, 0.5,
            text="the same while full speed is not permitted"),
        "max_acceleration": Key("rad/s^2", 0.1, 1e5, 200.0,
            text="largest acceleration of a reference"),
        "max_tracking_error": Key("rad", 1e-3, 10.0, by_size=True,
            text="largest difference between reference and measurement that may last"),
        "max_stiffness_rate": Key("N m/(rad s)", 1e-2, 1e5, 50.0,
            text="largest rate of change of the stiffness reference"),
    },
    "muscle": {
        "thread_length": Key("m", 5e-3, 10.0, text="b, length of one thread of the braid",
            is_measured=True),
        "turns": Key("-", 1e-2, 1e3, text="n, turns of one thread about the axis",
            is_measured=True),
        "wall_thickness": Key("m", 0.0, 0.02, 0.0, text="t_k, bladder and sheath"),
        "rest_length": Key("m", 5e-3, 10.0, text="unpressurised braid length"),
        "neutral_length": Key("m", 5e-3, 10.0, text="length at joint position 0",
            is_measured=True),
        "dead_volume": Key("m^3", 0.0, 0.01, 0.0, guess=2e-5,
            text="gas volume outside the braid (fittings, tube)"),
        "max_pressure": Key("Pa gauge", 1e4, 2.5e6, text="the driver vents above it"),
    },
    "valve": {
        "sonic_conductance": Key("m^3/(s Pa)", 1e-12, 1e-5, guess=5e-9,
            text="ISO 6358 C, fully open"),
        "critical_ratio": Key("-", 0.0, 0.99, 0.3, text="ISO 6358 b", guess=0.3),
        "time_constant": Key("s", 1e-5, 2.0, 0.005, guess=0.008,
            text="of the spool, first order; pressure regulator: of each of its two poles"),
        "damping": Key("-", 0.1, 3.0,
            text="pressure regulator: damping ratio of its two poles (without: 1); below 1 it "
                 "overshoots"),
        "full_scale": Key("Pa gauge", 1e4, 2.5e6,
            text="pressure regulator: what a command of 100 % means"),
    },
    "people": {
        "deadline": Key("s", 0.05, 5.0, 0.2,
            text="an input without a message for longer forbids motion, or full speed"),
        "slowing_time": Key("s", 0.1, 5.0, 0.5,
            text="time in which the controller brakes after full speed is no longer permitted; "
                 "then the driver stops a joint above its reduced_velocity"),
        "dump_valve_fill_time": Key("s", 0.0, 30.0, 0.0,
            text="time that the supply needs after the dump valve was closed; until then, and "
                 "while it is open, a low supply is no fault. 0: no dump valve"),
        "brake_release_delay": Key("s", 0.0, 5.0, 0.0,
            text="time from the first command of the driver to a board until its brake is "
                 "released: meanwhile the controller builds up the pressure that holds the joint"),
    },
    "plausibility": {
        "pressure_residual": Key("Pa", 1e3, 2.5e6, by_size=True,
            text="deviation of a pressure from what valve and gas should give"),
        "torque_share": Key("-", 0.01, 100.0, 0.25,
            text="deviation of the torque of the pressures from what the motion needs, divided "
                 "by the torque of the agonist at its highest pressure"),
        "warning_share": Key("-", 0.05, 1.0, 0.5,
            text="share of any of these limits at which a warning begins"),
        "pressure_noise": Key("Pa", 10.0, 2.5e6, by_size=True,
            text="standard deviation between neighbouring samples"),
        "position_noise": Key("rad", 1e-4, 10.0, by_size=True,
            text="standard deviation of neighbouring samples"),
        "position_jump": Key("rad", 1e-3, 10.0, by_size=True,
            text="change of an angle between neighbouring samples"),
        "position_margin": Key("rad", 0.0, 10.0, 0.05,
            text="how far the angle of a joint may exceed position_limits"),
        "pressure_rate": Key("Pa/s", 1e4, 1e9, by_size=True,
            text="fastest plausible change of a pressure, over 10 ms"),
        "supply_share": Key("-", 0.0, 1.0, 0.5,
            text="lowest supply pressure divided by the nominal one, both gauge"),
        "supply_high_share": Key("-", 1.01, 100.0, 1.3,
            text="highest supply pressure divided by the nominal one, both gauge"),
    },
}
# fmt: on
"""Every number of a rig file, by section ("" is the top level)."""


def _looks_like(value: float, key: Key) -> str:
    """The hint which unit a value out of bounds seems to have; "" if there is none."""
    if key.unit == "K" and key.low <= value + 273.15 <= key.high:
        return "; looks like deg C"
    units = [name for name, _ in units_that_fit(value, key.unit, key.low, key.high)]
    own = key.unit.removesuffix(" gauge").removesuffix(" absolute")
    return f"; looks like {' or '.join(units)}, {own} expected" if units else ""


def _plain(tree: Any) -> Any:
    """A section with lists in place of the arrays that ROS makes of lists of numbers."""
    if isinstance(tree, Mapping):
        return {key: _plain(value) for key, value in tree.items()}
    return list(tree) if isinstance(tree, array) else tree


class Problems:
    """All problems of one file; without a `source`, the lines begin with the key.

    `doubts` are lines about what is odd, although the file can be used.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.lines: list[str] = []
        self.doubts: list[str] = []

    def add(self, key: str, text: str) -> None:
        """Add a problem with a key of the file; `text` follows the key."""
        source = f"{self.source}: " if self.source else ""
        self.lines.append(f"{source}{key}{text}")


def _slip(value: object) -> str:
    """What is wrong with a text that looks like a number."""
    if isinstance(value, str) and re.fullmatch(r"[-+]?\d+,\d+", value):
        return f", with a decimal point: {value.replace(',', '.')}"
    if isinstance(value, str) and re.fullmatch(r"[-+]?\d*\.?\d+", value):
        return f", without quotes: {value}"
    return ""


class Section:
    """One mapping of the file, read key by key; keys that were not read are unknown keys."""

    def __init__(self, tree: Any, path: str, problems: Problems) -> None:
        self.path = path
        self.problems = problems
        if not isinstance(tree, Mapping):
            problems.add(path, f" = {tree!r}: must be a mapping of keys")
            tree = {}
        self.tree = tree
        self.asked: list[str] = []

    def key(self, name: str) -> str:
        """The full key of `name` in the file."""
        return f"{self.path}.{name}" if self.path else name

    def add(self, name: str, text: str) -> None:
        """Add a problem with the key `name`; `text` follows the key."""
        self.problems.add(self.key(name), text)

    def doubt(self, name: str, text: str) -> None:
        """Add a doubt about the key `name`; `text` follows the key."""
        self.problems.doubts.append(f"{self.key(name)}{text}")

    def get(self, name: str) -> Any:
        """The value of a key, or None if the key is missing."""
        self.asked.append(name)
        return self.tree.get(name)

    def section(self, name: str) -> Section:
        """The mapping under a key, empty if the key is missing."""
        tree = self.get(name)
        return Section({} if tree is None else tree, self.key(name), self.problems)

    def check(self, name: str, value: Any, key: Key) -> float | None:
        """A value as a number within its bounds; else None, and a problem is added."""
        if isinstance(value, str) and _EXPONENT.fullmatch(value):
            value = float(value)
        unit = "" if key.unit == "-" else f" {key.unit}"
        if isinstance(value, Mapping) and BETWEEN in value:
            self.add(
                name,
                f": a range, where a number{unit and ' in' + unit} is needed"
                f"{FOUND if key.may_be_range else ''}",
            )
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.add(name, f" = {value!r}: must be a number{unit and ' in' + unit}{_slip(value)}")
            return None
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.add(name, f" = {number}{unit}: must be a finite number")
            return None
        if not key.low <= number <= key.high:
            told, low, high = beyond(number, key.low, key.high)
            text = f" = {told}{unit}: must be from {low} to {high}{unit}"
            self.add(name, text + _looks_like(number, key))
            return None
        return number

    def number(self, name: str, key: Key, *, optional: bool = False) -> float | None:
        """The number under a key or its default; else None, and a problem is added."""
        value = self.get(name)
        if value is None:
            if key.default is None and not (optional or key.by_size):
                unit = "" if key.unit == "-" else f" in {key.unit}"
                found = "" if key.guess is None else FOUND
                self.add(name, f": missing; a number{unit} is needed{found}")
            return key.default
        return self.check(name, value, key)

    def place(self, name: str, default: int | None = None) -> int | str | None:
        """A board or channel: an integer from 0 on, or a name; else None, with a problem added."""
        value = self.get(name)
        if value is None:
            return default
        if isinstance(value, str) and NAME.fullmatch(value):
            return value
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.add(name, f" = {value!r}: must be a whole number from 0 on, or a name")
            return None
        return value

    def named_sections(self) -> dict[str, dict[str, Any]]:
        """Every key as a section whose keys are read elsewhere; a problem for every other value."""
        found: dict[str, dict[str, Any]] = {}
        for name, tree in self.tree.items():
            if not isinstance(name, str) or not NAME.fullmatch(name):
                self.add(str(name), ": is not a name (letters, digits and _, a letter first)")
            elif not isinstance(tree, Mapping) or not isinstance(tree.get("kind"), str):
                self.add(name, f" = {tree!r}: must be a section with the key kind, a text")
            else:
                found[name] = _plain(tree)
        return found

    def flag(self, name: str) -> bool:
        """True or false, by default false; a problem is added for every other value."""
        value = self.get(name)
        if value is not None and not isinstance(value, bool):
            self.add(name, f" = {value!r}: must be true or false")
        return value is True

    def names(self, name: str) -> list[str] | None:
        """A list of names; else None, and a problem is added."""
        value = self.get(name)
        if isinstance(value, str) or not isinstance(value, Sequence):
            what = ": missing" if value is None else f" = {value!r}"
            self.add(name, f"{what}; must be a list of names, as [a, b]")
            return None
        for entry in value:
            if not isinstance(entry, str) or not NAME.fullmatch(entry):
                self.add(name, f": {entry!r} is not a name (letters, digits and _, a letter first)")
                return None
        return [str(entry) for entry in value]

    def finish(self, allowed: Collection[str] = ()) -> None:
        """Add a problem for every key that was not read and is not `allowed`."""
        known = [*self.asked, *allowed]
        for name in self.tree:
            if name not in known:
                close = get_close_matches(str(name), known, 1)
                hint = f"; did you mean {close[0]}?" if close else ""
                is_section = not self.path and isinstance(self.tree[name], Mapping)
                what = ": no joint or muscle has this name" if is_section else ": unknown key"
                self.add(str(name), what + hint)
