"""Snapshots of a system, and the key by which two of them count as the same state.

The key is made from the objects themselves: every attribute that is not named here belongs to it,
so that a new attribute of the driver or the board cannot be forgotten. Times become ages in steps,
up to the longest time-out. Counters, texts and what never changes are left out.
"""

from __future__ import annotations

import hashlib
import io
import marshal
import math
import pickle
import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping
from enum import Enum
from types import BuiltinFunctionType, FunctionType, MethodType, NoneType
from typing import Any, Final

from pam_check.state_walk.system import LONGEST, ORIGIN, TICK
from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.boards.pam_board.kind import PamBoardKind
from pam_driver.boards.protocol import Identifiers, Promises
from pam_driver.boards.wiring import RigWiring
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import OUTPUTS, SafetyState
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.rig import Muscle, Rig
from pam_ros.valve_command import ValveCommandFormat
from pam_sim.boards.protocol import BoardSettings, BoardValve

_SHARED: Final = (
    Rig, Muscle, RigWiring, PamBoardKind, BoardCodec, BoardSettings, BoardValve, DriverSettings,
    Identifiers, Promises, SensorCorrection, ValveCommandFormat, FunctionType,
    type(threading.Lock()),
)  # fmt: skip
"""What no path changes: it is shared by all snapshots and is no part of the key."""

LEFT_OUT: Final = frozenset({
    # counters, whose values decide nothing but order within one step
    "_counter", "_counter_sent", "_samples", "counter", "command_counter", "frames_lost",
    "frames_repeated", "frames_reordered", "_reordered_in_a_row", "restarts", "rejected_frames",
    "accepted", "rejected", "frame_errors", "last_frame_error", "uptime", "_grid", "_turns",
    "drops", "availability", "sensors",  # no measurement is missing on any path
    # the round trip to the board, whose limit no path reaches, since frames take no time
    "_echo_delay", "_echo",
    # the age of the board stands in the system as well
    "_started",
    # texts for people
    "last_rejection", "reason", "complaint", "text",
    # found anew in each cycle before it is used
    "conditions", "_told", "_over_pressure", "_sensor_lost",
    # times of the wall clock, which only go into messages
    "stamp",
    # the law of lowering, which only lets air out, and what it reads
    "_lowering", "_readings",
    # made once from the rig
    "listeners", "identifiers", "promises", "_routes", "_kinds", "_bus_of", "_own_ids", "valves",
    "_vent", "_clear", "_latch", "_limits", "ports", "_rig", "_judge", "_settings", "_codec",
})  # fmt: skip
"""Attributes that are no part of the key."""
_IDLE: Final[Mapping[str, Callable[[SafetyState], bool]]] = {
    "_ready_since": lambda state: state is not SafetyState.READY,
    "_lowering_since": lambda state: not OUTPUTS[state].lower,
}
"""Times of the driver, and in which of its states they mean nothing."""
_AT_MOST: Final = {"powered_at": 2, "_latch_sent_at": 2}
"""Ages of which only matters whether they are so many steps, or more."""
_REASONS: Final = frozenset({"latched", "faults"})
"""Texts and reasons of which only matters whether there are any."""


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, shared: dict[int, object]) -> None:
        super().__init__(file, protocol=5)
        self._shared = shared

    def persistent_id(self, obj: object) -> int | None:
        if type(obj) in _SHARED:
            self._shared[id(obj)] = obj
            return id(obj)
        return None


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, shared: dict[int, object]) -> None:
        super().__init__(file)
        self._shared = shared

    def persistent_load(self, pid: int) -> object:
        return self._shared[pid]


class Snapshots:
    """Stores objects as bytes and makes them again; what they share is kept once."""

    def __init__(self) -> None:
        self._shared: dict[int, object] = {}

    def store(self, thing: object) -> bytes:
        """The object as bytes."""
        file = io.BytesIO()
        _Pickler(file, self._shared).dump(thing)
        return file.getvalue()

    def restore(self, stored: bytes) -> Any:
        """A new object that equals the stored one."""
        return _Unpickler(io.BytesIO(stored), self._shared).load()


def fingerprint(thing: object, now: float) -> bytes:
    """The key of everything that can be reached from an object, as a digest of 128 bits.

    Parameters
    ----------
    thing : object
        The object.
    now : float
        Time [s]; other times become ages.
    """
    # version 0 writes equal values as equal bytes, whether or not they are the same object
    return hashlib.blake2b(marshal.dumps(_Reader(now).read(thing), 0), digest_size=16).digest()


class _Reader:
    def __init__(self, now: float) -> None:
        self._now = now
        self._seen: set[int] = set()
        self._longest = LONGEST

    def read(self, thing: Any) -> Any:
        """The key of one object."""
        kind = type(thing)
        form = _FORMS.get(kind)
        if form is None:
            form = _FORMS[kind] = _form_of(kind)
        if form is _Form.PLAIN or form is _Form.ENUM:
            return thing if form is _Form.PLAIN else thing.value
        if form is _Form.NUMBER:
            return self._number(thing)
        if form is _Form.TUPLE:
            return tuple([self.read(value) for value in thing])
        if form is _Form.NAMED:
            return tuple([self.read(thing[place]) for place in _places(kind)])
        if form is _Form.SHARED or id(thing) in self._seen:
            return kind.__name__
        self._seen.add(id(thing))
        return self._read_once(thing, form)

    def _read_once(self, thing: Any, form: _Form) -> Any:
        """The key of an object that may be reached in several ways; it is read the first time."""
        if form is _Form.SEQUENCE:
            return tuple([self.read(value) for value in thing])
        if form is _Form.MAPPING:
            return tuple([(str(name), self.read(value)) for name, value in thing.items()])
        if form is _Form.OWN_KEY:
            return thing.key()
        return tuple([self._attribute(thing, name) for name in _names(type(thing), thing)])

    def _attribute(self, thing: Any, name: str) -> Any:
        """The key of one attribute."""
        value = getattr(thing, name, None)
        if name in _REASONS:
            return bool(value)
        if name in _IDLE and _IDLE[name](thing.state):
            return None
        if name in _AT_MOST:
            self._longest = _AT_MOST[name]
            try:
                return self.read(value)
            finally:
                self._longest = LONGEST
        return self.read(value)

    def _number(self, value: float) -> Any:
        """A time becomes its age in steps; NaN, which differs from itself, becomes a text."""
        if math.isnan(value):
            return "nan"
        if value == -math.inf:
            return "age", self._longest
        if 0.5 * ORIGIN < value < math.inf:
            steps = math.floor((self._now - value) / TICK)
            return "age", max(-LONGEST, min(self._longest, steps))
        return value


class _Form(Enum):
    """How the key of an object is made."""

    PLAIN = "it is its own key"
    ENUM = "its value"
    NUMBER = "a number or a time"
    TUPLE = "the keys of its entries"
    NAMED = "the keys of those entries that are not left out"
    SHARED = "its name"
    SEQUENCE = "a list or set"
    MAPPING = "a mapping"
    OWN_KEY = "it has a method `key`"
    OBJECT = "the keys of its attributes"


_FORMS: Final[dict[type, _Form]] = {}
_PLACES: Final[dict[type, tuple[int, ...]]] = {}
_NAMES: Final[dict[type, tuple[str, ...]]] = {}


def _form_of(kind: type) -> _Form:
    """How the key of the objects of a class is made."""
    forms: tuple[tuple[Any, _Form], ...] = (
        (float, _Form.NUMBER),
        (Enum, _Form.ENUM),
        ((bool, int, str, bytes, NoneType), _Form.PLAIN),
        ((*_SHARED, MethodType, BuiltinFunctionType, Counter, type), _Form.SHARED),
        ((list, deque, set, frozenset), _Form.SEQUENCE),
        (Mapping, _Form.MAPPING),
    )
    for kinds, form in forms:
        if issubclass(kind, kinds):
            return form
    if issubclass(kind, tuple):
        return _Form.NAMED if hasattr(kind, "_fields") else _Form.TUPLE
    return _Form.OWN_KEY if hasattr(kind, "key") else _Form.OBJECT


def _places(kind: Any) -> tuple[int, ...]:
    """The places of a named tuple that belong to the key."""
    if kind not in _PLACES:
        fields = enumerate(kind._fields)
        _PLACES[kind] = tuple(place for place, name in fields if name not in LEFT_OUT)
    return _PLACES[kind]


def _names(kind: type, thing: Any) -> tuple[str, ...]:
    """The attributes of a class that belong to the key, in the order of their names."""
    if kind not in _NAMES:
        names = set(getattr(thing, "__dict__", ()))
        for owner in kind.__mro__:
            names |= set(getattr(owner, "__slots__", ()))
        _NAMES[kind] = tuple(sorted(names - LEFT_OUT))
    return _NAMES[kind]
