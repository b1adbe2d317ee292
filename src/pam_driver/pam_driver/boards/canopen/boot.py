"""Brings a device into the state operational: NMT, checks, configuration, start.

Source: CiA 302-2 (boot procedure of a node), reduced to what a driver of known devices needs.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from typing import Final

from pam_driver.boards.canopen.device import (
    NMT,
    OPERATIONAL,
    PRE_OPERATIONAL,
    START,
    STATES,
    STOP,
    CanopenDevice,
    Check,
)
from pam_driver.boards.canopen.sdo import SdoClient
from pam_driver.boards.protocol import NEVER, Frame

# A device that did not answer is asked again after [s].
_PAUSE: Final = 0.5
# So many answers without a request come from a second device; another tool may cause fewer.
_SURPLUS: Final = 3


class BootStage(Enum):
    """How far the boot is."""

    IDLE = "not begun"
    CONFIGURING = "being configured"
    STARTING = "being started"
    DONE = "done"
    WAITING = "no answer"
    REFUSED = "refused"


class Boot:
    """The boot of one device.

    Attributes
    ----------
    stage : BootStage
        How far it is.
    error : str
        Why the device does not answer, or cannot be used; it names node, object and reason.
    notes : list of str
        Steps that the device refused although it may.
    """

    def __init__(self, device: CanopenDevice) -> None:
        self.stage = BootStage.IDLE
        self.error = ""
        self.notes: list[str] = []
        self.sdo = SdoClient(device.node, device.sdo_timeout)
        self._device = device
        self._place = 0
        self._began = False
        self._until = NEVER

    @property
    def progress(self) -> str:
        """What it does, as text."""
        if self.stage is BootStage.CONFIGURING:
            steps = self._device.steps
            name = steps[min(self._place, len(steps) - 1)].name
            return f"being configured, step {self._place + 1} of {len(steps)}: {name}"
        if self.stage in {BootStage.WAITING, BootStage.REFUSED}:
            return self.error
        return str(self.stage.value)

    def begin(self) -> None:
        """Boot the device from the start with the next cycle."""
        self.stage, self.error, self.notes = BootStage.CONFIGURING, "", []
        self._place, self._began = 0, False
        self.sdo.cancel()
        self.sdo.surplus = 0

    def is_operational(self) -> None:
        """Note that the device has shown to be operational after it was started."""
        if self.stage is BootStage.STARTING:
            self.stage = BootStage.DONE

    def frames(self, now: float) -> Iterator[Frame]:
        """The frames of one cycle at `now` [s]."""
        if self.stage is BootStage.WAITING and now >= self._until:
            self.begin()
        if self.stage is BootStage.STARTING and now >= self._until:
            self._fail(
                f"node {self._device.node} was started (NMT) and does not report to be "
                f"{STATES[OPERATIONAL]}",
                BootStage.WAITING,
                now,
            )
        if self.stage is not BootStage.CONFIGURING:
            return
        node = self._device.node
        if self.sdo.surplus >= _SURPLUS:
            text = f"two devices answer as node {node}: give one of them another node number"
            self._fail(text, BootStage.REFUSED, now)
            return
        if not self._began:
            self._began = True
            self.sdo.begin(self._device.steps[0])
        if self._go_on(now):
            yield NMT, bytes([START, node])
            return
        data = self.sdo.frame(now)
        if data is None:
            return
        if self._place == 0:  # repeated with the request, since nothing acknowledges NMT
            if self._device.commands:  # its outputs go off before anything is changed
                yield NMT, bytes([STOP, node])
            yield NMT, bytes([PRE_OPERATIONAL, node])
        yield self.sdo.request_id, data

    def _go_on(self, now: float) -> bool:
        """Judge the result of a step if there is one, begin the next; whether all are done."""
        result = self.sdo.take()
        if result is None:
            return False
        step = self._device.steps[self._place]
        error = result.error
        if isinstance(step, Check) and not error and (result.value ^ step.expected) & step.mask:
            got, expected = result.value & step.mask, step.expected & step.mask
            self._fail(
                f"node {self._device.node}, object {step.name} ({step.why}) is 0x{got:X}, "
                f"expected 0x{expected:X}",
                BootStage.REFUSED,
                now,
            )
            return False
        if error and not isinstance(step, Check) and step.may_fail and result.aborted:
            self.notes.append(error)
            error = ""
        if error:
            self._fail(error, BootStage.REFUSED if result.aborted else BootStage.WAITING, now)
            return False
        self._place += 1
        if self._place < len(self._device.steps):
            self.sdo.begin(self._device.steps[self._place])
            return False
        self.stage = BootStage.STARTING
        self._until = now + max(4.0 * self._device.heartbeat_period, _PAUSE)
        return True

    def _fail(self, error: str, stage: BootStage, now: float) -> None:
        self.error, self.stage = error, stage
        self._until = now + _PAUSE
        self.sdo.cancel()
