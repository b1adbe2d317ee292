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


def generate_launch_description() -> LaunchDescription:
    """The simulated rig in place of the robot."""
    share = FindPackageShare("pam_bringup")
    names = (
        "rig_file",
        "namespace",
        "one_process",
        "bus_interface",
        "bus_channel",
        "bus_port",
        "on_driver_exit",
        "params_file",
        "respawn",
        "realtime_priority",
        "urdf",
        "view",
    )
    arguments = {name: LaunchConfiguration(name) for name in names}
    bus = {
        "bus.interface": ParameterValue(arguments["bus_interface"], value_type=str),
        "bus.channel": ParameterValue(arguments["bus_channel"], value_type=str),
        "bus.port": ParameterValue(arguments["bus_port"], value_type=int),
    }
    # boards are not delayed by other work of the computer; the thread of the simulated ones is
    priority = ParameterValue(arguments["realtime_priority"], value_type=int)
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "rig_file",
                default_value=PathJoinSubstitution([share, "config", "elbow.yaml"]),
                description="rig file of the robot",
            ),
            DeclareLaunchArgument(
                "namespace",
                default_value="",
                description="namespace of all nodes and topics; one for each robot on a network",
            ),
            DeclareLaunchArgument(
                "one_process",
                default_value="true",
                choices=["true", "false"],
                description="driver, controller and model share one process and one cycle",
            ),
            DeclareLaunchArgument(
                "bus_interface",
                default_value="udp_multicast",
                description="python-can's name of the interface",
            ),
            DeclareLaunchArgument(
                "bus_channel",
                default_value="239.74.163.2",
                description="multicast group or network interface; one for each robot",
            ),
            DeclareLaunchArgument(
                "bus_port",
                default_value="43113",
                description="UDP port, used by bus_interface:=udp_multicast only",
            ),
            DeclareLaunchArgument(
                "on_driver_exit",
                default_value="shutdown",
                choices=["shutdown", "restart"],
                description="when the driver ends: end all nodes, or restart it without autostart",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=arguments["rig_file"],
                description="parameters of the nodes besides the rig file, such as controller.yaml",
            ),
            DeclareLaunchArgument(
                "respawn",
                default_value="false",
                choices=["true", "false"],
                description="start model and controller again when they end",
            ),
            DeclareLaunchArgument(
                "realtime_priority",
                default_value="20",
                description="real-time priority of all loops, where the system permits it; 0: none",
            ),
            DeclareLaunchArgument(
                "urdf",
                default_value="",
                description="URDF for robot_state_publisher; empty: made of the rig file",
            ),
            DeclareLaunchArgument(
                "view",
                default_value="false",
                choices=["true", "false"],
                description="show the robot in a browser (docs/watching.md; needs rerun-sdk)",
            ),
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
