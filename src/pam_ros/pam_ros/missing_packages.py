"""Packages without which a part of the suite does not work, and what to install for it.

Ubuntu and ROS have no package of most of them, so that a package.xml cannot require them. Whoever
imports one that is missing gets a ModuleNotFoundError; command lines and nodes end with its text
from here.
"""

from __future__ import annotations

from typing import Final

NEEDED_FOR: Final = {
    "backports": ("unpacking recordings and tables in .zst", "pip install backports-zstd"),
    "bokeh": ("figures that can be enlarged", "pip install bokeh"),
    "canopen": ("CANopen devices", "pip install canopen"),
    "cantools": ("DBC files, by which valve boards are described", "pip install cantools"),
    "control": ("designing gains for a rig for the first time", "pip install control"),
    "gymnasium": ("environments for training policies", "pip install gymnasium"),
    "pyarrow": ("Parquet files", "pip install pyarrow"),
    "rclpy": ("ROS nodes", "source ROS 2 Jazzy, or pip install 'pam_ros[ros]'"),
    "rosbags": ("reading and writing ROS bags", "pip install rosbags"),
}
"""By the name that Python imports: what needs it, and how it is installed."""
_OF_ROS: Final = ("_msgs", "_srvs", "_interfaces")
_ROS: Final = frozenset({"ament_index_python", "rosidl_parser"})


def what_to_install(error: ImportError) -> str | None:
    """One line for a user about a package that is missing; None where no feature explains it.

    Parameters
    ----------
    error : ImportError
        What an import raised.
    """
    name = (error.name or "").partition(".")[0]
    if name in _ROS or name.endswith(_OF_ROS):
        name = "rclpy"
    if not isinstance(error, ModuleNotFoundError) or name not in NEEDED_FOR:
        return None
    purpose, remedy = NEEDED_FOR[name]
    return f"the Python package {name} is not installed; it is needed for {purpose}: {remedy}"
