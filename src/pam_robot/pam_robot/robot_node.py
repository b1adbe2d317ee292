"""Runs driver, controller and model of one robot as nodes of one process, with one cycle.

In the graph they are the three nodes that they are apart: names, lifecycle, parameters, services,
topics and diagnostics. See docs/one_process.md.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import rclpy
from rclpy.experimental import EventsExecutor

from pam_control.controller_inputs import NodeSide
from pam_driver.snapshot import Snapshot
from pam_model.errors import PamError
from pam_robot.direct_link import COMMAND_DELAY, DirectLink
from pam_robot.robot_cycle import RobotCycle, Work
from pam_robot.robot_help import HELP
from pam_ros.end_signals import EndSignals
from pam_ros.errors import ParameterError
from pam_ros.node_arguments import arguments_by_node
from pam_ros.node_end import end_node
from pam_ros.node_help import MISTAKE, tell_mistake
from pam_ros.start import start_ros
from pam_ros.steady_timers import SteadyTimers, turns
from pam_ros.unforeseen import BROKEN, described

NODES: Final = ("pam_driver", "pam_controller", "pam_model")
SWITCH_INTERVAL: Final = 5e-5
"""After which another thread lets the cycle run [s]. The cycle gives the interpreter away at each
call of the system, some ten times, and waits so long for it while a trajectory is planned: with
0.5 ms, plans of 50,000 points made it skip three times as many cycles."""

BRIEFLY: Final = 0.15  # s, in which the controller's part of a cycle ends


class RobotNodes:
    """The three nodes of one robot, joined by one cycle; the driver's `Partner`.

    Parameters
    ----------
    make_driver, make_controller, make_model : callable
        The classes of the nodes: `DriverNode`, `ControllerNode`, `ModelNode`.
    arguments : mapping
        The arguments of each node alone, by its usual name.

    Raises
    ------
    PamError, ParameterError
        As the nodes, and if their parameters do not fit together.

    Attributes
    ----------
    driver, controller, model : rclpy.node.Node
        The nodes.
    cycle : RobotCycle
        Runs them.
    source : str
        Names the controller in its messages on `valve_commands`.
    """

    def __init__(
        self,
        make_driver: Callable[..., Any],
        make_controller: Callable[..., Any],
        make_model: Callable[..., Any],
        arguments: Mapping[str, Sequence[str]],
    ) -> None:
        self.source = ""
        self.cycle = RobotCycle()
        self.control = self.cycle.control
        self._state: Any = None  # the driver's last message about it
        self._link: DirectLink | None = None
        self._made: list[Any] = []
        try:
            self.driver = self._keep(
                make_driver(self.cycle.driver_loop, self, arguments=arguments["pam_driver"])
            )
            self.controller = self._keep(
                make_controller(
                    self._make_link,
                    self.cycle.controller_loop,
                    arguments=arguments["pam_controller"],
                    command_delay=COMMAND_DELAY,
                )
            )
            self.model = self._keep(make_model(composed=True, arguments=arguments["pam_model"]))
            self._compose()
        except BaseException:
            self.end()
            raise

    def _keep(self, node: Any) -> Any:
        self._made.append(node)
        return node

    def _make_link(self, side: NodeSide) -> DirectLink:
        vent = partial(self.driver.vent, "the controller asks for it")
        self._link = DirectLink(self.driver.take_commands, vent, side)
        self.source = self._link.source
        return self._link

    def _compose(self) -> None:
        driver, controller, link = self.driver, self.controller, self._link
        assert link is not None
        self._refuse_one_name()
        for node in (controller, self.model):
            if names_of(node.rig) != names_of(driver.rig):
                raise ParameterError(
                    f"{driver.get_name()} and {node.get_name()} have rig files with different "
                    "joints or muscles; one process runs one robot"
                )
        link.hear_state(self._state)
        self.cycle.compose(
            Work(link.measure, controller.control, self._publish, self._estimate),
            rates=(driver.rate, controller.rate, self.model.publish_rate),
            priority=max(driver.priority, controller.priority),
            break_down=driver.break_down,
        )

    def _refuse_one_name(self) -> None:
        names = [node.get_name() for node in self._made]
        if len(set(names)) < len(names):
            raise ParameterError(
                f"__node:={names[0]} names several nodes of this process; name each by itself, as "
                f"in pam_driver:__node:={names[0]}"
            )

    def hear_state(self, message: Any) -> None:
        """Hand a message of the driver about its state to the controller."""
        self._state = message
        if self._link is not None:
            self._link.hear_state(message)

    def _publish(self) -> None:
        assert self._link is not None
        self._link.publish()
        self.controller.publish()

    def _estimate(self, snapshot: Snapshot | None) -> None:
        if snapshot is not None:
            self.model.take(
                (snapshot.pressure_stamp, snapshot.joint_stamp),
                snapshot.pressures,
                snapshot.positions,
                snapshot.velocities,
            )
        self.model.publish()

    @property
    def nodes(self) -> list[Any]:
        """All three."""
        return list(self._made)

    def close(self) -> bool:
        """Lower the joints and vent, without the controller; then end the cycle.

        Returns whether all of it went well: nothing on the way must keep the valves open.
        """
        # a cycle that does not return is the driver's business, which vents at once then
        with contextlib.suppress(TimeoutError):
            self.controller.loop.stop(timeout=BRIEFLY)
        self.driver.close()
        return self._attempt("the cycle", self.cycle.loop.stop)

    def end(self, executor: Any = None) -> bool:
        """End the executor and the nodes; returns whether all of it went well."""
        if executor is not None:  # before the nodes: its threads may call what is gone
            executor.shutdown()
        ended = [self._attempt("the end", partial(end_node, node)) for node in self._made]
        return all(ended)  # not before each of them had its turn

    def _attempt(self, what: str, act: Callable[[], object]) -> bool:
        try:
            act()
        except Exception as error:
            self.driver.get_logger().error(f"{what}: {described(error)}")
            return False
        return True


def names_of(rig: Any) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of joints and muscles of a rig, in its order."""
    return rig.joint_names, rig.muscle_names


def main(
    arguments: Sequence[str] | None,
    make_driver: Callable[..., Any],
    make_controller: Callable[..., Any],
    make_model: Callable[..., Any],
) -> int:
    """Run until SIGINT or SIGTERM; returns the exit code.

    Parameters
    ----------
    arguments : sequence of str or None
        Command line, with --ros-args; None for that of the process.
    make_driver, make_controller, make_model : callable
        As for `RobotNodes`.
    """
    ended = HELP.answer(arguments)
    if ended is not None:
        return ended
    logging.getLogger("can").setLevel(logging.ERROR)
    sys.setswitchinterval(SWITCH_INTERVAL)
    code = 0
    with EndSignals() as signals:
        robot: RobotNodes | None = None
        executor: EventsExecutor | None = None
        try:
            words = sys.argv[1:] if arguments is None else arguments
            common, by_node = arguments_by_node(words, NODES)
            start_ros(common)
            with signals.interruptible():
                robot = RobotNodes(make_driver, make_controller, make_model, by_node)
            driver = robot.driver
            driver.hurry = lambda: signals.urgent
            gc.collect()
            gc.freeze()
            robot.cycle.loop.start()
            if not driver.autostart():
                tell_mistake(driver.failure)
                return MISTAKE
            executor = EventsExecutor()
            for node in robot.nodes:
                executor.add_node(node)
            robot.cycle.loop.share_priority()
            timers = SteadyTimers(driver.steady_timers, robot.controller.steady_timers)
            driver.runs = True
            for _ in turns(executor, timers, lambda: not signals.asked and rclpy.ok()):
                robot.cycle.loop.check()
        except KeyboardInterrupt:  # asked twice to end before anything moved
            pass
        except Exception as error:
            if robot is None or not robot.driver.runs:
                if not isinstance(error, (PamError, ParameterError)):
                    raise
                tell_mistake(error)
                return MISTAKE
            code = BROKEN
            robot.driver.fail(error)
        finally:
            if robot is not None and not all([robot.close(), robot.end(executor)]):
                code = BROKEN
            rclpy.try_shutdown()
    return code
