"""The calls from the plant to the laws of the effects, generated from the registry.

For every slot there is one function below that the stages of the plant call. Its source code is
generated from the effects that fill the slot, and it is compiled like the rest of the plant. An
effect at its neutral values is skipped. `SOURCE` holds the code, for reading and for tracebacks.
"""

from __future__ import annotations

import linecache
from collections.abc import Callable
from typing import Any

from pam_model.effects.declaration import Effect
from pam_model.effects.registry import filled
from pam_model.effects.slots import (
    Chamber,
    DryFriction,
    JointTorque,
    Leak,
    Opening,
    PassivePull,
    PullState,
    Slot,
    Thread,
    laws_of,
)
from pam_model.plant import layout
from pam_model.plant.compiled import compiled

_FILE = "<plant composed of effects>"


class _Writer:
    """Collect the source code and the names that it uses."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.names: dict[str, Any] = {
            name: value for name, value in vars(layout).items() if name[:2] in ("C_", "M_")
        }
        for constants in (*layout.JOINT_EFFECTS.values(), *layout.MUSCLE_EFFECTS.values()):
            head = constants.effect.name.upper()
            self.names[f"{head}_IS_ON"] = constants.is_on
            for key, place in constants.parameters.items():
                self.names[f"{head}_{key.upper()}"] = place
        for name, place in layout.PULL_STATES.items():
            self.names[f"S_{name.upper()}"] = place

    def constant(self, effect: Effect, name: str) -> str:
        """The expression that reads a constant of an effect."""
        base = "m + " if effect.scope == "muscle" else ""
        return f"c[{base}{effect.name.upper()}_{name.upper()}]"

    def call(self, effect: Effect, slot: Slot, law: str, *context: str) -> str:
        """The call of a law with its context and the effect's parameters."""
        name = f"{effect.name}_{type(slot).__name__.lower()}_{law}"
        function = laws_of(slot)[law][1]
        self.names[name] = compiled(function)
        parameters = [self.constant(effect, key) for key in effect.parameters]
        return f"{name}({', '.join((*context, *parameters))})"

    def when_on(self, effect: Effect, *lines: str) -> None:
        """Add lines that run only if the effect is not neutral."""
        self.lines.append(f"    if {self.constant(effect, 'is_on')} > 0.0:")
        self.lines += [f"        {line}" for line in lines]

    def add(self, *lines: str) -> None:
        """Add lines."""
        self.lines += lines


def _write_gas(w: _Writer) -> None:
    w.add("def opening(m, c, spool):", "    x = spool")
    for effect, slot in filled(Opening):
        w.when_on(effect, f"x = {w.call(effect, slot, 'law', 'x')}")
    w.add("    return min(max(x, -1.0), 1.0)", "")

    w.add("def leak(m, c, pressure):", "    lost = 0.0")
    for effect, leak_slot in filled(Leak):
        context = ("pressure", "c[C_AMBIENT]", "c[m + M_CRITICAL]")
        w.when_on(effect, f"lost += {w.call(effect, leak_slot, 'law', *context)}")
    w.add("    return lost", "")

    arguments = "pressure, temperature, volume, volume_per_pressure, flow_in, flow_out"
    w.add(f"def chamber(m, c, {arguments}):")
    for effect, chamber_slot in filled(Chamber):
        call = w.call(effect, chamber_slot, "law", arguments, "c[C_TEMPERATURE]")
        w.when_on(effect, f"return {call}")
    w.add("    return 0.0, 0.0", "")


def _write_muscle(w: _Writer) -> None:
    w.add("def thread(m, c, pressure, length):")
    for effect, slot in filled(Thread):
        w.when_on(effect, f"return {w.call(effect, slot, 'law', 'pressure, length, c[m + M_B]')}")
    w.add("    return c[m + M_B], 0.0, 0.0", "")

    w.add("def passive_pull(m, c, length):", "    pull, slope = 0.0, 0.0")
    for effect, passive in filled(PassivePull):
        call = w.call(effect, passive, "law", "length", "c[m + M_REST]")
        w.when_on(effect, f"own, own_slope = {call}", "pull += own", "slope += own_slope")
    w.add("    return pull, slope", "")

    braid = "c[m + M_BRAID_AREA], c[m + M_BRAID_SLOPE]"
    w.add("def memory_pull(m, c, y, o, pressure):", "    pull, area = 0.0, 0.0")
    for effect, state in filled(PullState):
        call = w.call(effect, state, "pull", f"y[o + S_{state.name.upper()}], pressure, {braid}")
        w.when_on(effect, f"own, own_area = {call}", "pull += own", "area += own_area")
    w.add("    return pull, area", "")

    w.add(
        "def memory_response(m, c, y, o, pressure):", "    longer, shorter, drift = 0.0, 0.0, 0.0"
    )
    for effect, state in filled(PullState):
        call = w.call(
            effect, state, "response", f"y[o + S_{state.name.upper()}], pressure, {braid}"
        )
        w.when_on(
            effect,
            f"own_longer, own_shorter, own_drift = {call}",
            "longer += own_longer",
            "shorter += own_shorter",
            "drift += own_drift",
        )
    w.add("    return longer, shorter, drift", "")

    w.add("def memory_move(m, c, y, dy, moved, o, step):")
    for effect, state in filled(PullState):
        place = f"o + S_{state.name.upper()}"
        w.when_on(effect, f"moved[{place}] = y[{place}] + step * dy[{place}]")
    w.add("    return", "")

    w.add("def memory_step(m, c, y, k1, k2, k3, k4, o, step):")
    for effect, state in filled(PullState):
        place = f"o + S_{state.name.upper()}"
        middle = f"2.0 * (k2[{place}] + k3[{place}])"
        w.when_on(effect, f"y[{place}] += step / 6.0 * (k1[{place}] + {middle} + k4[{place}])")
    w.add("    return", "")

    w.add("def memory_rates(m, c, y, dy, o, speed, step):")
    for effect, state in filled(PullState):
        place = f"o + S_{state.name.upper()}"
        w.add(f"    dy[{place}] = 0.0")
        call = w.call(effect, state, "rate", f"y[{place}], speed, step")
        w.when_on(effect, f"dy[{place}] = {call}")
    w.add("    return", "")


def _write_joint(w: _Writer) -> None:
    w.add("def dry_friction(c, speed):", "    torque = 0.0")
    for effect, slot in filled(DryFriction):
        w.when_on(effect, f"torque += {w.call(effect, slot, 'law', 'speed')}")
    w.add("    return torque", "")

    w.add("def joint_torque(c, position, speed):", "    torque = 0.0")
    for effect, torque in filled(JointTorque):
        w.when_on(effect, f"torque += {w.call(effect, torque, 'law', 'position, speed')}")
    w.add("    return torque", "")


def _compose() -> tuple[str, dict[str, Callable[..., Any]]]:
    writer = _Writer()
    _write_gas(writer)
    _write_muscle(writer)
    _write_joint(writer)
    source = "\n".join(writer.lines)
    linecache.cache[_FILE] = (len(source), None, source.splitlines(keepends=True), _FILE)
    made = dict(writer.names)
    exec(compile(source, _FILE, "exec"), made)
    functions = [line.removeprefix("def ").split("(")[0] for line in writer.lines if "def " in line]
    return source, {name: compiled(made[name]) for name in functions}


SOURCE, _functions = _compose()

opening = _functions["opening"]
"""opening(m, c, spool): opening of a flow valve, -1 (exhaust) to 1 (supply)."""
leak = _functions["leak"]
"""leak(m, c, pressure): flow out of the muscle over rho0 [m^3/s]."""
chamber = _functions["chamber"]
"""chamber(m, c, pressure, temperature, ...): dP/dt and dT/dt, see slots.Chamber."""
thread = _functions["thread"]
"""thread(m, c, pressure, length): thread length b, db/dp and db/dL."""
passive_pull = _functions["passive_pull"]
"""passive_pull(m, c, length): pull [N] and dF/dL [N/m]."""
memory_pull = _functions["memory_pull"]
"""memory_pull(m, c, y, o, pressure): pull [N] of all PullState effects, and dF/dp [m^2]."""
memory_response = _functions["memory_response"]
"""memory_response(m, c, y, o, pressure): dF/dL [N/m] lengthening and shortening, dF/dt [N/s]."""
memory_move = _functions["memory_move"]
"""memory_move(m, c, y, dy, moved, o, step): writes these states after a step with rates dy."""
memory_step = _functions["memory_step"]
"""memory_step(m, c, y, k1, k2, k3, k4, o, step): advances these states by a Runge-Kutta step."""
memory_rates = _functions["memory_rates"]
"""memory_rates(m, c, y, dy, o, speed, step): writes the rates of these states into dy."""
dry_friction = _functions["dry_friction"]
"""dry_friction(c, speed): magnitude of the friction torque [N m]."""
joint_torque = _functions["joint_torque"]
"""joint_torque(c, position, speed): torque of all smooth effects at the joint [N m]."""
