"""The driver's state as a latched topic: what a controller must know before it moves anything.

The driver publishes a DiagnosticStatus on `~/state` whenever its state changes, and once when it
starts. The topic is latched (transient local), so that a node that starts later receives the
present state at once. `values` holds `state`, `reason`, `speed` (full or reduced) and `activation`
for programs, `message` the first three for people.

Every activation has another number, so that a controller starts again with each, even if it missed
the states before, or received other ones from a recording that was played.
"""

from __future__ import annotations

from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from pam_ros.foreign_text import SENTENCE, plain

LATCHED: Final = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Quality of service of the topic, for publisher and subscriber."""
FULL: Final = "full"
COMMANDABLE: Final = frozenset({"ready", "active"})
"""States in which the driver takes commands; the first command leads from ready to active."""


def driver_state_message(
    name: str, state: str, reason: str, *, reduced: bool = False, activation: int = 0
) -> Any:
    """A message for the topic.

    Parameters
    ----------
    name : str
        Of the driver's node.
    state : str
        One of the states on the driver's page.
    reason : str
        What brought it there; may be empty.
    reduced : bool, optional
        Whether full speed is not permitted.
    activation : int, optional
        Names the last activation; 0 if there was none.
    """
    told = f"{state} at reduced speed" if reduced else state
    level = DiagnosticStatus.ERROR if state.startswith("fault") else DiagnosticStatus.OK
    return DiagnosticStatus(
        level=level,
        name=f"{name}: state",
        message=f"{told}: {reason}" if reason else told,
        values=[
            KeyValue(key="state", value=state),
            KeyValue(key="reason", value=reason),
            KeyValue(key="speed", value="reduced" if reduced else FULL),
            KeyValue(key="activation", value=str(activation)),
        ],
    )


def reason_against_commands(message: Any) -> str:
    """Why the driver takes no commands in the state of this message; empty if it does."""
    values = _values(message)
    state, reason = plain(values.get("state", "")), plain(values.get("reason", ""), SENTENCE)
    if state in COMMANDABLE:
        return ""
    return f"the driver is {state or 'in an unknown state'}" + (f" ({reason})" if reason else "")


def activation_of(message: Any) -> str:
    """Number of the activation that the message reports; empty if it has none."""
    return _values(message).get("activation", "")


def permits_full_speed(message: Any) -> bool:
    """Whether the message says that full speed is permitted; one that does not say it, does not."""
    return _values(message).get("speed") == FULL


def _values(message: Any) -> dict[str, str]:
    return {pair.key: pair.value for pair in message.values}
