"""What a controller needs of the effects: inverses of valves, and memory along a reference.

As in `composition`, one function for each purpose is generated from the registry and compiled, so
that an effect is written once, in its file. Effects of the flow path are inverted first, for
example an exhaust path that is narrower than the supply path; the result may saturate. Then the
effects between spool and opening are inverted, in the reverse of the order in which the plant
applies them.

Source: inverses of actuator nonlinearities as in G. Tao, P. V. Kokotovic, Adaptive Control of
Systems with Actuator and Sensor Nonlinearities, Wiley 1996.
"""

from __future__ import annotations

import linecache
from collections.abc import Callable, Sequence
from typing import Any, Final

from pam_model.effects import EFFECTS, Effect, Inverse, TorqueFeedforward, active, filled
from pam_model.effects.slots import Opening, PullState
from pam_model.plant.compiled import compiled
from pam_model.plant.layout import MUSCLE_EFFECTS, PULL_STATES
from pam_model.rig import Muscle

_FILE = "<control laws composed of effects>"
_AT_SPOOL = [effect for effect, _ in filled(Opening)]
_INVERTED = [effect for effect in EFFECTS.values() if isinstance(effect.control, Inverse)]
_FLOW = [effect for effect in _INVERTED if effect not in _AT_SPOOL]
_SPOOL = [effect for effect in reversed(_AT_SPOOL) if effect in _INVERTED]


def _places() -> tuple[dict[str, int], int]:
    """Index of each inverted effect's switch, which its parameters follow, and the row's size."""
    places, size = {}, 0
    for effect in _INVERTED:
        places[effect.name] = size
        size += 1 + len(effect.parameters)
    return places, size


_AT, N_INVERSES = _places()


def inverse_row(muscle: Muscle) -> list[float]:
    """The row `e` of a muscle: which effects of its valve are inverted, and their parameters."""
    row = [0.0] * N_INVERSES
    for effect in _INVERTED:
        at = _AT[effect.name]
        if active(effect, muscle.effects):
            row[at : at + 1 + len(effect.parameters)] = [1.0, *effect.values(muscle.effects)]
    return row


def _write_inverse(
    lines: list[str], names: dict[str, Any], head: str, effects: Sequence[Effect]
) -> None:
    lines.append(head)
    for effect in effects:
        assert isinstance(effect.control, Inverse)
        name, at = f"{effect.name}_inverse", _AT[effect.name]
        names[name] = compiled(effect.control.law)
        given = ", ".join(f"e[{at + 1 + index}]" for index in range(len(effect.parameters)))
        lines += [f"    if e[{at}] > 0.0:", f"        x = {name}(x, {given})"]
    lines += ["    return x", ""]


def _write_memory(lines: list[str], names: dict[str, Any]) -> None:
    lines.append("def memory_advance(m, c, y, o, stroke, duration):")
    for effect, slot in filled(PullState):
        if not (isinstance(effect.control, TorqueFeedforward) and effect.control.step):
            continue
        constants, name = MUSCLE_EFFECTS[effect.name], f"{effect.name}_step"
        names[name] = compiled(effect.control.step)
        given = ", ".join(f"c[m + {constants.parameters[key]}]" for key in effect.parameters)
        state = f"y[o + {PULL_STATES[slot.name]}]"
        lines += [
            f"    if c[m + {constants.is_on}] > 0.0:",
            f"        {state} = {name}({state}, stroke, duration, {given})",
        ]
    lines += ["    return", ""]


def _compose() -> dict[str, Callable[..., Any]]:
    lines: list[str] = []
    names: dict[str, Any] = {}
    _write_inverse(lines, names, "def flow_opening(e, x):", _FLOW)
    _write_inverse(lines, names, "def spool_position(e, x):", _SPOOL)
    _write_memory(lines, names)
    source = "\n".join(lines)
    linecache.cache[_FILE] = (len(source), None, source.splitlines(keepends=True), _FILE)
    exec(compile(source, _FILE, "exec"), names)
    return {
        name: compiled(names[name]) for name in ("flow_opening", "spool_position", "memory_advance")
    }


_functions: Final = _compose()

flow_opening = _functions["flow_opening"]
"""flow_opening(e, x): opening [-] with the flow that x gives on a valve with two equal paths."""
spool_position = _functions["spool_position"]
"""spool_position(e, x): the spool position [-] that gives the opening x [-]."""
memory_advance = _functions["memory_advance"]
"""memory_advance(m, c, y, o, stroke, duration): advances the states of a muscle's pull exactly,
while it lengthens by a stroke [m] within a time [s]."""
