"""A valve board whose firmware is a process: the host build of `firmware/`.

The process answers one request at a time through a pipe (`firmware/host/pipe.c` describes it), with
the time of the simulation. So the simulated plant, any bus and any clock can be around the very
code that runs on a board.
"""

from __future__ import annotations

import math
import struct
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from pam_driver.boards.pam_board.codec import CHANNELS, BoardFault, BoardState, SafetyInput
from pam_driver.boards.protocol import Frame
from pam_model.errors import PamError
from pam_sim.boards.protocol import BoardSettings, BoardValve, SimulatedBoard

_REQUEST: Final = struct.Struct("<BBH8sIiiiiBBBBHxx")
_ANSWER: Final = struct.Struct("<BBBxHHhh")
_FRAME: Final = struct.Struct("<HBx8s")
_FULL_SCALE: Final = 32767.0
_NO_LIMIT: Final = 2**31 - 1
_BRAKE, _DUMP = 4, 8


class FirmwareBoard:
    """One valve board that runs the firmware.

    Parameters
    ----------
    program : Path
        The host build, `firmware/out/pam_board`.
    number : int
        Its number on the bus.
    settings : BoardSettings
        The boot time; all other times are those of the firmware.
    valves, channels, sensors : sequence
        The valves on its channels, the channel of each valve and of each pressure sensor.
    now : float
        Time of power-up [s].
    with_canopen : bool, optional
        Whether it uses the identifiers that share a bus with CANopen.

    Raises
    ------
    PamError
        If the program cannot be started.
    """

    def __init__(
        self,
        program: Path,
        number: int,
        settings: BoardSettings,
        valves: Sequence[BoardValve],
        channels: Sequence[int],
        sensors: Sequence[int],
        now: float,
        with_canopen: bool = False,
    ) -> None:
        self.valves = tuple(valves)
        self._channels, self._sensors = tuple(channels), tuple(sensors)
        self._program, self._number, self._settings = program, number, settings
        self._with_canopen = with_canopen
        self._started = now
        self._stop = self._switch = SafetyInput.NOT_AVAILABLE
        self._readings = ([0.0] * CHANNELS, 0.0, 0.0)
        self._waiting: list[Frame] = []
        limits = [_NO_LIMIT] * CHANNELS
        for channel, valve in zip(self._channels, self.valves, strict=True):
            limits[channel] = int(min(valve.max_pressure, _NO_LIMIT))
        command = [str(program), "--pipe", "--number", str(number)]
        command += ["--boot-ms", str(round(1e3 * settings.boot_time))]
        command += ["--max-pressure", *map(str, limits)]
        command += ["--with-canopen"] if with_canopen else []
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
            )
        except OSError as error:
            raise PamError(f"firmware {program}: {error.strerror}") from None
        self.state = BoardState.BOOT
        self.faults = BoardFault(0)
        self.rejected_frames = 0
        self.brake_released = self.dump_closed = False
        self._vents = [True] * CHANNELS
        self._fractions = [0.0] * CHANNELS
        self._ask(now)

    @property
    def active(self) -> bool:
        """Whether its valves follow set points."""
        return self.state is BoardState.ACTIVE

    @property
    def fault_names(self) -> tuple[str, ...]:
        """The names of its latched faults."""
        return tuple(str(fault.name) for fault in self.faults)

    @property
    def valve_commands(self) -> tuple[float, ...]:
        """The valves' commands: spool -1..1 or gauge pressure [Pa]; vented unless active."""
        return tuple(
            valve.vented if self._vents[channel] else valve.command(self._fractions[channel])
            for valve, channel in zip(self.valves, self._channels, strict=True)
        )

    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        """Pass a frame to the firmware; one with 29 bits or a CAN FD frame never reaches it."""
        if frame_id <= 0x7FF and len(data) <= 8:
            self._ask(now, (frame_id, data))

    def poll(
        self,
        now: float,
        pressures: Sequence[float],
        angles: Sequence[float],
        supply_pressure: float,
    ) -> list[Frame]:
        """Let the firmware read its sensors and the time; return what it sends."""
        shown = [0.0] * CHANNELS
        for channel, pressure in zip(self._sensors, pressures, strict=True):
            shown[channel] = pressure
        self._readings = (shown, angles[0] if angles else 0.0, supply_pressure)
        self._ask(now)
        frames, self._waiting = self._waiting, []
        return frames

    def restarted(self, now: float) -> SimulatedBoard:
        """The board after a power-up at `now` [s]: another process."""
        self.close()
        board = FirmwareBoard(
            self._program,
            self._number,
            self._settings,
            self.valves,
            self._channels,
            self._sensors,
            now,
            self._with_canopen,
        )
        board._stop, board._switch = self._stop, self._switch
        return board

    def misbehave(self, fault: str, value: float) -> None:
        """A person uses an input; other faults of firmware cannot be brought about from outside."""
        if fault == "emergency_stop":
            self._stop = SafetyInput(round(value))
        elif fault == "enabling_switch":
            self._switch = SafetyInput(round(value))

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()

    def _ask(self, now: float, frame: Frame | None = None) -> None:
        """One turn of the firmware.

        Raises
        ------
        PamError
            If the process has ended, for example because a sanitizer found a mistake.
        """
        pressures, angle, supply = self._readings
        readings = [*pressures, 1e6 * angle, supply]
        valid = sum(1 << place for place, value in enumerate(readings) if math.isfinite(value))
        frame_id, data = frame or (0, b"")
        request = _REQUEST.pack(
            frame is not None,
            len(data),
            frame_id,
            data,
            round(1e6 * (now - self._started)) & 0xFFFF_FFFF,
            *(round(value) if math.isfinite(value) else 0 for value in readings),
            valid,
            self._stop,
            self._switch,
            1,
            0,
        )
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        try:
            stdin.write(request)
            answer = _read(stdout.read, _ANSWER.size)
            count, state, bits, faults, rejected, first, second = _ANSWER.unpack(answer)
            frames = _read(stdout.read, count * _FRAME.size)
        except (BrokenPipeError, EOFError):
            code = self._process.wait()
            raise PamError(f"firmware {self._program}: ended with exit code {code}") from None
        self.state, self.faults = BoardState(state), BoardFault(faults)
        self.rejected_frames = rejected
        self._vents = [bool(bits & 1 << channel) for channel in range(CHANNELS)]
        self._fractions = [first / _FULL_SCALE, second / _FULL_SCALE]
        self.brake_released, self.dump_closed = bool(bits & _BRAKE), bool(bits & _DUMP)
        for sent_id, length, payload in _FRAME.iter_unpack(frames):
            self._waiting.append((sent_id, payload[:length]))


def _read(read: Callable[[int], bytes | None], size: int) -> bytes:
    """Exactly `size` bytes of a pipe; EOFError if it ends before."""
    data = b""
    while len(data) < size:
        more = read(size - len(data))
        if not more:
            raise EOFError
        data += more
    return data
