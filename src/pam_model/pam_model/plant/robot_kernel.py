"""Time integration of all joints of a robot, with the tree of links that couples them.

As in kernel.py: classical RK4 with held commands, and contacts that are decided once per step. A
joint that stands still is held by dry friction or an end stop if the torque that this needs can be
found for all joints together (pam_model.body.contact). A joint whose speed would change its sign is
stopped by the friction that the rest of the step leaves; an end stop is inelastic. Both are
impulses, which move the other joints as well. All valves draw from one reservoir.

What the rig file states of a joint alone, its inertia and its gravity torque, is added to the
links. Without links, the joints do not move each other, unless a muscle crosses several of them.

Constants, states and outputs have one row per joint, in the order of layout.py; a joint with fewer
muscles than another uses the first part of its row. The pressure of the reservoir is in each row.

A muscle belongs to one joint and may cross others. A crossing is a row (joint, muscle of this
joint, other joint, signed lever arm at the other joint [m]).
"""

from __future__ import annotations

from typing import Any, Final

from pam_model.body.contact import AT_HIGH, AT_LOW, FREE, HELD, settle_contacts, solve_moving
from pam_model.body.hinge_tree import mass_and_bias
from pam_model.physics.sine import sine
from pam_model.plant.compiled import compiled, compiled_loop, fused_entry_point
from pam_model.plant.composition import dry_friction
from pam_model.plant.joint_stage import hinge_torques, reservoir_rate
from pam_model.plant.kernel import (
    LOWEST_PRESSURE,
    held_command,
    muscle_pull,
    record,
    step_count,
)
from pam_model.plant.layout import (
    C_DROOP,
    C_DROOP_CONDUCTANCE,
    C_DROOP_VOLUME,
    C_FRICTION,
    C_GRAVITY,
    C_GRAVITY_ANGLE,
    C_LOWER,
    C_MUSCLES,
    C_PRESLIDING,
    C_RATE,
    C_UPPER,
    M_CROSSED,
    M_CROSSED_SPEED,
    M_DELAY,
    N_MUSCLE_CONSTANTS,
    N_MUSCLE_STATES,
    S_PRESSURE,
    Y_MUSCLES,
    Y_POSITION,
    Y_RESERVOIR,
    Y_VELOCITY,
)

# Rows of the scratch memory that have one number per joint.
(_ANGLES, _SPEEDS, _BIAS, _TOTAL, _ACCELERATION, _LOW, _HIGH, _STATE, _GIVEN, _EFFORT, _BEFORE,
 _SLIDING, _LATE) = range(13)  # fmt: skip
N_ROWS: Final = 13
UNBOUNDED: Final = 1e300
TINY: Final = 1e-300


@compiled
def is_stuck_by_friction(c: Any) -> bool:
    """Whether dry friction without presliding acts on a joint."""
    return bool(c[C_PRESLIDING] <= 0.0 and c[C_FRICTION] > 0.0)


@compiled
def route_crossings(c: Any, crossings: Any, y: Any, contacts: Any) -> None:
    """Write what the other joints add to the paths of the muscles that cross them."""
    for k in range(len(crossings)):
        m = C_MUSCLES + int(crossings[k][1]) * N_MUSCLE_CONSTANTS
        c[int(crossings[k][0])][m + M_CROSSED] = 0.0
        c[int(crossings[k][0])][m + M_CROSSED_SPEED] = 0.0
    for k in range(len(crossings)):
        i, other = int(crossings[k][0]), int(crossings[k][2])
        m = C_MUSCLES + int(crossings[k][1]) * N_MUSCLE_CONSTANTS
        c[i][m + M_CROSSED] -= crossings[k][3] * y[other][Y_POSITION]
        if contacts[other] != HELD:
            c[i][m + M_CROSSED_SPEED] -= crossings[k][3] * y[other][Y_VELOCITY]


@compiled_loop
def robot_rates(
    c: Any,
    tables: Any,
    topology: Any,
    body: Any,
    y: Any,
    dy: Any,
    held: Any,
    drive: Any,
    work: Any,
    step: float,
) -> None:
    """Write the rates of all states; work[_STATE] and work[_SLIDING] hold the contacts."""
    links, gravity, inertia, scratch, mass, factor = body
    first, crossings = topology
    n = len(c)
    route_crossings(c, crossings, y, work[_STATE])
    drawn = 0.0
    conductance = 0.0
    volume = 0.0
    for i in range(n):
        work[_ANGLES][i] = y[i][Y_POSITION]
        work[_SPEEDS][i] = y[i][Y_VELOCITY]
        own, beyond = first[i], first[i + 1]
        _, total, flow = hinge_torques(
            c[i], tables[own:beyond], y[i], dy[i], held[own:beyond], drive, work[_SLIDING][i],
            work[_STATE][i] != HELD, (False, False), False, step,
        )  # fmt: skip
        work[_TOTAL][i] = total
        drawn += flow
        conductance += c[i][C_DROOP_CONDUCTANCE]
        volume += c[i][C_DROOP_VOLUME]
    for k in range(len(crossings)):
        i, muscle, other = int(crossings[k][0]), int(crossings[k][1]), int(crossings[k][2])
        force = muscle_pull(muscle, c[i], tables[first[i] : first[i + 1]], y[i])
        work[_TOTAL][other] += crossings[k][3] * force
    for i in range(n):
        work[_BIAS][i] = 0.0
        for j in range(n):
            mass[i][j] = 0.0
    if len(links) > 0:
        mass_and_bias(links, gravity, work[_ANGLES], work[_SPEEDS], scratch, mass, work[_BIAS])
    for i in range(n):
        falling = c[i][C_GRAVITY] * sine(y[i][Y_POSITION] - c[i][C_GRAVITY_ANGLE])
        work[_TOTAL][i] -= falling + work[_BIAS][i]
        mass[i][i] += inertia[i]
    solve_moving(mass, work[_STATE], work[_TOTAL], factor, work[_ACCELERATION])
    rate = 0.0
    if c[0][C_DROOP] > 0.0:
        rate = reservoir_rate(c[0], conductance, volume, y[0][Y_RESERVOIR], drawn)
    for i in range(n):
        dy[i][Y_VELOCITY] = work[_ACCELERATION][i]
        dy[i][Y_RESERVOIR] = rate


@compiled_loop
def judge_contacts(
    c: Any, tables: Any, topology: Any, body: Any, y: Any, dy: Any, held: Any, drive: Any,
    work: Any, step: float,
) -> None:  # fmt: skip
    """Decide which joints are held in this step, and in which direction friction acts."""
    _, _, _, _, mass, factor = body
    n = len(c)
    any_at_rest = False
    for i in range(n):
        speed = y[i][Y_VELOCITY]
        rubs = is_stuck_by_friction(c[i])
        work[_STATE][i] = FREE
        work[_LOW][i], work[_HIGH][i] = 0.0, 0.0
        work[_SLIDING][i] = 0.0
        if speed != 0.0:
            if rubs:
                work[_SLIDING][i] = 1.0 if speed > 0.0 else -1.0
        elif rubs or y[i][Y_POSITION] <= c[i][C_LOWER] or y[i][Y_POSITION] >= c[i][C_UPPER]:
            grip = dry_friction(c[i], 0.0) if rubs else 0.0
            work[_STATE][i] = HELD
            work[_LOW][i] = -UNBOUNDED if y[i][Y_POSITION] >= c[i][C_UPPER] else -grip
            work[_HIGH][i] = UNBOUNDED if y[i][Y_POSITION] <= c[i][C_LOWER] else grip
            any_at_rest = True
    if not any_at_rest:
        return
    robot_rates(c, tables, topology, body, y, dy, held, drive, work, step)
    settle_contacts(
        mass, work[_TOTAL], work[_LOW], work[_HIGH], work[_STATE], factor, work[_GIVEN],
        work[_ACCELERATION], work[_EFFORT],
    )  # fmt: skip
    for i in range(n):
        if work[_STATE][i] == AT_LOW or work[_STATE][i] == AT_HIGH:
            if is_stuck_by_friction(c[i]):
                work[_SLIDING][i] = float(work[_STATE][i])
            work[_STATE][i] = FREE


@compiled
def apply_impulses(y: Any, body: Any, work: Any) -> None:
    """Change all speeds by impulses within the bounds in work[_LOW] and work[_HIGH] [N m s]."""
    _, _, _, _, mass, factor = body
    n = len(y)
    for i in range(n):
        work[_TOTAL][i] = 0.0
        for j in range(n):
            work[_TOTAL][i] += mass[i][j] * y[j][Y_VELOCITY]
    settle_contacts(
        mass, work[_TOTAL], work[_LOW], work[_HIGH], work[_STATE], factor, work[_GIVEN],
        work[_SPEEDS], work[_EFFORT],
    )  # fmt: skip
    for i in range(n):
        y[i][Y_VELOCITY] = work[_SPEEDS][i]


@compiled_loop
def settle_robot(c: Any, body: Any, y: Any, work: Any, step: float) -> None:
    """Correct the state after a step: friction cannot drive a joint, and end stops take its speed.

    The mass matrix is that of the last stage of the step.
    """
    n = len(c)
    longest = 0.0
    for i in range(n):
        speed = y[i][Y_VELOCITY]
        late = 0.0
        if work[_SLIDING][i] * speed < 0.0:
            # From the time at which the speed is 0, friction may have acted the other way round.
            late = speed / (speed - work[_BEFORE][i]) * step
        work[_LATE][i] = late
        longest = max(longest, late)
    for i in range(n):
        if work[_STATE][i] == HELD:
            # A held joint may be held by another torque from then on.
            work[_LOW][i] = (work[_LOW][i] - work[_EFFORT][i]) * longest
            work[_HIGH][i] = (work[_HIGH][i] - work[_EFFORT][i]) * longest
        else:
            turned = 2.0 * dry_friction(c[i], 0.0) * work[_LATE][i]
            work[_LOW][i] = -turned if work[_SLIDING][i] < 0.0 else 0.0
            work[_HIGH][i] = turned if work[_SLIDING][i] > 0.0 else 0.0
            work[_STATE][i] = HELD if turned > 0.0 else FREE
    if longest > 0.0:
        apply_impulses(y, body, work)
    longest = 0.0
    for i in range(n):
        position, speed = y[i][Y_POSITION], y[i][Y_VELOCITY]
        at_upper, at_lower = position >= c[i][C_UPPER], position <= c[i][C_LOWER]
        work[_LOW][i] = -UNBOUNDED if at_upper else 0.0
        work[_HIGH][i] = UNBOUNDED if at_lower else 0.0
        work[_STATE][i] = HELD if at_upper or at_lower else FREE
        work[_BEFORE][i] = speed
        if (at_upper and speed > 0.0) or (at_lower and speed < 0.0):
            past = (position - (c[i][C_UPPER] if at_upper else c[i][C_LOWER])) / speed
            longest = max(longest, min(past, step), TINY)
    if longest > 0.0:
        apply_impulses(y, body, work)
        for i in range(n):  # as the impulse was at the time of the hit
            y[i][Y_POSITION] += (y[i][Y_VELOCITY] - work[_BEFORE][i]) * longest
            if work[_STATE][i] == HELD:
                y[i][Y_POSITION] = c[i][C_UPPER] if work[_LOW][i] < 0.0 else c[i][C_LOWER]
    for i in range(n):
        y[i][Y_POSITION] = min(max(y[i][Y_POSITION], c[i][C_LOWER]), c[i][C_UPPER])


@compiled_loop
def advance_robot(
    c: Any, tables: Any, topology: Any, body: Any, y: Any, ks: Any, ys: Any, held: Any, drive: Any,
    work: Any, h: float,
) -> None:  # fmt: skip
    """Advance the state by one step of `h` [s]."""
    n, n_states = len(c), len(y[0])
    first, _ = topology
    judge_contacts(c, tables, topology, body, y, ks[0], held, drive, work, h)
    for i in range(n):
        work[_BEFORE][i] = y[i][Y_VELOCITY]
        for k in range(n_states):
            ys[i][k] = y[i][k]
    for stage in range(4):
        if stage > 0:
            part = h if stage == 3 else 0.5 * h
            for i in range(n):
                for k in range(n_states):
                    ys[i][k] = y[i][k] + part * ks[stage - 1][i][k]
        robot_rates(c, tables, topology, body, ys, ks[stage], held, drive, work, h)
    for i in range(n):
        for k in range(n_states):
            middle = 2.0 * (ks[1][i][k] + ks[2][i][k])
            y[i][k] += h / 6.0 * (ks[0][i][k] + middle + ks[3][i][k])
        for muscle in range(first[i + 1] - first[i]):
            o = Y_MUSCLES + muscle * N_MUSCLE_STATES
            y[i][o + S_PRESSURE] = max(y[i][o + S_PRESSURE], LOWEST_PRESSURE)
    settle_robot(c, body, y, work, h)


@fused_entry_point
def run_robot(
    c: Any,
    tables: Any,
    topology: Any,
    body: Any,
    commands: Any,
    first: int,
    sample_time: float,
    step: float,
    y: Any,
    ks: Any,
    ys: Any,
    held: Any,
    drive: Any,
    work: Any,
    outputs: Any,
) -> None:
    """Simulate a robot: outputs[k, i] is joint i when command row `first + k` begins.

    Parameters
    ----------
    c : (n, n_constants) array
        Of each joint; the reservoir is the sum of the joints' shares.
    tables : (m, rows, columns) array
        Force tables of all muscles, in the order of their joints.
    topology : tuple of arrays
        Number of the first muscle of each joint, and m, (n + 1,); all crossings, (n_crossings, 4).
    body : tuple of arrays
        Links, gravity, each joint's own inertia, and scratch memory for the tree, its mass matrix
        and the factor of this.
    commands : (n_samples, m) array
        Per muscle; row k holds from k sample times to k + 1.
    first : int
        Row with which the simulation begins; the ones before it serve valves with a delay.
    sample_time, step : float
        Sample time and longest integration step [s].
    y : (n, n_states) array
        The state, before and after.
    ks, ys, held, drive, work : arrays
        Scratch memory: (4, n, n_states), (n, n_states), (m,), zeros for each muscle of a joint
        and one, (N_ROWS, n).
    outputs : (n_samples, n, n_outputs) array
        In the order of layout.output_names.
    """
    n = len(c)
    muscles, crossings = topology
    fastest = 0.0
    for i in range(n):
        fastest = max(fastest, c[i][C_RATE])
    steps = step_count(fastest, sample_time, step)
    h = sample_time / steps
    for k in range(len(outputs)):
        route_crossings(c, crossings, y, work[_STATE])
        for i in range(n):
            record(c[i], tables[muscles[i] : muscles[i + 1]], y[i], outputs[k][i])
        for j in range(steps):
            now = (first + k) * sample_time + j * h
            for i in range(n):
                for at in range(muscles[i], muscles[i + 1]):
                    m = C_MUSCLES + (at - muscles[i]) * N_MUSCLE_CONSTANTS
                    delay = c[i][m + M_DELAY]
                    held[at] = held_command(commands, at, now, h, sample_time, delay)
            advance_robot(c, tables, topology, body, y, ks, ys, held, drive, work, h)
    route_crossings(c, crossings, y, work[_STATE])
