"""The services of the controller's node: stop, lower, and write what was learnt.

They answer at once, whatever else the controller does: files are written by a thread of their own.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from std_srvs.srv import Trigger

from pam_control.adapted_rig import AdaptedRig, adapted_rig, learnt_of, save_adapted_rig
from pam_control.command_intake import CommandIntake
from pam_control.controller import Controller
from pam_control.controller_parameters import kept_file
from pam_model.errors import PamError
from pam_ros.parameter_row import Value
from pam_ros.slow_work import SlowWork


class OperatorServices:
    """The services of one node.

    Parameters
    ----------
    node : rclpy.node.Node
        Makes the services.
    controller : Controller
        Carries them out.
    intake : CommandIntake
        Its commands, which a stop supersedes.
    lock : Lock
        Held whenever the controller is used.
    writing : SlowWork
        Writes files.
    values : callable
        Gives the node's parameters by name.
    clock : callable
        The controller's time [s].
    reason : callable
        Why no commands are sent.
    """

    def __init__(
        self,
        node: Any,
        controller: Controller,
        intake: CommandIntake,
        lock: threading.Lock,
        writing: SlowWork,
        *,
        values: Callable[[], Mapping[str, Value]],
        clock: Callable[[], float],
        reason: Callable[[], str],
    ) -> None:
        self._controller, self._intake, self._lock = controller, intake, lock
        self._writing, self._values = writing, values
        self._clock, self._reason = clock, reason
        self._log = node.get_logger()
        node.create_service(Trigger, "~/stop", self.on_stop)
        node.create_service(Trigger, "~/lower", self.on_lower)
        node.create_service(Trigger, "~/save_adapted_rig", self.on_save)

    def on_stop(self, _: Any, response: Any) -> Any:
        """Stop category 2: brake and hold."""
        return self._act(response, self._controller.stop, "braking; the joints are held")

    def on_lower(self, _: Any, response: Any) -> Any:
        """Stop category 1: brake, let the air out slowly, vent by the driver."""
        took = f"lowering, takes about {self._controller.settings.lowering_time:g} s"
        return self._act(response, self._controller.lower, took)

    def _act(self, response: Any, act: Callable[[float], None], done: str) -> Any:
        with self._lock:
            response.success = bool(self._controller.active)
            response.message = done if response.success else f"nothing moves: {self._reason()}"
            if response.success:
                act(self._clock())
                self._intake.supersede()
        self._log.warning(response.message)
        return response

    def on_save(self, _: Any, response: Any) -> Any:
        """Write a copy of the rig file with what was learnt."""
        try:
            response.message, response.success = self._saved(), True
        except PamError as error:
            response.message, response.success = str(error), False
        self._log.info(f"save_adapted_rig: {response.message}")
        return response

    def _saved(self) -> str:
        """What is being written.

        Raises
        ------
        PamError
            If nothing was learnt, or nothing can be written.
        """
        controller = self._controller
        if controller.guard.softened:
            raise PamError(
                "what is learnt with soft gains is not written, and they stay until the next vent: "
                f"{controller.guard.softened}"
            )
        if not any(channel.setup.adapts for channel in controller.channels):
            raise PamError(
                "nothing is learnt: adaptation.enabled is false, or the law is not model_based"
            )
        path = kept_file(self._values(), "adaptation.rig_file")
        if path is None:
            raise PamError("set the parameter adaptation.rig_file to the file to be written")
        if self._writing.full:
            raise PamError("other files are being written")
        with self._lock:
            learnt = [learnt_of(channel) for channel in controller.channels]
        made = adapted_rig(controller.rig, learnt)
        self._writing.submit(lambda: _written(made, path), self._log.info)
        return f"being written: {path}; the log says when"


def _written(made: AdaptedRig, path: Path) -> str:
    try:
        return f"save_adapted_rig: {save_adapted_rig(made, path)}"
    except PamError as error:
        return f"save_adapted_rig: not written: {error}"
