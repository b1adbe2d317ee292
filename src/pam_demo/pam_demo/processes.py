"""Runs nodes as separate processes: starts them, reads their output, waits for and ends them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Self

from pam_model.errors import PamError

Setting = bool | int | float | str


class ProcessError(PamError):
    """A process ended too early or did not respond; the message has its last output."""


def parameter_arguments(
    parameters: Mapping[str, Setting], params_files: Sequence[str | Path] = ()
) -> list[str]:
    """Command line arguments that set a node's parameters.

    Parameters
    ----------
    parameters : mapping
        Single values, which override those of the files.
    params_files : sequence of str or Path
        Parameter files, including the rig file.

    Returns
    -------
    list of str
        From `--ros-args` on; empty when there is nothing to set.
    """
    arguments: list[str] = []
    for path in params_files:
        arguments += ["--params-file", str(path)]
    for name, value in parameters.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        arguments += ["-p", f"{name}:={text}"]
    return ["--ros-args", *arguments] if arguments else []


class NodeProcess:
    """One node, run as `python -m module`.

    Parameters
    ----------
    module : str
        For example "pam_driver.driver_node".
    parameters : mapping, optional
        Parameter values.
    params_files : sequence of str or Path, optional
        Parameter files, including the rig file.
    environment : mapping, optional
        Variables that are added to the environment of this process.
    arguments : sequence of str, optional
        Arguments before the ROS arguments.

    Raises
    ------
    OSError
        If the process cannot be started.
    """

    def __init__(
        self,
        module: str,
        parameters: Mapping[str, Setting] | None = None,
        params_files: Sequence[str | Path] = (),
        environment: Mapping[str, str] | None = None,
        arguments: Sequence[str] = (),
    ) -> None:
        self.module = module
        command = [
            sys.executable,
            "-m",
            module,
            *arguments,
            *parameter_arguments(parameters or {}, params_files),
        ]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env={**os.environ, "PYTHONUNBUFFERED": "1", **(environment or {})},
            # Ctrl-C in the terminal reaches only the parent, which then ends the nodes in order
            start_new_session=True,
        )
        self._lines: list[str] = []
        self._news = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._news:
                self._lines.append(line.rstrip("\n"))
                self._news.notify_all()
        with self._news:
            self._news.notify_all()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process is still running."""
        return self._process.poll() is None

    @property
    def output(self) -> str:
        """All output of the process, including errors."""
        with self._news:
            return "\n".join(self._lines)

    def check(self) -> None:
        """Raise ProcessError if the process has ended."""
        if not self.running:
            raise ProcessError(f"{self.module} ended with code {self._ended()}:\n{self._last()}")

    def wait_for_output(self, text: str, timeout: float) -> None:
        """Wait until a line with `text` has been written.

        Raises
        ------
        ProcessError
            If the process ends first or `timeout` seconds pass.
        """
        deadline = time.monotonic() + timeout
        with self._news:
            while not any(text in line for line in self._lines):
                left = deadline - time.monotonic()
                if not self._reader.is_alive():
                    break
                if left <= 0.0:
                    raise ProcessError(
                        f"{self.module} did not write {text!r} within {timeout:g} s:\n"
                        + "\n".join(self._lines[-15:])
                    )
                self._news.wait(min(left, 0.5))
            else:
                return
        self._reader.join(1.0)
        if text not in self.output:
            raise ProcessError(f"{self.module} ended with code {self._ended()}:\n{self._last()}")

    def wait(self, timeout: float) -> int:
        """Wait for the end; return the exit code, or the negative number of the ending signal.

        Raises
        ------
        ProcessError
            If the process still runs after `timeout` seconds.
        """
        try:
            code = self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            raise ProcessError(
                f"{self.module} still runs after {timeout:g} s:\n{self._last()}"
            ) from None
        self._reader.join(1.0)
        return code

    def send(self, number: signal.Signals) -> None:
        """Send a signal if the process still runs."""
        if self.running:
            self._process.send_signal(number)

    def stop(self, timeout: float = 5.0) -> int:
        """End the process by SIGINT, or by force after a time-out; return the exit code."""
        self.send(signal.SIGINT)
        try:
            return self.wait(timeout)
        except ProcessError:
            self.kill()
            return self.wait(5.0)
        except KeyboardInterrupt:
            self.kill()
            raise

    def kill(self) -> None:
        """Kill the process and all processes that it has started."""
        if self.running:
            os.killpg(self._process.pid, signal.SIGKILL)

    def _ended(self) -> int:
        return self._process.wait(5.0)

    def _last(self) -> str:
        return "\n".join(self.output.splitlines()[-15:])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()
