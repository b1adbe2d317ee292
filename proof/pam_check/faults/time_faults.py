"""Faults of time: messages that take long, clocks that stop or are set, processes that pause."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping

from pam_check.faults.chain import STEP, FaultChain

Values = Mapping[str, float]
Injection = Callable[[FaultChain, Values, random.Random], None]


def _delayed(topic: str) -> Injection:
    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        delay = values["delay"]
        setattr(chain, topic, lambda: delay)

    return inject


def _jitter(topic: str) -> Injection:
    """Each message takes another time; messages of one topic do not overtake each other."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        latest = chain.now

        def time() -> float:
            nonlocal latest
            latest = max(latest, chain.now + draw.uniform(0.0, values["delay"]))
            return latest - chain.now

        setattr(chain, topic, time)

    return inject


def _silence(chain: FaultChain) -> None:
    chain.measurement_time = lambda: math.inf


def _clock_stops(chain: FaultChain, values: Values, draw: random.Random) -> None:
    stopped = chain.wall

    def stop(now: float) -> None:
        chain.wall = stopped

    chain.inject.append(stop)
    _silence(chain)


def _clock_is_set(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.wall += values["by"]
    _silence(chain)


def _clock_is_set_often(chain: FaultChain, values: Values, draw: random.Random) -> None:
    """The clock is set back so often that a stamp never looks old."""
    end = chain.now + values["duration"]

    def back(now: float) -> None:
        if now < end:
            chain.wall -= 2.0 * STEP

    chain.inject.append(back)
    _silence(chain)


def _no_stamps(chain: FaultChain, values: Values, draw: random.Random) -> None:
    chain.unstamped = True
    chain.wait(0.2)
    chain.controller_runs = False


def _pauses(*names: str) -> Injection:
    """Processes pause for a moment, again and again."""

    def inject(chain: FaultChain, values: Values, draw: random.Random) -> None:
        begin = chain.now

        def pause(now: float) -> None:
            runs = (now - begin) % values["period"] >= values["gap"]
            for name in names:
                setattr(chain, name, runs)

        chain.inject.append(pause)

    return inject


INJECTIONS: Mapping[str, Injection] = {
    "commands_delayed": _delayed("command_time"),
    "commands_jitter": _jitter("command_time"),
    "measurements_delayed": _delayed("measurement_time"),
    "measurements_jitter": _jitter("measurement_time"),
    "clock_stops_while_silent": _clock_stops,
    "clock_step_while_silent": _clock_is_set,
    "clock_set_back_while_silent": _clock_is_set_often,
    "commands_without_stamps_stop": _no_stamps,
    "host_pauses": _pauses("driver_runs", "controller_runs"),
    "driver_pauses": _pauses("driver_runs"),
    "controller_pauses": _pauses("controller_runs"),
}
