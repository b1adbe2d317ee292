"""What each key of a rig means: text, unit and bounds, found by its dotted name.

The nodes show this as the description of their read-only parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pam_model.effects import EFFECTS
from pam_model.muscles.force_model import registered_models
from pam_model.rig.keys import Key
from pam_model.rig.types import NUMBERS, POSITION_LIMITS, Rig

_BOARD: Final = "which board: a number from 0 on, or a name"
_CHANNEL: Final = "which channel of the board: a number from 0 on, or a name"
_TEXTS: Final[Mapping[str, Mapping[str, str]]] = {
    "": {
        "joints": "names of the joints, in the order that every array on every topic uses",
        "bench_muscles": "names of the muscles without a joint, on a test bench",
    },
    "buses": {
        "interface": "python-can's name of the interface",
        "channel": "network interface, multicast group or device",
        "options": "further options of the interface: name=value, name=value",
        "fd": "whether CAN FD frames are used",
        "canopen": "whether CANopen devices share the bus",
    },
    "boards": {
        "kind": "kind of the board",
        "number": "number of a pam_board on its bus",
        "bus": "name of its bus under buses",
        "dbc": "DBC file of a mapped device",
        "eds": "EDS file of a CANopen device",
    },
    "joint": {
        "muscles": "its agonist and its antagonist; the agonist's force gives positive torque",
        "encoder.board": _BOARD,
        "encoder.channel": _CHANNEL,
    },
    "muscle": {
        "model": "static force model; `pam model list` shows all",
        "board": _BOARD,
        "channel": _CHANNEL,
        "pressure_sensor.board": _BOARD,
        "pressure_sensor.channel": _CHANNEL,
        "valve.kind": "flow (spool command -1 to 1) or pressure_regulator (command in Pa)",
    },
    "people": {
        "emergency_stop_board": "the board that must report an emergency stop",
        "enabling_switch_board": "the board that must report an enabling switch",
        "emergency_stop_topic": "whether a topic of the driver must permit motion",
        "enabling_switch_topic": "whether a topic of the driver must permit motion",
        "full_speed_topic": "whether a topic of the driver must permit full speed",
    },
}
_NUMBERS: Final[Mapping[str, Mapping[str, Key]]] = {
    **NUMBERS,
    "buses": NUMBERS["bus"],
    "joint": {**NUMBERS["joint"], "position_limits": POSITION_LIMITS},
    "muscle": {
        **NUMBERS["muscle"],
        **{f"valve.{key}": each for key, each in NUMBERS["valve"].items()},
    },
}


def described_key(rig: Rig, name: str) -> Key:
    """What a key of a rig means.

    Parameters
    ----------
    rig : Rig
        The rig that was read.
    name : str
        Dotted name of a key that the rig file has, such as "elbow.effects.payload.mass".

    Returns
    -------
    Key
        With text, unit and bounds; a key that is no number has the bounds 0 and 0. A key that only
        the kind of a board knows has a text that says so.
    """
    section, rest = _place(rig, name.split("."))
    key = ".".join(rest)
    if rest[0] == "effects":
        entry = EFFECTS[rest[1]].parameters[rest[2]]
        return Key(entry.unit, entry.low, entry.high, entry.neutral, text=entry.description)
    if rest[0] == "model_parameters" and section == "muscle":
        model = registered_models()[rig.muscle(name.split(".", maxsplit=1)[0]).model].model
        given = model.parameters[rest[1]]
        return Key(given.unit, given.low, given.high, given.default, text=given.description)
    found = _NUMBERS.get(section, {}).get(key)
    if found is None:
        text = _TEXTS.get(section, {}).get(
            key, "key of this kind of board, see docs/your_valves.md"
        )
        found = Key("-", 0.0, 0.0, text=text)
    return found


def _place(rig: Rig, parts: list[str]) -> tuple[str, list[str]]:
    """The section of `_TEXTS` and `_NUMBERS` that has a key, and the key's parts below it."""
    top, *rest = parts
    if not rest or top == "effects":
        return "", parts
    if top in ("buses", "boards"):
        return top, rest[1:]
    if top in rig.joint_names:
        return "joint", rest
    return ("muscle" if top in rig.muscle_names else top), rest
