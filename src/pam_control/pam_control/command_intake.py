"""Takes references and stiffness commands for a running controller, without ROS.

The control thread and the callbacks share a lock. A trajectory is read, checked, scaled and splined
outside of it, because this may take longer than a control cycle; the lock is held only while the
present reference is read and while the finished splines are handed over.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from typing import Any

from pam_control.controller import Controller
from pam_control.references.spline import JointSpline
from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_control.trajectory_message import TrajectoryMessage, read_trajectory
from pam_model.errors import PamError
from pam_ros.repeated_news import RepeatedNews, place_of


class CommandIntake:
    """References and stiffness commands of users.

    Parameters
    ----------
    controller : Controller
        Takes them.
    lock : Lock
        Held whenever the controller is used.
    clock : callable
        The controller's time [s].
    reason_against : callable
        Why no references are taken at present; empty if they are. Called with the lock held.
    log : callable
        Takes a text for the user.

    Attributes
    ----------
    rejected, slowed : int
        Number of messages that were rejected, and of trajectories that were slowed down.
    last_rejection, last_note : (str, float)
        Text and time [s] of the last one.
    """

    def __init__(
        self,
        controller: Controller,
        lock: threading.Lock,
        clock: Callable[[], float],
        reason_against: Callable[[], str],
        log: Callable[[str], Any],
    ) -> None:
        self._controller = controller
        self._lock = lock
        self._clock = clock
        self._reason_against = reason_against
        self._log = log
        self._orders = 0
        self._last_order: dict[str, int] = {}  # by joint, which anything older must not undo
        self._news = RepeatedNews()
        self.rejected = self.slowed = 0
        self.last_rejection = self.last_note = ("", -math.inf)

    @property
    def ticket(self) -> int:
        """The present moment among the commands: a trajectory that waits keeps its own."""
        return self._orders

    def supersede(self, names: Sequence[str] = ()) -> None:
        """Do not follow what arrived before and is still being planned, for all or some joints.

        The lock must be held.
        """
        self._orders += 1
        for name in names or self._controller.rig.joint_names:
            self._last_order[name] = self._orders

    def trajectory(
        self,
        data: bytes,
        most_points: int,
        seconds: Callable[[TrajectoryMessage], float | None],
        ticket: int | None = None,
    ) -> None:
        """Take a serialized trajectory.

        Parameters
        ----------
        data : bytes
            A trajectory_msgs/JointTrajectory.
        most_points : int
            Largest number of points.
        seconds : callable
            Gives the message's stamp on the controller's time axis [s]; None for "now".
        ticket : int, optional
            `ticket` when it arrived; by default now.
        """
        with self.rejecting("joint_trajectory"):
            with self._lock:
                self._require_active("trajectory")
            message = read_trajectory(data, most_points)
            if message.points:
                self.follow(message.names, message.points, seconds(message), ticket)
                return
            with self._lock:
                self._require_active("trajectory")
                known = self._controller.rig.joint_names
                stopped = [name for name in message.names if name in known]
                self._controller.references.stop(stopped, self._clock())
                self.supersede(stopped)

    def follow(
        self,
        names: Sequence[str],
        points: Sequence[TrajectoryPoint],
        start: float | None,
        ticket: int | None = None,
    ) -> tuple[dict[str, JointSpline], str]:
        """Follow a trajectory from now on.

        Parameters
        ----------
        names : sequence of str
            Some or all joints of the rig.
        points : sequence of TrajectoryPoint
            At least one.
        start : float or None
            Time at which time_from_start is zero [s]; None for the present time.
        ticket : int, optional
            `ticket` when it arrived; by default now. What came after it is not undone.

        Returns
        -------
        splines : dict of str to JointSpline
            What the joints follow.
        note : str
            How much slower than asked it is played, and why; empty if it is not.

        Raises
        ------
        CommandError
            When the trajectory is rejected; the present reference is kept.
        """
        references = self._controller.references
        ticket = self._orders if ticket is None else ticket
        with self._lock:
            self._require_active("trajectory")
            measured = self._controller.measured
        planned = references.plan(names, points, start=start, now=self._clock(), measured=measured)
        if planned is None:
            raise CommandError("trajectory rejected: it has no points")
        with self._lock:
            now = self._clock()
            at_join = references.references_at_join(planned, now)
        splines, note = references.join(planned, at_join, now)
        with self._lock:
            self._require_active("trajectory")
            later = [name for name in splines if self._last_order.get(name, 0) > ticket]
            if later:
                raise CommandError(
                    f"trajectory rejected: another command for {', '.join(later)}, such as a stop, "
                    "arrived while it was planned"
                )
            references.take(splines)
        if note:
            self.slowed += 1
            self.last_note = (note, self._clock())
            if self._news.is_due(self.last_note[1], "slowed"):
                self._log(f"joint_trajectory: {note}")
        return splines, note

    def stream(
        self, names: Sequence[str], positions: Sequence[float], velocities: Sequence[float]
    ) -> None:
        """Take a streamed command [rad], [rad/s]; velocities that are all NaN count as missing."""
        if all(math.isnan(velocity) for velocity in velocities):
            velocities = []
        with self.rejecting("commands"), self._lock:
            now = self._clock()
            try:
                self._require_active("streamed command")
            except CommandError:
                self._controller.references.refused_stream(names, now)
                raise
            self._controller.references.stream(
                names, positions, velocities, now=now, measured=self._controller.measured
            )
            self.supersede(names)

    def stiffness(self, values: Sequence[float]) -> None:
        """Take a stiffness for each joint [N m/rad]."""
        self._controller.limits.foresee(values)
        with self.rejecting("stiffness_commands"), self._lock:
            self._require_active("stiffness command", moves=False)
            self._controller.set_stiffness(values)

    def torque(self, values: Sequence[float]) -> None:
        """Take a torque for each joint [N m]."""
        with self.rejecting("torque_commands"), self._lock:
            self._require_active("torque command", moves=False)
            self._controller.set_torques(values, self._clock())

    def _require_active(self, what: str, moves: bool = True) -> None:
        reason = self._reason_against() or (moves and self._controller.reason_against_motion())
        if reason:
            raise CommandError(f"{what} rejected: {reason}")

    def rejecting(self, topic: str) -> Rejecting:
        """A block in which a PamError means that a message of this topic is rejected."""
        return Rejecting(lambda error: self._reject(topic, error))

    def _reject(self, topic: str, error: PamError) -> None:
        self.rejected += 1
        text = f"{topic}: {error}"
        now = self._clock()
        if self._news.is_due(now, topic, *place_of(error)):
            self._log(text)
        self.last_rejection = (text, now)


class Rejecting:
    """A block whose PamError is reported instead of raised."""

    def __init__(self, report: Callable[[PamError], None]) -> None:
        self._report = report

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: Any, trace: Any) -> bool:
        if isinstance(error, PamError):
            self._report(error)
            return True
        return False
