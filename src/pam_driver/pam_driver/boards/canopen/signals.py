"""Reads the set points and measurements of a CANopen device from its section of the rig file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from pam_driver.boards.canopen.dictionary import Dictionary, ObjectName, ObjectType, object_name
from pam_driver.boards.canopen.pdo_plan import RPDO, TPDO, default_carrier
from pam_driver.boards.conversion import Source, fits, read_conversion
from pam_driver.boards.protocol import Channel, MuscleWire, WiredBoard
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT, SUPPLY_INPUT
from pam_driver.boards.units import ANGLE, PRESSURE, SHARE, UNITS, Linear, unit_called, unknown_unit
from pam_model.rig.keys import Section

_QUANTITIES: Final = {
    "setpoints": (PRESSURE, SHARE),
    "pressures": (PRESSURE,),
    "supply": (PRESSURE,),
    "angles": (ANGLE,),
}
_FLOAT_LIMIT: Final = 1e30
EXAMPLE: Final = '"0x6411:1"'


class UnplacedInput(NamedTuple):
    """A measurement before it has a place in a PDO; see `device.Input`."""

    what: str
    channel: Channel
    name: ObjectName
    linear: Linear
    low: float
    high: float
    invalid: Mapping[int, str]
    wraps: bool
    unit: str
    slope: float


class Demand(NamedTuple):
    """A set point before it has a place in a PDO; see `device.Output`."""

    place: int
    name: ObjectName
    linear: Linear
    low: float
    high: float
    vented: float
    error_value: float | None
    key: str


@dataclass
class SignalReader:
    """Reads all signals of one device; problems are added to the section."""

    wired: WiredBoard
    dictionary: Dictionary
    top: Section
    # demands, readings: set points and measurements
    demands: list[Demand] = field(default_factory=list)
    readings: list[UnplacedInput] = field(default_factory=list)
    # the types of all objects that are used
    types: dict[ObjectName, ObjectType] = field(default_factory=dict)
    _used: dict[ObjectName, str] = field(default_factory=dict)

    def read(self) -> None:
        """Read all keys that concern signals."""
        valves = {str(wire.channel): wire for wire in self.wired.valves}
        for where, channel in self._channels(
            "setpoints", {c: w.muscle.name for c, w in valves.items()}
        ):
            self._read_setpoint(where, valves[channel])
        sensors = {str(wire.channel): wire for wire in self.wired.pressures}
        for where, channel in self._channels(
            "pressures", {c: w.muscle.name for c, w in sensors.items()}
        ):
            limit = sensors[channel].muscle.max_pressure
            self._read_input(
                where,
                PRESSURE_INPUT,
                sensors[channel].channel,
                (0.0, limit),
                f"{sensors[channel].muscle.name} needs 0 to max_pressure = {limit:g} Pa gauge",
            )
        joints = {str(wire.channel): wire for wire in self.wired.angles}
        for where, channel in self._channels(
            "angles", {c: w.joint.name for c, w in joints.items()}
        ):
            low, high = joints[channel].joint.position_limits
            self._read_input(
                where,
                ANGLE_INPUT,
                joints[channel].channel,
                (low, high),
                f"position_limits of {joints[channel].joint.name} are {low:g} to {high:g} rad",
            )
        if "supply" in self.top.tree:
            self._read_input(self.top.section("supply"), SUPPLY_INPUT, "", None, "")

    def _channels(self, name: str, owners: Mapping[str, str]) -> list[tuple[Section, str]]:
        """The sections of the wired channels; a problem for those missing, or of nobody."""
        section = self.top.section(name)
        given = {str(key): key for key in section.tree}
        for channel, owner in owners.items():
            if channel not in given:
                section.add(channel, f": missing; {owner} is wired to this channel")
        found = []
        for channel, key in given.items():
            section.get(key)
            if channel not in owners:
                whose = "muscle" if name != "angles" else "joint"
                section.add(channel, f": no {whose} of the rig is wired to this channel")
                continue
            found.append((section.section(key), channel))
        return found

    def _object(self, where: Section, *, sent: bool) -> tuple[ObjectName, ObjectType] | None:
        value = where.get("object")
        name = object_name(value)
        if name is None:
            given = ": missing" if value is None else f" = {value!r}"
            where.add("object", f"{given}; must be index and sub-index, as {EXAMPLE}")
            return None
        file = self.dictionary.file
        entry, kind = self.dictionary.find(name), self.dictionary.type_of(name)
        problem = ""
        if entry is None:
            problem = f"{file} has no such object{self.dictionary.near(name)}"
        elif kind is None:
            problem = f"{file} says that it is no number of 8 to 64 bits"
        elif not entry.pdo_mappable and not self._carried(name, sent=sent):
            problem = f"{file} says that it cannot be mapped to a PDO"
        elif sent and not entry.writable:
            problem = f"{file} says that it cannot be written ({entry.access_type})"
        elif not sent and not entry.readable:
            problem = f"{file} says that it cannot be read ({entry.access_type})"
        if problem:
            where.add("object", f" = {name}: {problem}")
            return None
        mine = where.key("object")
        other = self._used.setdefault(name, mine)
        if other != mine:
            where.add("object", f" = {name}: {other} uses this object as well")
            return None
        assert kind is not None
        self.types[name] = kind
        return name, kind

    def _carried(self, name: ObjectName, *, sent: bool) -> bool:
        """Whether the file maps an object by default, although it calls it not mappable."""
        carrier = default_carrier(self.dictionary, name, RPDO if sent else TPDO)
        if carrier:
            self._doubt(name, f"PDOMapping is not 1, but {carrier} carries it, so that it is used")
        return bool(carrier)

    def _doubt(self, name: ObjectName, text: str) -> None:
        self.dictionary.doubts.append(f"line {self.dictionary.line(name)}: {name}: {text}")

    def _conversion(
        self, where: Section, name: ObjectName, key: str
    ) -> tuple[Linear, str, str, float] | None:
        """From raw values to SI; the quantity; the unit of the wire; its units for one count."""
        entry = self.dictionary.find(name)
        assert entry is not None
        counts = self._counts(where)
        if counts is False:
            return None
        source = Source(str(name), entry.unit, f"file {self.dictionary.file}")
        slope, start = entry.factor if entry.unit else 1.0, 0.0
        if not isinstance(counts, bool):
            unit, slope, start = counts
            source = Source(str(name), unit, "key counts")
        quantities = _QUANTITIES[key]
        flow = key == "setpoints" and any(
            wire.muscle.valve.kind == "flow" and self._is_at(where, wire)
            for wire in self.wired.valves
        )
        converted = read_conversion(
            where,
            source,
            (SHARE,) if flow else quantities,
            self.wired.ambient_pressure,
            absolute=key == "supply",
        )
        if converted is None:
            return None
        linear, quantity = converted
        unit = unit_called(str(where.tree.get("unit") or source.unit)) or ""
        raw = Linear(linear.factor * slope, linear.factor * start + linear.offset)
        if not raw.is_usable:
            where.add(
                "object",
                f" = {name}: gives the conversion {raw.factor:g} x + {raw.offset:g} "
                f"({self.dictionary.file}, line {self.dictionary.line(name)})",
            )
            return None
        return raw, quantity, unit, slope

    @staticmethod
    def _is_at(where: Section, wire: MuscleWire) -> bool:
        return where.path.endswith(f".{wire.channel}")

    def _counts(self, where: Section) -> tuple[str, float, float] | bool:
        """Unit, its units for one count, its value at count 0; True: not given, False: wrong."""
        counts = where.get("counts")
        if counts is None:
            return True
        shape = "must be two points, as {raw: [0, 32767], V: [0.0, 10.0]}"
        names = [name for name in counts if name != "raw"] if isinstance(counts, Mapping) else []
        if not isinstance(counts, Mapping) or "raw" not in counts or len(names) != 1:
            where.add("counts", f" = {counts!r}: {shape}")
            return False
        unit = unit_called(str(names[0]))
        if unit is None:
            every = sorted({quantity for quantity, _ in UNITS.values()})
            where.add("counts", f".{names[0]}: unknown unit; {unknown_unit(names[0], every)}")
            return False
        points = [counts["raw"], counts[names[0]]]
        for values in points:
            if (
                not isinstance(values, list | tuple)
                or len(values) != 2
                or not all(
                    isinstance(value, int | float)
                    and not isinstance(value, bool)
                    and abs(value) < 1e15
                    for value in values
                )
            ):
                where.add("counts", f" = {counts!r}: {shape}")
                return False
        (x0, x1), (y0, y1) = ((float(low), float(high)) for low, high in points)
        if x0 == x1 or y0 == y1:
            where.add("counts", ": the two points must differ in both")
            return False
        slope = (y1 - y0) / (x1 - x0)
        return unit, slope, y0 - slope * x0

    def _range(self, name: ObjectName, kind: ObjectType) -> tuple[float, float]:
        """The raw values of an object, by its type and the limits in the EDS file."""
        if kind.is_float:
            return -_FLOAT_LIMIT, _FLOAT_LIMIT
        low = -(1 << kind.bits - 1) if kind.signed else 0
        high = (1 << kind.bits - int(kind.signed)) - 1
        entry = self.dictionary.find(name)
        if entry is None:
            return low, high
        limits = [low if entry.min is None else entry.min, high if entry.max is None else entry.max]
        if limits[0] >= limits[1]:
            self._doubt(
                name,
                f"LowLimit = {limits[0]} and HighLimit = {limits[1]} leave no range, and are not "
                "used",
            )
            return low, high
        return max(low, limits[0]), min(high, limits[1])

    def _read_setpoint(self, where: Section, wire: MuscleWire) -> None:
        found = self._object(where, sent=True)
        if found is None:
            return
        name, kind = found
        converted = self._conversion(where, name, "setpoints")
        given = where.get("error_value")
        if given is not None and (isinstance(given, bool) or not isinstance(given, int)):
            where.add("error_value", f" = {given!r}: must be a raw value of 0x6444, a whole number")
            given = None
        if converted is None:
            return
        where.finish()
        linear, quantity, *_ = converted
        valve = wire.muscle.valve
        full = (valve.full_scale or 0.0) if quantity == PRESSURE else 1.0
        # fraction -> raw: (full * fraction - offset) / factor
        device = Linear(full / linear.factor, -linear.offset / linear.factor)
        low, high = self._range(name, kind)
        vented = 0.0 if valve.kind == "pressure_regulator" else -1.0
        for text, fraction in (("vented", vented), ("at full scale", 1.0)):
            raw = device.si(fraction)
            if not fits(raw, low - 0.5, high + 0.5):
                of = f" (valve.full_scale = {full:g} Pa gauge)" if quantity == PRESSURE else ""
                where.add(
                    "object",
                    f" = {name}: takes raw values from {low:g} to {high:g}, but the set point of "
                    f"{wire.muscle.name} {text}{of} is {raw:.6g}",
                )
                return
        error = float(given) if isinstance(given, int) else None
        self.demands.append(Demand(wire.place, name, device, low, high, vented, error, where.path))

    def _read_input(
        self,
        where: Section,
        what: str,
        channel: Channel,
        needed: tuple[float, float] | None,
        owner: str,
    ) -> None:
        found = self._object(where, sent=False)
        if found is None:
            return
        name, kind = found
        key = {PRESSURE_INPUT: "pressures", ANGLE_INPUT: "angles"}.get(what, "supply")
        converted = self._conversion(where, name, key)
        wraps = where.flag("wraps") if what == ANGLE_INPUT else False
        invalid = self._invalid(where, kind)
        if converted is None:
            return
        where.finish()
        linear, _, unit, slope = converted
        low, high = self._range(name, kind)
        ends = sorted((linear.si(low), linear.si(high)))
        if needed is not None and not wraps and not all(fits(end, *ends) for end in needed):
            si = "rad" if what == ANGLE_INPUT else "Pa gauge"
            where.add(
                "object", f" = {name}: shows {ends[0]:.6g} to {ends[1]:.6g} {si}, but {owner}"
            )
            return
        self.readings.append(
            UnplacedInput(what, channel, name, linear, low, high, invalid, wraps, unit, slope)
        )

    def _invalid(self, where: Section, kind: ObjectType) -> dict[int, str]:
        section = where.section("invalid")
        found = {}
        for name in section.tree:
            raw = section.get(name)
            if isinstance(raw, bool) or not isinstance(raw, int) or kind.is_float:
                section.add(str(name), f" = {raw!r}: must be a raw value of an integer object")
                continue
            if kind.signed and raw >> (kind.bits - 1) == 1:
                raw -= 1 << kind.bits  # the same bits, written without a sign
            found[raw] = str(name)
        return found
