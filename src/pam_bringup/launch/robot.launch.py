"""Driver, model and controller for a robot on a CAN bus.

`ros2 launch pam_bringup robot.launch.py rig_file:=/path/to/rig.yaml bus_channel:=can0`
"""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Three nodes that read the same rig file."""
    rig_file = LaunchConfiguration("rig_file")
    bus = {
        "bus.interface": ParameterValue(LaunchConfiguration("bus_interface"), value_type=str),
        "bus.channel": ParameterValue(LaunchConfiguration("bus_channel"), value_type=str),
        "autostart": ParameterValue(LaunchConfiguration("autostart"), value_type=bool),
        "startup_timeout": ParameterValue(LaunchConfiguration("startup_timeout"), value_type=float),
    }
    # cycles keep their time on a busy host, if the user may have that (docs/on_a_robot.md)
    priority = ParameterValue(LaunchConfiguration("realtime_priority"), value_type=int)
    elbow = PathJoinSubstitution([FindPackageShare("pam_bringup"), "config", "elbow.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("rig_file", default_value=elbow, description="the robot"),
            DeclareLaunchArgument(
                "bus_interface", default_value="socketcan", description="python-can's name"
            ),
            DeclareLaunchArgument(
                "bus_channel", default_value="can0", description="network interface"
            ),
            DeclareLaunchArgument(
                "autostart",
                default_value="true",
                description="the driver configures and activates itself; false: ros2 lifecycle",
            ),
            DeclareLaunchArgument(
                "startup_timeout",
                default_value="10.0",
                description="how long autostart waits for all boards [s]",
            ),
            DeclareLaunchArgument(
                "realtime_priority",
                default_value="20",
                description="of the driver's and controller's loops, where permitted; 0: ordinary",
            ),
            Node(
                package="pam_driver",
                executable="driver_node",
                parameters=[rig_file, bus, {"realtime_priority": priority}],
                output="screen",
            ),
            Node(
                package="pam_model",
                executable="model_node",
                parameters=[rig_file],
                output="screen",
            ),
            Node(
                package="pam_control",
                executable="controller_node",
                parameters=[rig_file, {"loop.realtime_priority": priority}],
                output="screen",
            ),
        ]
    )
