"""Driver, model and controller for a robot on a CAN bus, in one process and one cycle.

`ros2 launch pam_bringup robot.launch.py rig_file:=/path/to/rig.yaml bus_channel:=can0`

The driver begins to measure by itself, with all valves vented. Air moves only after
`ros2 lifecycle set /pam_driver activate`. The argument `activate_on_start:=true` makes this call
unnecessary, for robots that may begin to move without a person.

With `one_process:=false` the three nodes are processes of their own, which exchange topics.

Where robot_state_publisher is installed, it publishes the frames of the joints, with a URDF made of
the rig file (`pam model urdf`) or the one of the argument `urdf`.

The argument `on_driver_exit` decides what happens when the process of the driver ends. By default
all nodes end, since model and controller are of no use without the driver. With
`on_driver_exit:=restart` it is started again, but it does not configure or activate itself: only a
person may let air move again (`ros2 lifecycle set /pam_driver configure`, then `activate`).
"""

import difflib
import sys
from collections.abc import Callable

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
    TimerAction,
)
from launch.conditions import IfCondition, UnlessCondition
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import Command, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import Action, LaunchContext, LaunchDescription
from pam_bringup.launch_arguments import ARGUMENTS, declarations

USERS_MISTAKE = 2  # the driver's exit code for a user's mistake; a restart would fail again
RESTART_DELAY = 2.0  # s, until the boards have vented and the bus is closed


def check_words(context: LaunchContext) -> list[Action]:
    """Refuse a misspelt argument: launch ignores it, and the default would drive the robot.

    Others may be those of a launch file that includes this one; the log names them.

    Raises
    ------
    ValueError
        If a word of the command line resembles an argument of this file, and is none.
    """
    actions: list[Action] = []
    for word in context.argv:
        name, assigned, _ = word.partition(":=")
        if not assigned or name in ARGUMENTS:
            continue
        meant = difflib.get_close_matches(name, ARGUMENTS, n=1, cutoff=0.7)
        if meant:
            raise ValueError(f"no launch argument is called {name}; did you mean {meant[0]}?")
        actions.append(LogInfo(msg=f"{name} is no argument of robot.launch.py"))
    return actions


TEXTS = {"bus.interface": "bus_interface", "bus.channel": "bus_channel"}
NUMBERS = {
    "bus.port": ("bus_port", int),
    "startup_timeout": ("startup_timeout", float),
    "realtime_priority": ("realtime_priority", int),
    "start_up_check": ("start_up_check", bool),
}
"""Parameters of the driver by the launch arguments that set them."""


def start_driver(autostart: ParameterValue | bool, activate: ParameterValue | bool) -> list[Action]:
    """The driver's node, and the action when it ends."""
    given = {name: argument(each, str) for name, each in TEXTS.items()}
    given |= {name: argument(each, kind) for name, (each, kind) in NUMBERS.items()}
    driver = Node(
        package="pam_driver",
        executable="pam_driver_node",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("rig_file"),
            LaunchConfiguration("params_file"),
            given,
            {"autostart": autostart, "activate_on_start": activate},
        ],
        condition=UnlessCondition(LaunchConfiguration("one_process")),
        output="screen",
    )
    return [RegisterEventHandler(follow(driver, start_driver)), driver]


def start_robot(
    autostart: str | LaunchConfiguration, activate: str | LaunchConfiguration
) -> list[Action]:
    """All nodes of the robot in one process, and the action when it ends."""
    # a parameter without the name of its node would be given to all of them
    given = {name: ["'", LaunchConfiguration(each), "'"] for name, each in TEXTS.items()}
    given |= {name: [LaunchConfiguration(each)] for name, (each, _) in NUMBERS.items()}
    given |= {"autostart": [autostart], "activate_on_start": [activate]}
    words = [[f"pam_driver:{name}:=", *value] for name, value in given.items()]
    words += [["pam_controller:loop.realtime_priority:=", LaunchConfiguration("realtime_priority")]]
    robot = Node(
        package="pam_robot",
        executable="pam_robot_node",
        namespace=LaunchConfiguration("namespace"),
        parameters=[LaunchConfiguration("rig_file"), LaunchConfiguration("params_file")],
        ros_arguments=[part for word in words for part in ("-p", word)],
        condition=IfCondition(LaunchConfiguration("one_process")),
        output="screen",
    )
    return [RegisterEventHandler(follow(robot, start_robot)), robot]


def argument(name: str, kind: type) -> ParameterValue:
    """The value of a launch argument as a parameter of this type."""
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def follow(process: Node, start: Callable[..., list[Action]]) -> OnProcessExit:
    """When the process of the driver ends: end the launch or start it again (`on_driver_exit`)."""

    def after(event: ProcessExited, context: LaunchContext) -> list[Action]:
        if context.is_shutdown:
            return []
        reason = f"the driver has ended with code {event.returncode}"
        choice = LaunchConfiguration("on_driver_exit").perform(context)
        if choice == "restart" and event.returncode != USERS_MISTAKE:
            text = f"{reason}; it is started again, and must be configured and activated by hand"
            no = "false" if start is start_robot else False
            again = TimerAction(period=RESTART_DELAY, actions=start(no, no))
            return [LogInfo(msg=text), again]
        return [EmitEvent(event=Shutdown(reason=reason))]

    return OnProcessExit(target_action=process, on_exit=after)


def publish_frames(context: LaunchContext) -> list[Action]:
    """robot_state_publisher, if it is installed."""
    try:
        get_package_prefix("robot_state_publisher")
    except PackageNotFoundError:
        return [LogInfo(msg="robot_state_publisher is not installed: no frames on /tf")]
    urdf = LaunchConfiguration("urdf").perform(context)
    # shell words of the command: a path may contain spaces
    made = [sys.executable, " -m pam_model urdf --rig '", LaunchConfiguration("rig_file"), "'"]
    description = Command(["cat '", urdf, "'"] if urdf else made)
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            namespace=LaunchConfiguration("namespace"),
            parameters=[{"robot_description": ParameterValue(description, value_type=str)}],
        )
    ]


def show_in_browser(rig_file: LaunchConfiguration, namespace: LaunchConfiguration) -> Action:
    """The viewer of this package, with `view:=true`; the robot runs on without it."""
    words = [sys.executable, "-m", "pam_bringup", "--rig", rig_file]
    return ExecuteProcess(
        # one word: an empty namespace is no word of its own
        cmd=[*words, ["--namespace=", namespace]],
        condition=IfCondition(LaunchConfiguration("view")),
        output="screen",
    )


def generate_launch_description() -> LaunchDescription:
    """The nodes of one robot, which read the same rig file."""
    rig_file = LaunchConfiguration("rig_file")
    params_file = LaunchConfiguration("params_file")
    respawn = LaunchConfiguration("respawn")
    namespace = LaunchConfiguration("namespace")
    apart = UnlessCondition(LaunchConfiguration("one_process"))
    # keeps cycles punctual on a busy host, if the user has the permission (docs/on_a_robot.md)
    priority = ParameterValue(LaunchConfiguration("realtime_priority"), value_type=int)
    elbow = PathJoinSubstitution([FindPackageShare("pam_bringup"), "config", "elbow.yaml"])
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, **declared)
                for name, declared in declarations(rig_file=elbow, params_file=rig_file)
            ),
            OpaqueFunction(function=check_words),
            *start_robot(
                LaunchConfiguration("autostart"), LaunchConfiguration("activate_on_start")
            ),
            *start_driver(argument("autostart", bool), argument("activate_on_start", bool)),
            Node(
                package="pam_model",
                executable="pam_model_node",
                namespace=namespace,
                parameters=[rig_file, params_file],
                condition=apart,
                respawn=respawn,
                respawn_delay=RESTART_DELAY,
                output="screen",
            ),
            Node(
                package="pam_control",
                executable="pam_controller_node",
                namespace=namespace,
                parameters=[rig_file, params_file, {"loop.realtime_priority": priority}],
                condition=apart,
                respawn=respawn,
                respawn_delay=RESTART_DELAY,
                output="screen",
            ),
            OpaqueFunction(function=publish_frames),
            show_in_browser(rig_file, namespace),
        ]
    )
