"""The rig file, one description of a robot: reading, checking and writing; rigs as data."""

from pam_model.rig.described_keys import described_key
from pam_model.rig.file import load_rig, rig_from_parameters, rig_of_node, save_rig
from pam_model.rig.people import People
from pam_model.rig.types import Gas, Joint, Muscle, Plausibility, Rig, Valve
from pam_model.rig.wiring import Bus, Encoder, PressureSensor

__all__ = [
    "Bus",
    "Encoder",
    "Gas",
    "Joint",
    "Muscle",
    "People",
    "Plausibility",
    "PressureSensor",
    "Rig",
    "Valve",
    "described_key",
    "load_rig",
    "rig_from_parameters",
    "rig_of_node",
    "save_rig",
]
