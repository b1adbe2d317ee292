"""A mapped device that promises nothing: multiplexed set points and pressures, CAN FD, volts.

It has no enable, counter, checksum, state, watchdog or latch; its frames are little-endian with 11
bit identifiers, set points in volts, pressures in mbar and an angle in tenths of a degree.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from pam_model.rig import PressureSensor, Rig, load_rig
from support.rigs import CONFIG

DBC: Final = """VERSION ""

NS_ :
	CM_

BS_:

BU_: Host Io

BO_ 528 AoWrite: 8 Host
 SG_ AoSlot M : 0|8@1+ (1,0) [0|1] "" Io
 SG_ AoLeft m0 : 8|16@1+ (0.0005,0) [0|10] "V" Io
 SG_ AoRight m1 : 16|16@1+ (0.0005,0) [0|10] "V" Io
 SG_ AoRange m1 : 40|4@1+ (1,0) [0|3] "" Io

BO_ 784 AiRead: 8 Io
 SG_ AiSlot M : 0|8@1+ (1,0) [0|1] "" Host
 SG_ PLeft m0 : 8|16@1- (0.5,0) [-1000|16000] "mbar" Host
 SG_ PRight m1 : 8|16@1- (0.5,0) [-1000|16000] "mbar" Host

BO_ 800 Angle: 4 Io
 SG_ AngleRaw : 12|16@1- (0.1,0) [-1800|1800] "deg" Host

BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","StandardCAN_FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 528 3;
BA_ "VFrameFormat" BO_ 784 3;
"""


def section(dbc: Path, offset: int) -> dict[str, object]:
    """The section of one such device."""
    volts = {"V": [0.0, 10.0], "bar": [0.0, 8.0]}
    return {
        "kind": "mapped",
        "dbc": str(dbc),
        "identifier_offset": offset,
        "setpoints": {
            "left": {"signal": "AoWrite.AoLeft", "scale": volts, "reference": "gauge"},
            "right": {"signal": "AoWrite.AoRight", "scale": volts, "reference": "gauge"},
        },
        "commands": {"AoWrite": {"fixed": {"AoRange": 2}}},
        "pressures": {
            "left": {"signal": "AiRead.PLeft", "unit": "mbar", "reference": "gauge"},
            "right": {"signal": "AiRead.PRight", "unit": "mbar", "reference": "gauge"},
        },
        "angles": {"shaft": {"signal": "Angle.AngleRaw"}},
    }


def rig_with_sensors_apart(folder: Path) -> Rig:
    """Valves on one device and sensors on another: a mapped one, and a valve board."""
    rig = weak_rig(folder)
    io = rig.boards["io_0"]
    valves = {key: io[key] for key in ("kind", "dbc", "identifier_offset", "setpoints", "commands")}
    sensors = {key: io[key] for key in io if key not in {"setpoints", "commands"}}
    boards = {
        "valves": valves,
        "valve_board": {"kind": "pam_board", "number": 0},
        "sensors_0": sensors,
        "sensors_1": {**sensors, "identifier_offset": 1},
    }
    channels = {"valves": ("left", "right"), "valve_board": (0, 1)}
    for place, (joint, board) in enumerate(zip(rig.joints, channels, strict=True)):
        encoder = replace(joint.encoder, board=f"sensors_{place}")
        rig = rig.with_joint(replace(joint, encoder=encoder))
        sides = zip(joint.muscles, channels[board], ("left", "right"), strict=True)
        for name, channel, side in sides:
            muscle = replace(rig.muscle(name), board=board, channel=channel)
            sensor = PressureSensor(f"sensors_{place}", side)
            rig = rig.with_muscle(replace(muscle, pressure_sensor=sensor))
    return replace(rig, boards=boards)


def weak_rig(folder: Path) -> Rig:
    """Two joints, each on such a device."""
    dbc = folder / "weak.dbc"
    dbc.write_text(DBC)
    arm = load_rig(CONFIG / "two_joints.yaml")
    valve = load_rig(CONFIG / "elbow_vendor_dbc.yaml").muscles[0].valve
    sections = {}
    for place, joint in enumerate(arm.joints):
        board = f"io_{place}"
        sections[board] = section(dbc, place)
        encoder = replace(joint.encoder, board=board, channel="shaft")
        arm = arm.with_joint(replace(joint, encoder=encoder))
        for name, side in zip(joint.muscles, ("left", "right"), strict=True):
            muscle = replace(arm.muscle(name), valve=valve, board=board, channel=side)
            arm = arm.with_muscle(muscle)
    return replace(arm, boards=sections)
