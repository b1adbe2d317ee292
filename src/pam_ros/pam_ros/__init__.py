"""Code that the ROS nodes of the suite share: parameters, periodic loop, diagnostics, spinning.

This package depends on ROS but not on any robot. Its public names:

- `NodeParameters`, `Parameter`: a table of parameters, declared and checked on any node.
- `PeriodicLoop`: a thread that calls a function at absolute deadlines.
- `leave_out_shared_memory`: keeps the middleware from stopping loops; call it before rclpy.init.
- `spin_node`: the main function of a node.

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pam_ros.parameter_row import Parameter
    from pam_ros.parameters import NodeParameters
    from pam_ros.periodic import PeriodicLoop
    from pam_ros.spin import spin_node
    from pam_ros.transport import leave_out_shared_memory

__all__ = [
    "NodeParameters",
    "Parameter",
    "PeriodicLoop",
    "leave_out_shared_memory",
    "spin_node",
]


def __getattr__(name: str) -> Any:
    """Import a public name."""
    match name:
        case "__version__":
            from pam_ros.version import installed_version

            return installed_version(__name__)
        case "NodeParameters":
            from pam_ros import parameters

            return getattr(parameters, name)
        case "Parameter":
            from pam_ros import parameter_row

            return getattr(parameter_row, name)
        case "PeriodicLoop":
            from pam_ros import periodic

            return getattr(periodic, name)
        case "spin_node":
            from pam_ros import spin

            return getattr(spin, name)
        case "leave_out_shared_memory":
            from pam_ros import transport

            return getattr(transport, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All names, including those that have not been imported yet."""
    return sorted({*globals(), *__all__})
