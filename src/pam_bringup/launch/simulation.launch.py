"""The simulated rig with driver, model and controller, on a multicast bus or on vcan0.

`ros2 launch pam_bringup simulation.launch.py`; for vcan0 add
`bus_interface:=socketcan bus_channel:=vcan0`. A second robot on the same machine needs a namespace
and a multicast group or port of its own:
`namespace:=second bus_channel:=239.74.163.3`.
"""

from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription
from pam_bringup.launch_arguments import OF_SIMULATION, declarations


def generate_launch_description() -> LaunchDescription:
    """The simulated rig in place of the robot."""
    share = FindPackageShare("pam_bringup")
    arguments = {name: LaunchConfiguration(name) for name in OF_SIMULATION}
    bus = {
        "bus.interface": ParameterValue(arguments["bus_interface"], value_type=str),
        "bus.channel": ParameterValue(arguments["bus_channel"], value_type=str),
        "bus.port": ParameterValue(arguments["bus_port"], value_type=int),
    }
    declared_here = declarations(
        OF_SIMULATION,
        rig_file=PathJoinSubstitution([share, "config", "elbow.yaml"]),
        params_file=arguments["rig_file"],
        bus_interface="udp_multicast",
        bus_channel="239.74.163.2",
    )
    # boards are not delayed by other work of the computer; the thread of the simulated ones is
    priority = ParameterValue(arguments["realtime_priority"], value_type=int)
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, **declared) for name, declared in declared_here),
            Node(
                package="pam_sim",
                executable="pam_rig",
                namespace=arguments["namespace"],
                parameters=[
                    arguments["rig_file"],
                    arguments["params_file"],
                    {**bus, "realtime_priority": priority},
                ],
                output="screen",
            ),
            IncludeLaunchDescription(
                PathJoinSubstitution([share, "launch", "robot.launch.py"]),
                # Nobody is near the simulated rig, so it may move without being asked.
                # It compiles its plant when it runs for the first time.
                launch_arguments=[
                    *arguments.items(),
                    ("activate_on_start", "true"),
                    ("startup_timeout", "120.0"),
                ],
            ),
        ]
    )
