"""Keeps Fast DDS from stopping a loop: the nodes of the suite talk through sockets alone.

When a node appears on the same machine, Fast DDS opens the shared memory of its peer and may wait a
third of a second for a health check, while it holds the lock that every publisher of the process
needs (Fast DDS issue 6535, seen with version 2.14.5). A loop that publishes stands still for that
time, which is longer than the boards' watchdog: a `ros2 topic echo` in another terminal would vent
the robot. Sockets on the same machine have no such wait.
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping
from pathlib import Path

PROFILE = Path(__file__).with_name("loopback_profile.xml")

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_LOCALHOST_ONLY = "ROS_LOCALHOST_ONLY"  # deprecated, but read before the range
_PROFILE_FILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_TRANSPORTS, _SOCKETS = "FASTDDS_BUILTIN_TRANSPORTS", "UDPv4"


def leave_out_shared_memory(environment: MutableMapping[str, str] | None = None) -> bool:
    """Set the environment variables that let Fast DDS use sockets only; call it before rclpy.init.

    A choice of the user is kept: another middleware, a file of Fast DDS profiles, a choice of
    transports, or static peers together with the range LOCALHOST (a profile cannot hold both).

    Parameters
    ----------
    environment : mapping of str to str, optional
        The variables; by default those of this process.

    Returns
    -------
    bool
        Whether shared memory is left out by this call.
    """
    variables = os.environ if environment is None else environment
    if not variables.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp").startswith("rmw_fastrtps"):
        return False
    profiles = [variables[name] for name in _PROFILE_FILES if variables.get(name)]
    if variables.get(_TRANSPORTS, _SOCKETS) != _SOCKETS or any(
        name != str(PROFILE) for name in profiles
    ):
        return False
    if not _localhost(variables):
        if not profiles:
            variables[_TRANSPORTS] = _SOCKETS
        return True
    if variables.get("ROS_STATIC_PEERS"):
        return False
    # with the range LOCALHOST, rmw_fastrtps adds shared memory whatever the profile says
    variables.pop(_LOCALHOST_ONLY, None)
    variables[_RANGE] = "SYSTEM_DEFAULT"
    for name in _PROFILE_FILES:
        variables[name] = str(PROFILE)
    return True


def _localhost(variables: MutableMapping[str, str]) -> bool:
    """Whether these variables ask for this machine alone."""
    return variables.get(_LOCALHOST_ONLY) == "1" or variables.get(_RANGE) == "LOCALHOST"
