"""Time integration of one joint and its muscles: classical RK4 with a fixed step and held commands.

Constants, states and outputs are flat arrays; layout.py defines their indices. Dry friction and end
stops are decided once per step. A joint at rest whose torque is below the friction stays locked for
the step. For a sliding joint, friction opposes the speed at the start of the step; when the speed
changes its sign, the joint stops unless its torque exceeds the friction. Thus sticking is exact,
and the scheme is stable for any friction at any step. If a presliding angle is given, sticking is
elastic (joint_stage.py) and friction does not lock the joint.
"""

from __future__ import annotations

import math
from typing import Any

from pam_model.physics.joint_geometry import (
    muscle_length,
    muscle_torque,
)
from pam_model.physics.sine import sine
from pam_model.plant.compiled import compiled, entry_point, fused_entry_point
from pam_model.plant.composition import dry_friction, joint_torque, memory_move, memory_step
from pam_model.plant.joint_stage import joint_rates, winding
from pam_model.plant.layout import (
    C_AMBIENT,
    C_DROOP,
    C_EXTERNAL,
    C_FRICTION,
    C_GRAVITY,
    C_GRAVITY_ANGLE,
    C_LOWER,
    C_MUSCLES,
    C_PER_INERTIA,
    C_PRESLIDING,
    C_RADIUS,
    C_RATE,
    C_UPPER,
    M_ARM,
    M_CROSSED,
    M_DELAY,
    M_NEUTRAL,
    M_THERMAL,
    M_TUBE,
    N_MUSCLE_CONSTANTS,
    N_MUSCLE_OUTPUTS,
    N_MUSCLE_STATES,
    O_FORCE,
    O_LENGTH,
    O_MUSCLES,
    O_POSITION,
    O_PRESSURE,
    O_RESERVOIR,
    O_SPOOL,
    O_TEMPERATURE,
    O_TORQUE,
    O_VALVE_PRESSURE,
    O_VELOCITY,
    S_PRESSURE,
    S_SPOOL,
    S_TEMPERATURE,
    S_VALVE_PRESSURE,
    Y_BRISTLE,
    Y_MUSCLES,
    Y_POSITION,
    Y_RESERVOIR,
    Y_VELOCITY,
)
from pam_model.plant.muscle_stage import pull

LOWEST_PRESSURE = 1.0  # Pa absolute; a limit for diverging fits, far below any real pressure
# Contacts of a joint besides the sign of its motion. They are floats, as vectors of 256 bits have
# no conversion from integers.
LOCKED = 2.0
AT_REST = 3.0
WORK_ROWS = 7


@compiled
def held_command(
    commands: Any, channel: int, now: float, step: float, sample_time: float, delay: float
) -> float:
    """Mean of the command, delayed by `delay`, over [now, now + step].

    `now` is counted from the first row of `commands`; before this time, the first row applies.
    """
    if delay <= 0.0:
        index = min(int((now + 0.5 * step) / sample_time), len(commands) - 1)
        return float(commands[index][channel])
    start = (now - delay) / sample_time
    end = start + step / sample_time
    first = math.floor(start)
    last = math.floor(end)
    top = len(commands) - 1
    low = commands[int(min(max(first, 0), top))][channel]
    if first == last:
        return float(low)
    high = commands[int(min(max(last, 0), top))][channel]
    share = (end - last) / (end - start)
    return float(low + share * (high - low))


@compiled
def step_count(rate: float, sample_time: float, step: float) -> int:
    """Steps in one sample: none longer than `step` [s], more if the fastest `rate` needs them.

    More steps are a power of two or three quarters of one, so that many plants of a batch have the
    same number and can be simulated side by side.
    """
    least = max(1, math.ceil(sample_time / step - 1e-9))
    needed = min(math.ceil(sample_time * rate), 64 * least)
    if needed <= least:
        return least
    count = 1
    while count < needed:
        count *= 2
    return 3 * count // 4 if count >= 4 and 3 * count // 4 >= needed else count


@compiled
def muscle_pull(i: int, c: Any, tables: Any, y: Any) -> float:
    """Pull of muscle `i` [N] at this state."""
    m = C_MUSCLES + i * N_MUSCLE_CONSTANTS
    o = Y_MUSCLES + i * N_MUSCLE_STATES
    wound, _ = winding(c, y[Y_POSITION])
    path = muscle_length(c[m + M_NEUTRAL], c[m + M_ARM], c[C_RADIUS], wound) + c[m + M_CROSSED]
    force, _, _, _ = pull(m, c, tables[i], y, o, y[o + S_PRESSURE] - c[C_AMBIENT], path)
    return float(force)


@entry_point
def record(c: Any, tables: Any, y: Any, output: Any) -> None:
    """Write the outputs of the joint at this state into one row of them."""
    position = y[Y_POSITION]
    wound, relative = winding(c, position)
    arm = c[C_RADIUS] * relative
    torque = 0.0
    for i in range(len(tables)):
        m = C_MUSCLES + i * N_MUSCLE_CONSTANTS
        o = Y_MUSCLES + i * N_MUSCLE_STATES
        gauge = y[o + S_PRESSURE] - c[C_AMBIENT]
        force, length, _, _ = pull(
            m,
            c,
            tables[i],
            y,
            o,
            gauge,
            muscle_length(c[m + M_NEUTRAL], c[m + M_ARM], c[C_RADIUS], wound) + c[m + M_CROSSED],
        )
        torque += muscle_torque(c[m + M_ARM], arm, force)
        at = O_MUSCLES + i * N_MUSCLE_OUTPUTS
        output[at + O_PRESSURE] = gauge
        output[at + O_VALVE_PRESSURE] = gauge
        if c[m + M_TUBE] > 0.0:
            output[at + O_VALVE_PRESSURE] = y[o + S_VALVE_PRESSURE] - c[C_AMBIENT]
        output[at + O_FORCE] = force
        output[at + O_LENGTH] = length
        output[at + O_SPOOL] = y[o + S_SPOOL]
        output[at + O_TEMPERATURE] = y[o + S_TEMPERATURE]
    output[O_POSITION] = position
    output[O_VELOCITY] = y[Y_VELOCITY]
    output[O_TORQUE] = torque
    output[O_RESERVOIR] = y[Y_RESERVOIR]


@compiled
def move(c: Any, tables: Any, y: Any, dy: Any, moved: Any, step: float) -> None:
    """Write the state after a step with constant rates; only states that change are written."""
    moved[Y_POSITION] = y[Y_POSITION] + step * dy[Y_POSITION]
    moved[Y_VELOCITY] = y[Y_VELOCITY] + step * dy[Y_VELOCITY]
    if c[C_PRESLIDING] > 0.0:
        moved[Y_BRISTLE] = y[Y_BRISTLE] + step * dy[Y_BRISTLE]
    if c[C_DROOP] > 0.0:
        moved[Y_RESERVOIR] = y[Y_RESERVOIR] + step * dy[Y_RESERVOIR]
    for i in range(len(tables)):
        m = C_MUSCLES + i * N_MUSCLE_CONSTANTS
        o = Y_MUSCLES + i * N_MUSCLE_STATES
        moved[o + S_SPOOL] = y[o + S_SPOOL] + step * dy[o + S_SPOOL]
        moved[o + S_PRESSURE] = y[o + S_PRESSURE] + step * dy[o + S_PRESSURE]
        if c[m + M_TUBE] > 0.0:
            at_valve = y[o + S_VALVE_PRESSURE] + step * dy[o + S_VALVE_PRESSURE]
            moved[o + S_VALVE_PRESSURE] = at_valve
        if c[m + M_THERMAL] > 0.0:
            moved[o + S_TEMPERATURE] = y[o + S_TEMPERATURE] + step * dy[o + S_TEMPERATURE]
        memory_move(m, c, y, dy, moved, o, step)


@compiled
def finish(c: Any, tables: Any, y: Any, k1: Any, k2: Any, k3: Any, k4: Any, step: float) -> None:
    """Advance the states that change by a Runge-Kutta step, from its four rates."""
    state_step(Y_POSITION, y, k1, k2, k3, k4, step)
    state_step(Y_VELOCITY, y, k1, k2, k3, k4, step)
    if c[C_PRESLIDING] > 0.0:
        state_step(Y_BRISTLE, y, k1, k2, k3, k4, step)
    if c[C_DROOP] > 0.0:
        state_step(Y_RESERVOIR, y, k1, k2, k3, k4, step)
    for i in range(len(tables)):
        m = C_MUSCLES + i * N_MUSCLE_CONSTANTS
        o = Y_MUSCLES + i * N_MUSCLE_STATES
        state_step(o + S_SPOOL, y, k1, k2, k3, k4, step)
        state_step(o + S_PRESSURE, y, k1, k2, k3, k4, step)
        if c[m + M_TUBE] > 0.0:
            state_step(o + S_VALVE_PRESSURE, y, k1, k2, k3, k4, step)
        if c[m + M_THERMAL] > 0.0:
            state_step(o + S_TEMPERATURE, y, k1, k2, k3, k4, step)
        memory_step(m, c, y, k1, k2, k3, k4, o, step)


@compiled
def state_step(at: int, y: Any, k1: Any, k2: Any, k3: Any, k4: Any, step: float) -> None:
    """Advance one state by a Runge-Kutta step."""
    y[at] += step / 6.0 * (k1[at] + 2.0 * (k2[at] + k3[at]) + k4[at])


@compiled
def rk4_step(
    c: Any,
    tables: Any,
    y: Any,
    work: Any,
    held: Any,
    contact: float,
    position_given: bool,
    pressure_given: bool,
    shut: bool,
    h: float,
) -> None:
    """Advance `y` by one classical Runge-Kutta step of `h` [s].

    The row of `work` for states within the step has those that do not change from the beginning.
    """
    free = contact != LOCKED
    sliding = contact if free else 0.0
    k1, k2, k3, k4, ys, drive = work[0], work[1], work[2], work[3], work[4], work[5]
    given = (position_given, pressure_given)
    joint_rates(c, tables, y, k1, held, drive, sliding, free, given, shut, h)
    move(c, tables, y, k1, ys, 0.5 * h)
    joint_rates(c, tables, ys, k2, held, drive, sliding, free, given, shut, h)
    move(c, tables, y, k2, ys, 0.5 * h)
    joint_rates(c, tables, ys, k3, held, drive, sliding, free, given, shut, h)
    move(c, tables, y, k3, ys, h)
    joint_rates(c, tables, ys, k4, held, drive, sliding, free, given, shut, h)
    finish(c, tables, y, k1, k2, k3, k4, h)


@compiled
def moving_contact(c: Any, y: Any) -> float:
    """Contact of a moving joint; AT_REST if the torque of its muscles decides."""
    has_friction = c[C_PRESLIDING] <= 0.0 and c[C_FRICTION] > 0.0
    speed = y[Y_VELOCITY]
    if speed != 0.0:
        sign = 1.0 if speed > 0.0 else -1.0
        return sign if has_friction else 0.0
    at_stop = y[Y_POSITION] <= c[C_LOWER] or y[Y_POSITION] >= c[C_UPPER]
    return AT_REST if has_friction or at_stop else 0.0


@compiled
def contact_of(
    c: Any,
    tables: Any,
    y: Any,
    work: Any,
    held: Any,
    pressure_given: bool,
    shut: bool,
    h: float,
) -> float:
    """Contact of the joint in a step: LOCKED, the sign of motion that friction opposes, or 0."""
    contact = moving_contact(c, y)
    if contact != AT_REST:
        return contact
    given = (False, pressure_given)
    torque = joint_rates(c, tables, y, work[0], held, work[5], 0.0, True, given, shut, h)
    return contact_at_rest(c, y, torque)


@compiled
def contact_at_rest(c: Any, y: Any, torque: float) -> float:
    """Contact of a joint at rest under the `torque` of its muscles [N m]."""
    has_friction = c[C_PRESLIDING] <= 0.0 and c[C_FRICTION] > 0.0
    at_lower = y[Y_POSITION] <= c[C_LOWER]
    at_upper = y[Y_POSITION] >= c[C_UPPER]
    torque += c[C_EXTERNAL] - c[C_GRAVITY] * sine(y[Y_POSITION] - c[C_GRAVITY_ANGLE])
    torque += joint_torque(c, y[Y_POSITION], 0.0)
    if has_friction and abs(torque) <= dry_friction(c, 0.0):
        return LOCKED
    if (torque > 0.0 and at_upper) or (torque <= 0.0 and at_lower):
        return LOCKED
    if not has_friction:
        return 0.0
    return 1.0 if torque > 0.0 else -1.0


@compiled
def settle_contact(c: Any, y: Any, contact: float, before: float, step: float) -> None:
    """Correct the state after a step: friction cannot drive a joint, end stops are inelastic.

    `before` is the speed at the start of the step [rad/s]. From the time at which the speed is 0,
    friction may have acted the other way round. If that is too little to hold the joint, it passes.
    """
    position, speed = y[Y_POSITION], y[Y_VELOCITY]
    if contact * speed < 0.0:
        late = speed / (speed - before) * step
        gained = 2.0 * dry_friction(c, 0.0) * late * c[C_PER_INERTIA]
        speed = contact * min(contact * speed + gained, 0.0)
    if position >= c[C_UPPER]:
        speed = min(speed, 0.0)
    elif position <= c[C_LOWER]:
        speed = max(speed, 0.0)
    y[Y_POSITION] = min(max(position, c[C_LOWER]), c[C_UPPER])
    y[Y_VELOCITY] = speed


@compiled
def take_sample(
    c: Any, y: Any, drive: Any, positions: Any, pressures: Any, k: int, sample_time: float
) -> None:
    """Set prescribed signals to sample `k`, and `drive` to their rates until the next sample."""
    if len(positions) > 0:
        following = min(k + 1, len(positions) - 1)
        y[Y_POSITION] = positions[k]
        drive[0] = (positions[following] - positions[k]) / sample_time
        y[Y_VELOCITY] = drive[0]
    if len(pressures) > 0:
        following = min(k + 1, len(pressures) - 1)
        for i in range(len(pressures[k])):
            o = Y_MUSCLES + i * N_MUSCLE_STATES
            sensed = S_PRESSURE
            if c[C_MUSCLES + i * N_MUSCLE_CONSTANTS + M_TUBE] > 0.0:
                sensed = S_VALVE_PRESSURE
            y[o + sensed] = max(pressures[k][i] + c[C_AMBIENT], LOWEST_PRESSURE)
            drive[1 + i] = (pressures[following][i] - pressures[k][i]) / sample_time


@fused_entry_point
def run(
    c: Any,
    tables: Any,
    commands: Any,
    first: int,
    positions: Any,
    pressures: Any,
    shut: bool,
    sample_time: float,
    step: float,
    y: Any,
    work: Any,
    outputs: Any,
) -> None:
    """Simulate one joint: row k of `outputs` is the state when command row `first + k` begins.

    If `positions` and `pressures` are not empty, they prescribe the motion [rad] and the gauge
    pressures at the sensors [Pa] at the same samples, with linear interpolation. `y` holds the
    state; after the call it is that at the end of the last sample. `work` is scratch memory:
    WORK_ROWS rows of the size of the state. `tables` has a force table for each muscle, and so
    gives the number of muscles; `commands` and `pressures` have a column for each.
    """
    position_given = len(positions) > 0
    pressure_given = len(pressures) > 0
    steps = step_count(c[C_RATE], sample_time, step)
    h = sample_time / steps
    contact, before = 0.0, 0.0
    held = work[6]
    for i in range(1 + len(tables)):
        work[5][i] = 0.0
    for i in range(len(y)):  # the states that do not change are never written again
        work[4][i] = y[i]
    for k in range(len(outputs)):
        take_sample(c, y, work[5], positions, pressures, k, sample_time)
        record(c, tables, y, outputs[k])
        for j in range(steps):
            now = (first + k) * sample_time + j * h
            for i in range(len(tables)):
                delay = c[C_MUSCLES + i * N_MUSCLE_CONSTANTS + M_DELAY]
                if delay > 0.0 or j == 0:
                    held[i] = held_command(commands, i, now, h, sample_time, delay)
            if not position_given:
                before = y[Y_VELOCITY]
                contact = contact_of(c, tables, y, work, held, pressure_given, shut, h)
            rk4_step(c, tables, y, work, held, contact, position_given, pressure_given, shut, h)
            for i in range(len(tables)):
                o = Y_MUSCLES + i * N_MUSCLE_STATES
                y[o + S_PRESSURE] = max(y[o + S_PRESSURE], LOWEST_PRESSURE)
            if not position_given:
                settle_contact(c, y, contact, before, h)
