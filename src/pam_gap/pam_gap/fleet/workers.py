"""Runs one function over many jobs on Dask workers: a failed job is a result, none is lost.

Dask gives the job of a worker that died to another one. A job whose workers die again and again is
given up with a reason. Other exceptions of the function are reasons, too, so that one recording
never ends the run of the others.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from pam_model.errors import PamError

DEATHS = 3
"""Number of workers that may die of one job before it is given up."""
RETRIES = 1
"""Repetitions of a job that ended with an exception; not of one that reports a user's mistake."""
WAIT = 30  # s for an existing scheduler


@dataclass(frozen=True, slots=True)
class Ended:
    """The end of one job."""

    number: int  # place of the job in the sequence
    result: Any  # what the function returned; None after a failure
    failure: str = ""  # reason in one line; empty after success


def one_line(error: BaseException) -> str:
    """The reason of an exception in one line."""
    text = " ".join(str(error).split()) or "no reason given"
    return text if isinstance(error, PamError) else f"{type(error).__name__}: {text}"


def _dask() -> tuple[Any, Any]:
    """The modules dask and distributed, which are optional and slow to import.

    Raises
    ------
    PamError
        When they are not installed.
    """
    try:
        import dask  # noqa: PLC0415
        import distributed  # noqa: PLC0415
    except ImportError:
        raise PamError(
            "Dask is not installed; it runs the diagnoses in parallel: pip install dask distributed"
        ) from None
    return dask, distributed


@contextlib.contextmanager
def cluster(workers: int, scheduler: str = "") -> Iterator[Any]:
    """A Dask client: of an existing scheduler, or of processes with one thread on this machine.

    Raises
    ------
    PamError
        When Dask is not installed, or the scheduler does not answer.
    """
    dask, distributed = _dask()
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS - 1,
        "distributed.worker.daemon": True,
        "distributed.nanny.pre-spawn-environ.NUMBA_NUM_THREADS": 1,
    }
    with dask.config.set(settings), contextlib.ExitStack() as stack:
        if scheduler:
            try:
                client = distributed.Client(scheduler, timeout=WAIT)
            except (OSError, ValueError) as error:
                raise PamError(
                    f"{scheduler}: no Dask scheduler answers ({one_line(error)}); expected an "
                    "address such as tcp://192.168.1.5:8786"
                ) from None
        else:
            local = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )
            )
            client = distributed.Client(local)
        yield stack.enter_context(client)


def run_all(
    client: Any,
    function: Callable[[Any], Any],
    jobs: Sequence[Any],
) -> Iterator[Ended]:
    """Run a function on every job; results come in the order in which they end.

    Parameters
    ----------
    client : distributed.Client
        From `cluster`.
    function : callable
        Called with one job on a worker; a PamError is a failure that is not repeated.
    jobs : sequence
        Objects that can be pickled.
    """
    _, distributed = _dask()
    places = {}
    for number, job in enumerate(jobs):
        # not pure: Dask must not take equal jobs for one
        future = client.submit(_carry_out, function, job, pure=False, retries=RETRIES)
        places[future] = number
    for future in distributed.as_completed(places):
        number = places.pop(future)
        error = future.exception()
        if error is None:
            value, failure = future.result()
            yield Ended(number, value, failure)
        elif isinstance(error, distributed.KilledWorker):
            yield Ended(number, None, f"{DEATHS} workers died while they worked on it")
        else:
            yield Ended(number, None, one_line(error))


def _carry_out(function: Callable[[Any], Any], job: Any) -> tuple[Any, str]:
    try:
        return function(job), ""
    except PamError as error:
        return None, one_line(error)
