"""Settings that change while the joints are controlled: at once, or as soon as they are designed.

A design takes seconds, and minutes on a busy slow computer. Whoever asks for it is answered at
once with "being designed", and everything else continues. When the design is done, the settings are
in force; if the loop would not be safe, the former values are restored, and the log says so.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

from pam_control.controller import Controller
from pam_control.controller_parameters import law_from, settings_from
from pam_control.prepared_settings import PreparedSettings
from pam_model.errors import PamError
from pam_ros.parameter_row import Value

MOST_WAITING: Final = 8
"""Changes that may wait for a design."""
Submit = Callable[[Callable[[], Any], Callable[[Any], None]], None]


class SettingChanges:
    """The settings of a running controller.

    Parameters
    ----------
    controller : Controller
        Uses them.
    lock : Lock
        Held whenever the controller is used.
    values : mapping
        Every parameter of the node at the start.
    submit : callable
        Takes slow work and what follows it in the main loop, see `pam_ros.slow_work`.
    in_force : callable
        Called with a text when a change is in force.
    refused : callable
        Called with the former values of a change that was refused after its design, and a text.

    Attributes
    ----------
    values : mapping
        Every parameter, as it is in force.
    refusal : str
        Why the last change was refused; empty if it was not.
    """

    def __init__(
        self,
        controller: Controller,
        lock: threading.Lock,
        values: Mapping[str, Value],
        submit: Submit,
        *,
        in_force: Callable[[str], None],
        refused: Callable[[Mapping[str, Value], str], None],
    ) -> None:
        self._controller, self._lock, self._submit = controller, lock, submit
        self._in_force, self._refused = in_force, refused
        self._waiting: deque[Mapping[str, Value]] = deque()
        self._since = 0.0
        self.values = dict(values)
        self.refusal = ""

    @property
    def designing(self) -> str:
        """What is being designed, and for how long; empty if nothing is."""
        if not self._waiting:
            return ""
        seconds = time.monotonic() - self._since
        others = len(self._waiting) - 1
        text = f"{', '.join(self._waiting[0])} for {seconds:.0f} s"
        return f"{text}; {others} more changes wait" if others else text

    def ask(self, changes: Mapping[str, Value]) -> str:
        """Change parameters; return a remark for the person who asked.

        Raises
        ------
        PamError
            For values that cannot be used, or too many changes that wait; nothing is changed.
        """
        asked = dict(self.values)
        for earlier in self._waiting:
            asked.update(earlier)
        values = {**asked, **changes}
        settings = settings_from(values, self._controller.rig.joint_names)
        law = law_from(values)
        if not self._waiting and self._controller.is_quick(settings, law):
            self._use(changes, self._controller.prepare(settings, law))
            return ""
        if len(self._waiting) >= MOST_WAITING:
            raise PamError(
                f"{', '.join(changes)}: not changed, because {MOST_WAITING} changes wait for a "
                f"design ({self.designing}); set it again when they are in force"
            )
        self._waiting.append(changes)
        if len(self._waiting) == 1:
            self._begin()
        return "being designed; the log and /diagnostics say when it is in force, or why it is not"

    def _begin(self) -> None:
        self._since = time.monotonic()
        values = {**self.values, **self._waiting[0]}
        self._submit(lambda: self._prepared(values), self._finish)

    def _prepared(self, values: Mapping[str, Value]) -> PreparedSettings | PamError:
        try:
            settings = settings_from(values, self._controller.rig.joint_names)
            return self._controller.prepare(settings, law_from(values))
        except PamError as error:
            return error

    def _finish(self, result: PreparedSettings | PamError) -> None:
        changes = self._waiting.popleft()
        asked = ", ".join(f"{name} = {value}" for name, value in changes.items())
        if isinstance(result, PamError):
            self.refusal = f"{asked}: refused: {result}"
            later = {name for each in self._waiting for name in each}
            former = {name: self.values[name] for name in changes if name not in later}
            self._refused(former, f"{self.refusal}; the former settings stay in force")
        else:
            self._use(changes, result)
            self._in_force(f"in force now: {asked}")
        if self._waiting:
            self._begin()

    def _use(self, changes: Mapping[str, Value], prepared: PreparedSettings) -> None:
        with self._lock:
            self._controller.use(prepared)
        self.values.update(changes)
        self.refusal = ""
