"""Code that the ROS nodes of the suite share: parameters, periodic loop, diagnostics, spinning.

This package depends on ROS but not on any robot. Its public names:

- `NodeParameters`, `Parameter`: a table of parameters, declared and checked on any node.
- `PeriodicLoop`: a thread that calls a function at absolute deadlines.
- `leave_out_shared_memory`: keeps the middleware from stopping loops; call it before rclpy.init.
- `spin_node`: the main function of a node.

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pam_ros.lazy_names import lazy_names

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

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "parameter_row": "Parameter",
        "parameters": "NodeParameters",
        "periodic": "PeriodicLoop",
        "spin": "spin_node",
        "transport": "leave_out_shared_memory",
    },
)
