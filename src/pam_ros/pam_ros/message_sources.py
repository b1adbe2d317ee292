"""Notices two publishers on one topic by what their messages say of their origin.

Every message names its source in `header.frame_id`. With one publisher the source stays the same;
a node that is started again changes it once. Two publishers take turns. Publishers that leave the
field empty look like one.
"""

from __future__ import annotations

import secrets
from collections import deque
from typing import Any, Final

from pam_ros.foreign_text import plain

# So many changes of the source within this time [s] mean that two publishers take turns.
_CHANGES: Final = 2
_CHANGE_MEMORY: Final = 1.0


def source_of(node: Any) -> str:
    """The source that a node names in its messages; two nodes of one name differ."""
    return f"{node.get_fully_qualified_name()}#{secrets.token_hex(3)}"


class MessageSources:
    """The sources of the messages of one topic."""

    def __init__(self) -> None:
        self._sources: tuple[str, str] | None = None  # the present one, and the one before
        self._changed_at: deque[float] = deque(maxlen=_CHANGES)

    def hear(self, source: str, now: float) -> None:
        """Note the source of a message that has arrived.

        Parameters
        ----------
        source : str
            Empty if the publisher does not say.
        now : float
            Monotonic time [s].
        """
        before = source if self._sources is None else self._sources[0]
        if source != before or self._sources is None:
            self._sources = source, before
        if source != before:
            self._changed_at.append(now)

    def taking_turns(self, now: float) -> str:
        """Who takes turns at present, as "A and B"; empty for one publisher."""
        changes = self._changed_at
        if len(changes) < _CHANGES or now - changes[0] > _CHANGE_MEMORY:
            return ""
        return " and ".join(plain(source) or "one without a name" for source in self._sources or ())
