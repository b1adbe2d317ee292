"""Reads the section of a CANopen device in the rig file, and checks it against its EDS file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from pam_driver.boards.canopen import configuration
from pam_driver.boards.canopen.device import (
    CanopenDevice,
    CanopenInput,
    CanopenOutput,
    Check,
    Rpdo,
    Step,
    Tpdo,
)
from pam_driver.boards.canopen.dictionary import (
    PROFILES,
    Dictionary,
    EdsError,
    ObjectName,
    profile_path,
)
from pam_driver.boards.canopen.pdo_plan import (
    RPDO,
    TPDO,
    PdoDirection,
    PdoPlan,
    mapped_in_file,
    steps_of,
    unused_off,
    written,
)
from pam_driver.boards.canopen.signals import SignalReader
from pam_driver.boards.canopen.step_check import refused_steps, refused_timing
from pam_driver.boards.protocol import Promises, WiredBoard
from pam_model.errors import RigError
from pam_model.rig.keys import Key, Problems, Section

_HEARTBEAT: Final = Key("s", 0.005, 1.0, 0.05)
_WATCHDOG: Final = Key("s", 0.02, 5.0, 0.1)
_PERIOD: Final = Key("s", 0.001, 0.05, 0.002)
_SDO_TIMEOUT: Final = Key("s", 0.005, 5.0, 0.1)
_UNSIGNED: Final = Key("-", 0, 0xFFFF_FFFF)
_HOST_NODE: Final = 127
_MOST: Final = 8  # lines of a file that are reported one by one
_HEARTBEATS_FOR_A_WATCHDOG: Final = 20
_CONSUMER: Final = ObjectName(0x1016, 1)


class CanopenDeviceReader:
    """Reads one device; `problems` has one line for everything that is wrong.

    Parameters
    ----------
    wired : WiredBoard
        The section of the rig file, and the muscles and joints of the device.

    Attributes
    ----------
    problems : list of str
        What is wrong; empty if `device` can be used.
    doubts : list of str
        What is wrong with the EDS file where the device does not depend on it.
    device : CanopenDevice or None
        The device, if nothing is wrong.
    dictionary : Dictionary or None
        Its objects, if the EDS file can be read.
    """

    def __init__(self, wired: WiredBoard) -> None:
        collected = Problems("")
        self.problems = collected.lines
        self.doubts = collected.doubts
        self.device: CanopenDevice | None = None
        self.dictionary: Dictionary | None = None
        self._wired = wired
        self._top = Section(wired.settings, f"boards.{wired.address}", collected)
        for name in ("kind", "bus"):
            self._top.get(name)
        node = self._node("node", None)
        dictionary = self._open(node or 1)
        if dictionary is None or node is None:
            return
        self.dictionary = dictionary
        device = self._read(dictionary, node)
        self._top.finish()
        self._judge(dictionary)
        if not self.problems:
            self.device = device

    def _judge(self, dictionary: Dictionary) -> None:
        """A flaw of the EDS file in what the device depends on is a problem, elsewhere a doubt.

        Consequences of the flaw are not reported.
        """
        prefix = f"{self._top.key(self._file_key)} = {dictionary.file}: "
        flaws = dictionary.flaws(used=True)
        if flaws:
            names = {f"{word} " for word in dictionary.doubtful_names()}
            rest = [line for line in self.problems if not any(n in f"{line} " for n in names)]
            self.problems[:] = [f"{prefix}{flaw}" for flaw in flaws] + rest
        self.doubts += [f"{prefix}{doubt}" for doubt in dictionary.doubts]
        elsewhere = dictionary.flaws(used=False)
        self.doubts += [
            f"{prefix}{flaw}; the device can be used all the same" for flaw in elsewhere[:_MOST]
        ]
        if len(elsewhere) > _MOST:
            self.doubts.append(f"{prefix}{len(elsewhere) - _MOST} more such lines")

    @property
    def _file_key(self) -> str:
        """The key of the rig file that names the file of the device."""
        return "eds" if "eds" in self._top.tree else "profile"

    def _node(self, name: str, default: int | None) -> int | None:
        value = self._top.get(name)
        if value is None and default is not None:
            return default
        if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 127:
            given = ": missing" if value is None else f" = {value!r}"
            self._top.add(name, f"{given}; must be a node number from 1 to 127")
            return None
        return value

    def _open(self, node: int) -> Dictionary | None:
        top = self._top
        eds, profile = top.get("eds"), top.get("profile")
        if (eds is None) is (profile is None):
            what = "missing" if eds is None else "profile is given as well"
            top.add(
                "eds",
                f": {what}; either the EDS file of the device or a profile is needed "
                f"({', '.join(PROFILES)})",
            )
            return None
        if profile is not None and profile not in PROFILES:
            top.add("profile", f" = {profile!r}: unknown profile; known: {', '.join(PROFILES)}")
            return None
        if eds is not None and (not isinstance(eds, str) or not eds):
            top.add("eds", f" = {eds!r}: must be the path of the device's EDS file")
            return None
        try:
            return Dictionary(profile_path(str(profile)) if eds is None else Path(eds), node)
        except EdsError as error:
            top.add("eds" if eds is not None else "profile", f" = {error}")
            return None

    def _choice(self, name: str, allowed: tuple[str, str]) -> str:
        """One of two words; the first one is the default."""
        value = self._top.get(name)
        if value is not None and value not in allowed:
            self._top.add(name, f" = {value!r}: must be {allowed[0]} or {allowed[1]}")
        return value if value in allowed else allowed[0]

    def _read(self, dictionary: Dictionary, node: int) -> CanopenDevice:
        top = self._top
        host_node = self._node("host_node", _HOST_NODE) or _HOST_NODE
        if host_node == node:
            top.add("host_node", f" = {host_node}: is the device's own node number")
        write = self._choice("pdo_mapping", ("write", "read")) == "write"
        sync = self._choice("transmission", ("event", "sync")) == "sync"
        stops = self._choice("vent", ("setpoint", "stop")) == "stop"
        signals = SignalReader(self._wired, dictionary, top)
        signals.read()
        if not signals.demands and not signals.readings and not self.problems:
            top.problems.add(top.path, ": maps neither a set point nor a measurement")
        if stops and (signals.readings or not signals.demands):
            top.add("vent", " = stop: only a device that measures nothing and has a set point can")
        period = self._milliseconds("period", _PERIOD)
        heartbeat = self._milliseconds("heartbeat_period", _HEARTBEAT)
        timeout = top.number("sdo_timeout", _SDO_TIMEOUT) or 0.1
        guards, watchdog = self._watchdog(dictionary, signals)
        identity = list(self._identity(dictionary))
        extra = list(configuration.read_configuration(top, dictionary))
        plans = {
            direction: self._plans(direction, signals, dictionary, node, write)
            for direction in (RPDO, TPDO)
        }
        steps: list[Step] = [*identity]
        steps += configuration.heartbeat_steps(
            dictionary, heartbeat, guards, host_node, bool(signals.demands), top
        )
        errors = {demand.name: demand.error_value for demand in signals.demands}
        values = configuration.error_values(dictionary, signals, errors, top, watchdog)
        steps += configuration.error_steps(dictionary, values)
        steps += extra
        for direction, chosen in plans.items():
            for plan in chosen:
                milliseconds = round(1e3 * period)
                steps += steps_of(
                    plan, direction, dictionary, write=write, sync=sync, period=milliseconds
                )
                for key, text in refused_timing(
                    plan, direction, dictionary, sync=sync, period=milliseconds
                ):
                    top.add(key, text)
            if write:
                steps += unused_off([plan.number for plan in chosen], direction, dictionary)
        steps += configuration.input_steps(dictionary, signals)
        steps += configuration.vented_steps(signals)
        for key, text in refused_steps(steps, dictionary, self._file_key):
            top.add(key, text)
        off = top.flag("outputs_off_on_error")
        promised = watchdog if values or off else None
        return CanopenDevice(
            node,
            host_node,
            tuple(_rpdo(plan, signals) for plan in plans[RPDO]),
            tuple(_tpdo(plan, signals) for plan in plans[TPDO]),
            tuple(steps),
            period,
            heartbeat,
            None if guards is None else guards / _HEARTBEATS_FOR_A_WATCHDOG,
            sync,
            stops,
            timeout,
            {
                demand.place: float(values[demand.name])
                for demand in signals.demands
                if demand.name in values
            },
            off,
            _promises(promised, guards, signals),
        )

    def _milliseconds(self, name: str, key: Key) -> float:
        """A time that the device keeps in whole milliseconds."""
        value = self._top.number(name, key) or key.default or key.low
        if not math.isclose(1e3 * value, round(1e3 * value), abs_tol=1e-6):
            self._top.add(name, f" = {value:g} s: must be whole milliseconds")
        return value

    def _watchdog(
        self, dictionary: Dictionary, signals: SignalReader
    ) -> tuple[float | None, float | None]:
        """The consumer heartbeat time of the device, and the watchdog that follows from it [s]."""
        top = self._top
        value = top.get("watchdog")
        if value is False:
            return None, None
        if not signals.demands:
            if value is not None:
                top.add("watchdog", ": the device has no set point, so there is nothing to guard")
            return None, None
        if value is True:
            top.add("watchdog", " = True: must be a time in s, or false if the device has none")
            return None, None
        time = self._milliseconds("watchdog", _WATCHDOG)
        if _CONSUMER not in dictionary:
            top.add(
                "watchdog",
                f" = {time:g} s: {dictionary.file} has no {_CONSUMER} (consumer heartbeat time), "
                "so the device cannot notice that the host is gone; watchdog: false accepts that",
            )
        return time, time

    def _identity(self, dictionary: Dictionary) -> Iterator[Check]:
        """Device type and identity; those of a maker's EDS file are checked as well."""
        where = self._top.section("identity")
        own = {"vendor": dictionary.vendor, "product": dictionary.product}
        device_type = dictionary.certain(ObjectName(0x1000)) or 0
        if device_type & 0xFFFF:
            why = f"device profile by {dictionary.file}"
            yield Check(ObjectName(0x1000), device_type & 0xFFFF, why, 0xFFFF)
        for sub, name in enumerate(("vendor", "product", "revision", "serial"), 1):
            value = where.number(name, _UNSIGNED, optional=True)
            expected = own.get(name, 0) if value is None else int(value)
            if value is not None or expected:
                why = f"{name} of the identity"
                yield Check(ObjectName(0x1018, sub), expected, why)
        where.finish()

    def _plans(
        self,
        direction: PdoDirection,
        signals: SignalReader,
        dictionary: Dictionary,
        node: int,
        write: bool,
    ) -> list[PdoPlan]:
        used = signals.demands if direction is RPDO else signals.readings
        wanted = {one.name: signals.types[one.name] for one in used}
        if not wanted:
            return []
        if write:
            return written(wanted, direction, dictionary, node, self._top)
        return mapped_in_file(wanted, direction, dictionary, self._top)


def _rpdo(plan: PdoPlan, signals: SignalReader) -> Rpdo:
    by_name = {demand.name: demand for demand in signals.demands}
    outputs = []
    for field in plan.fields:
        demand = by_name[field.name]
        gain, bias = demand.linear
        outputs.append(
            CanopenOutput(demand.place, field, gain, bias, demand.low, demand.high, demand.vented)
        )
    return Rpdo(plan.number, plan.frame_id, plan.length, tuple(outputs))


def _tpdo(plan: PdoPlan, signals: SignalReader) -> Tpdo:
    by_name = {reading.name: reading for reading in signals.readings}
    inputs = []
    for field in plan.fields:
        one = by_name[field.name]
        gain, bias = one.linear
        inputs.append(
            CanopenInput(
                one.what, one.channel, field, gain, bias, one.low, one.high, one.invalid, one.wraps
            )
        )
    return Tpdo(plan.number, plan.frame_id, plan.length, tuple(inputs))


def _promises(watchdog: float | None, guards: float | None, signals: SignalReader) -> Promises:
    return Promises(
        watchdog=watchdog,
        latches=False,
        keeps_host_fault=False,
        needs_arming=False,
        tells_state=True,
        tells_faults=True,
        # a device that misses the host's heartbeat leaves the state operational, and reports it
        echoes_commands=guards is not None,
        counts_samples=not signals.readings,
        has_heartbeat=True,
        has_checksum=False,
        measures_supply=any(one.what == "supply" for one in signals.readings),
    )


def read_device(wired: WiredBoard) -> tuple[CanopenDevice, Dictionary]:
    """The tables of a device, and its objects.

    Raises
    ------
    RigError
        If its section cannot be used, with one line for each problem.
    """
    reader = CanopenDeviceReader(wired)
    if reader.device is None or reader.dictionary is None:
        raise RigError("\n".join(reader.problems))
    return reader.device, reader.dictionary
