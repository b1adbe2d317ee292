"""The torque that a joint needs beside that of its model, learnt while it moves.

The measured pressures give the torque of the muscles. What the model does not explain of it is
fitted by functions of the measured motion (`motion_functions`). The fitted weights times the same
functions of the REFERENCE are added to the feedforward. So what was learnt acts without the delay
of a feedback, and does not change the stability margins of the loop: the weights follow an average
over seconds.

Both sides of the fit pass the same two filters, so that no acceleration is measured: with the
filter 1/(T s + 1), the filtered acceleration is (v - filtered v)/T. Two filters, because noise of
the acceleration would make the fit too small (errors in the variables), and because what it leaves
is so small then that a delay can be told from friction.

If the position is late by d compared with the pressures, the torque of the muscles at the measured
position seems to be early: d times its rate at a fixed position is left over. It resembles friction
so much that only a rival explanation can have it (`averaged_fit`). The controller compares a late
position with the reference of that earlier time, and late pressures with the plan of theirs.

Errors of sensors, and muscles that are stronger or weaker than written, are ordinary as well. They
seem to be torques that grow with the pressures, for which functions of the motion alone are no
substitute: while a joint is taken over and its muscles are stiffened, they would be taken for
viscous friction or inertia, and act in the first stroke. So every explanation without dry friction
has them; beside it, they would share a constant torque with it in a motion that was learnt before.
A false zero of the position seems to be a torque of the zero times k + dg/dq, the stiffness of the
muscles and the slope of the weight. A pressure that is shown too large by a share s seems to be s
times the torque of that muscle. This is s/2 times the torque of all muscles, which is the torque of
the motion, and so among the functions; and s/2 times the sum of the muscles' torques without their
signs, their grip.

Nothing is learnt from a joint that stands still, because its friction may then be anything, and
what a slow joint shows counts by the way, not by the time. The exception is where it stood when it
was taken over: the torque that it needed there counts as one sample without friction. It tells a
torque that is always there from friction, which is there only in motion; one stroke in one
direction could not. Dry friction and presliding are
ordinary: an explanation with them is the more probable one before anything was seen. Neither dry
friction nor the whole viscous friction is negative.

Source: J.-J. E. Slotine and W. Li, Applied Nonlinear Control, Prentice Hall 1991, section 8.7
(filtered regression without acceleration) and 9.2 (adaptive feedforward of a robot). The function
of the delay is derived here.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.adaptation.averaged_fit import (
    FITTED,
    WEIGHTS,
    AveragedFit,
    Rival,
    certainty_of,
    take_rival_sample,
)
from pam_control.adaptation.motion_functions import (
    DEVIATIONS,
    N_ELEMENTS,
    SLIP_LENGTHS,
    begin_memory,
    element,
    move_memory,
)
from pam_control.adaptation.normal_equations import CORRELATED
from pam_control.limited import limited
from pam_control.rows.plan_rows import (
    A_BEFORE,
    A_BEGUN,
    A_DELAY,
    A_FRICTION,
    A_KNOWS,
    A_MEASURED,
    A_ONCE,
    A_PLANNED,
    A_RAW,
    A_REST,
    A_SINCE,
    A_SMOOTH,
    A_SPEED_BEFORE,
    A_SPEED_ONCE,
    A_SPEED_TWICE,
    A_STOOD,
    A_TAKEN_OVER,
    A_TWICE,
    A_WAITS,
    A_WANTED_DELAY,
    A_WEIGHTS,
    N_FUNCTIONS,
    N_SAMPLE,
    Y_GRIP,
    Y_PLANNED_AT,
    Y_REFERENCE,
    Y_ZERO,
)
from pam_model.plant.compiled import entry_point, prepare

FILTER: Final = 0.03  # s, T
EVERY: Final = 0.01  # s between two updates of the fit
NOISE: Final = 1.5e-4  # of the largest torque; a rig that matches its file leaves two thirds of it
ERRORS: Final = 2.5e-4  # of the largest torque: what a fit leaves that has seen little
TRIFLE: Final = 1e-3  # of the largest torque; less is left to the feedback
SLOW: Final = 0.1  # rad/s; below it a sample counts by the way, not by the time
VISCOUS: Final = 3  # index of the speed
N_POWERS: Final = 4  # the unexplained torque, and the functions before the speed
STILL: Final = 0.02  # rad/s
DELAY_DEVIATION: Final = 0.01  # s
ZERO_DEVIATION: Final = 0.05  # rad, of an encoder that was put on by eye
GRIP_DEVIATION: Final = 0.05  # of the strengths of the muscles by the gains of their sensors
LEAST_DELAY: Final = 2e-3  # s; smaller ones are not believed
LONGEST_DELAY: Final = 0.04  # s
DELAY_RATE: Final = 0.06  # s/s, at which the reference is moved to a delay that was found
SLIPS: Final = tuple(range(5, 5 + len(SLIP_LENGTHS)))
DELAY: Final = 7 + len(SLIP_LENGTHS)
ZERO: Final = DELAY + 1
GRIP: Final = ZERO + 1
SMOOTH: Final = (0, 1, 2, 3, 4, 5 + len(SLIP_LENGTHS), 6 + len(SLIP_LENGTHS))
SENSORS: Final = (ZERO, GRIP)
RIVALS: Final = (
    Rival((*SMOOTH, *SENSORS), 0.0),
    Rival((*SMOOTH, *SLIPS), 2.0, exact=False),
    Rival((*SMOOTH, *SENSORS, DELAY), 0.0, better=1.7),
    Rival((*SMOOTH, *SLIPS, DELAY), 0.0, better=4.0, exact=False),
)
"""By the numbers of the functions of `motion_functions`, after which come the delay, the zero of
the position and the grip. Dry friction is ordinary. A delay has to explain what nothing else does;
a delay beside friction even more. Slip elements only resemble friction."""
DRY: Final = 0.02  # rad; longer slip elements are hysteresis, by which a joint does not stick


def take_torque(
    row: Any, step: float, unexplained: float, rate: float, position: float, speed: float,
    speed_filter: float, zero: float, grip: float,
) -> bool:  # fmt: skip
    """Take one control cycle of a joint; return whether the fit is due.

    Parameters
    ----------
    row : row
        What is learnt of the joint (`plan_rows`).
    step : float
        Time since the last sample [s]; 0 if there is no new one.
    unexplained : float
        Torque of the muscles without that of the model; inertia and damping are not yet
        subtracted [N m].
    rate : float
        Of the torque of the muscles at a fixed position [N m/s].
    position, speed : float
        Measured [rad], [rad/s]; the speed has passed a filter.
    speed_filter : float
        Time constant of that filter [s].
    zero, grip : float
        What a false zero of the position acts with [N m/rad], and the grip [N m].
    """
    if step <= 0.0:
        return False
    move_memory(row, A_MEASURED, position, step)
    first = row[A_BEGUN] == 0.0
    if first:
        row[A_BEGUN] = 1.0
        row[A_SPEED_ONCE] = row[A_SPEED_TWICE] = speed
    own, weight = step / (speed_filter + step), step / (FILTER + step)
    for place in range(N_SAMPLE):
        if place == 0:
            raw = unexplained
        elif place < 4:
            raw = 1.0 if place == 1 else position if place == 2 else position**3
        elif place < 4 + N_ELEMENTS:
            raw = element(row, A_MEASURED, place - 4)
        elif place == 4 + N_ELEMENTS:
            raw = rate
        elif place == 5 + N_ELEMENTS:
            raw = zero
        else:
            raw = grip
        if first:
            row[A_RAW + place] = row[A_SMOOTH + place] = raw
            row[A_ONCE + place] = row[A_TWICE + place] = raw
        # a measured speed is the mean over a period: the others are taken in its middle as well
        smooth = row[A_SMOOTH + place]
        smooth += own * (0.5 * (raw + row[A_RAW + place]) - smooth)
        row[A_SMOOTH + place], row[A_RAW + place] = smooth, raw
        once = row[A_ONCE + place]
        once += weight * (smooth - once)
        row[A_ONCE + place] = once
        before = row[A_TWICE + place]
        row[A_BEFORE + place] = before
        row[A_TWICE + place] = before + weight * (once - before)
    row[A_SPEED_ONCE] += weight * (speed - row[A_SPEED_ONCE])
    row[A_SPEED_BEFORE] = row[A_SPEED_TWICE]
    row[A_SPEED_TWICE] += weight * (row[A_SPEED_ONCE] - row[A_SPEED_BEFORE])
    row[A_SINCE] += step
    reach = DELAY_RATE * step
    row[A_DELAY] += limited(row[A_WANTED_DELAY] - row[A_DELAY], -reach, reach)
    return bool(row[A_SINCE] >= EVERY)


def weighted(
    y: Any, row: Any, position: float, velocity: float, acceleration: float, rests: bool
) -> float:
    """Torque [N m] by what was learnt, for a joint that moves as planned or begins at rest."""
    w = A_WEIGHTS
    found = row[w] + row[w + 1] * position + row[w + 2] * position**3
    found += row[w + ZERO] * y[Y_ZERO] + row[w + GRIP] * y[Y_GRIP]
    found += row[w + 3] * velocity + row[w + 4] * acceleration
    if not rests:
        for number in range(N_ELEMENTS):
            found += row[w + 5 + number] * element(row, A_PLANNED, number)
    return float(found)


def move_reference(y: Any, row: Any, time: float, position: float) -> None:
    """Let the reference be at a position [rad] at a time [s]."""
    step = 0.0 if math.isnan(y[Y_PLANNED_AT]) else max(time - y[Y_PLANNED_AT], 0.0)
    y[Y_PLANNED_AT], y[Y_REFERENCE] = time, position
    move_memory(row, A_PLANNED, position, step)


def learnt_torque(y: Any, row: Any, moment: Any, at: int, limit: float) -> float:
    """Torque [N m] to be added for the moment of the reference in a row, within a limit [N m]."""
    found = weighted(y, row, moment[at + 1], moment[at + 2], moment[at + 3], False)
    return limited(found, -limit, limit)


def sample(row: Any, inertia: float, damping: float, functions: Any) -> tuple[float, float]:
    """Write the functions' values; return the torque that they should explain [N m], and speed."""
    # the difference below is the acceleration half a period ago
    push = (row[A_SPEED_ONCE] - row[A_SPEED_TWICE]) / FILTER
    speed = 0.5 * (row[A_SPEED_BEFORE] + row[A_SPEED_TWICE])
    for i in range(1, N_SAMPLE):
        # speed and acceleration come behind the third one
        place = i - 1 if i < N_POWERS else i + 1
        functions[place] = 0.5 * (row[A_BEFORE + i] + row[A_TWICE + i])
    functions[VISCOUS], functions[VISCOUS + 1] = speed, push
    value = 0.5 * (row[A_BEFORE] + row[A_TWICE])
    return value - (damping * speed + inertia * push), speed


def use_fit(row: Any, rows: Any, rivals: Any, has: Any) -> None:
    """Let the control cycle use what the fit has found."""
    weights, knows, dry = rows[WEIGHTS], 0.0, 0.0
    for i in range(N_FUNCTIONS):
        row[A_WEIGHTS + i] = weights[i]
        if weights[i] != 0.0:
            knows = 1.0
    for number in range(len(SLIP_LENGTHS)):
        if SLIP_LENGTHS[number] < DRY:
            dry += weights[SLIPS[number]]
    row[A_KNOWS], row[A_FRICTION] = knows, dry
    # a wrong delay is an error of the position itself: the median of what is believed
    likely, wanted = certainty_of(rivals, has, DELAY), 0.0
    if likely > 0.5:
        wanted = limited(rows[FITTED][DELAY] / likely, -LONGEST_DELAY, LONGEST_DELAY)
    row[A_WANTED_DELAY] = wanted if abs(wanted) >= LEAST_DELAY else 0.0


@entry_point
def learn_torque(
    inertia: float, damping: float, y: Any, row: Any, given: Any, state: Any, rows: Any,
    products: Any, rivals: Any, has: Any, penalties: Any, held: Any, solutions: Any, scratch: Any,
    functions: Any,
) -> None:  # fmt: skip
    """Learn from the filtered samples of a joint.

    Parameters
    ----------
    inertia, damping : float
        Of the model [kg m^2], [N m s/rad].
    y, row : rows
        State of the plan, and of what is learnt.
    given, state, rows, products, rivals, has, penalties, held, solutions, scratch, functions : rows
        Of the fit.
    """
    stands, since = abs(row[A_SPEED_TWICE]) <= STILL, row[A_SINCE]
    row[A_SINCE] = 0.0
    if stands and row[A_WAITS] == 0.0:
        return
    # a joint that was taken over shows what it needs at rest, once its reference moves
    if row[A_WAITS] > 0.0:
        if math.isnan(row[A_TAKEN_OVER]):
            row[A_TAKEN_OVER] = y[Y_REFERENCE]
        if y[Y_REFERENCE] != row[A_TAKEN_OVER]:
            row[A_WAITS] = 0.0
            if row[A_STOOD] > 0.0:
                for i in range(N_FUNCTIONS):
                    functions[i] = row[A_REST + i]
                take_rival_sample(
                    row[A_REST + N_FUNCTIONS], CORRELATED, given, state, rows, products, rivals,
                    has, penalties, held, solutions, scratch, functions,
                )  # fmt: skip
        elif stands:
            value, _ = sample(row, inertia, damping, functions)
            for i in range(N_FUNCTIONS):
                row[A_REST + i] = functions[i]
            row[A_REST + N_FUNCTIONS], row[A_STOOD] = value, 1.0
    if not stands:
        value, speed = sample(row, inertia, damping, functions)
        take_rival_sample(
            value, since * min(abs(speed) / SLOW, 1.0), given, state, rows, products, rivals, has,
            penalties, held, solutions, scratch, functions,
        )  # fmt: skip
    use_fit(row, rows, rivals, has)


class TorqueAdaptation:
    """Learns and predicts the torque of one joint that its model lacks.

    Its filters and what the control cycle uses of it are in two rows, see `plan_rows`.

    Parameters
    ----------
    y, row : rows
        State of the plan, and of what is learnt.
    inertia, damping : float
        Of the model [kg m^2], [N m s/rad].
    largest : float
        Torque that the muscles can give at most [N m].
    turn : float, optional
        Part of the time between two updates after which the first one is due, so that several
        joints do not compute theirs in one control cycle [-].
    """

    def __init__(
        self, y: Any, row: Any, inertia: float, damping: float, largest: float, turn: float = 0.0
    ) -> None:
        self._y, self._row = y, row
        self._inertia, self._damping, self._turn = inertia, damping, turn
        self._fit = AveragedFit(
            [
                *(largest * each for each in DEVIATIONS),
                DELAY_DEVIATION,
                ZERO_DEVIATION,
                GRIP_DEVIATION,
            ],
            RIVALS,
            NOISE * largest,
            ERRORS * largest,
            TRIFLE * largest,
            {VISCOUS: -damping, **dict.fromkeys(SLIPS, 0.0)},
        )
        self.forget()
        self.restart()
        prepare(learn_torque, *self._arguments())

    def _arguments(self) -> tuple[Any, ...]:
        """Of `learn_torque`."""
        return self._inertia, self._damping, self._y, self._row, *self._fit.rows

    def forget(self) -> None:
        """Nothing is known."""
        self._fit.forget()
        self._row[A_DELAY] = 0.0
        _, _, rows, _, rivals, has, *_ = self._fit.rows
        use_fit(self._row, rows, rivals, has)

    @property
    def knows(self) -> bool:
        """Whether anything was learnt that is worth using."""
        return bool(self._row[A_KNOWS] > 0.0)

    @property
    def delay(self) -> float:
        """By which the position is later than the pressures [s], beside what the rig file tells.

        Negative if the pressures are later.
        """
        return float(self._row[A_DELAY])

    @property
    def weights(self) -> list[float]:
        """Of the functions in the order of `motion_functions`, then `DELAY`, `ZERO` and `GRIP`."""
        return self._fit.weights

    def restart(self) -> None:
        """Begin with a joint at rest; what was learnt is kept."""
        begin_memory(self._row, A_MEASURED)
        begin_memory(self._row, A_PLANNED)
        self._row[A_BEGUN], self._row[A_SINCE] = 0.0, -self._turn * EVERY
        self._y[Y_PLANNED_AT] = self._y[Y_REFERENCE] = math.nan
        self._row[A_WAITS], self._row[A_TAKEN_OVER], self._row[A_STOOD] = 1.0, math.nan, 0.0

    def update(self) -> None:
        """Learn from the filtered samples; due when `take_torque` says so."""
        learn_torque(*self._arguments())

    def at_rest(self, position: float, limit: float) -> float:
        """The learnt torque of a joint that begins at rest at a position [rad], limited [N m]."""
        return limited(weighted(self._y, self._row, position, 0.0, 0.0, True), -limit, limit)
