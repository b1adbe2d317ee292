"""Ways to let a processor's vectors simulate several plants at once, and what each one reaches.

    python benchmarks/lane_ways.py [--json]
    NUMBA_CPU_NAME=haswell NUMBA_CPU_FEATURES= python benchmarks/lane_ways.py

The nominal joint of benchmarks/limit.c in numba, with a batch of 64:

    one lane      the functions of one joint, one plant after the other
    slices        a loop over lanes that hands `array[:, lane]` to these functions
    lane views    a loop over lanes that hands them a view with a constant distance of its entries

and the plant of the suite, whose loops over lanes are made from the source of its functions
(pam_model.plant.lane_twins). The second command compiles for 16 registers of 256 bits, as most
desktop processors have. The limit is C, scalar and with vectors.
"""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import operator
import sys
import timeit
from pathlib import Path
from typing import Any

import numba
import numpy as np
from limit import c_rates
from numba.core import cgutils, types
from numba.extending import intrinsic, make_attribute_wrapper, models, overload, register_model

from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.gas.flow import reference_flow
from pam_model.physics.sine import sine as sine_law
from pam_model.plant.batch_kernel import simulate_block
from pam_model.plant.constants import derive_constants
from pam_model.plant.lane_blocks import blocks_of_lanes
from pam_model.plant.lane_choice import lane_kernels
from pam_model.plant.lane_twins import LANES as WIDTH
from pam_model.plant.layout import outputs_of
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, initial_state, simulate
from pam_model.rig import load_rig

LANES = 16
BATCH = 64
SAMPLES = 10
LONG = 100  # samples, for the suite, whose calls cost more
STEPS = 8
STEP = 2.5e-4  # s
REPEATS = 200
"""Many short calls, as other work on the machine interrupts long ones."""
ELBOW = Path(__file__).parents[1] / "config/elbow.yaml"

inlined = numba.njit(error_model="numpy", forceinline=True, _nrt=False)
apart = numba.njit(error_model="numpy", nogil=True, _nrt=False)
flow, sine = inlined(reference_flow), inlined(sine_law)

NUMBERS = np.array([101325.0, 701325.0, 287.05 * 293.15 * 1.185, 1.0, 200.0, 4e-9, 0.3, 0.03,
                    0.225, 0.2758**2, 0.02310118149720259, 2e-5, 20.0, 0.25, 4.9])  # fmt: skip
(AMBIENT, SUPPLY, PER_MASS, EXPONENT, PER_LAG, CONDUCTANCE, CRITICAL, RADIUS, NEUTRAL, B2, SCALE,
 DEAD, PER_INERTIA, VISCOUS, GRAVITY) = range(15)  # fmt: skip


@inlined
def muscle(
    c: Any, length: Any, length_rate: Any, command: Any, spool: Any, pressure: Any
) -> tuple[float, float, float]:
    """Pull, and rates of spool and pressure."""
    square = length * length
    volume = length * (c[B2] - square) * c[SCALE] + c[DEAD]
    slope = (c[B2] - 3.0 * square) * c[SCALE]
    fills = spool >= 0.0
    conductance = abs(spool) * c[CONDUCTANCE]
    up, down = (c[SUPPLY], pressure) if fills else (pressure, c[AMBIENT])
    drawn = flow(conductance, c[CRITICAL], up, down)
    entering = drawn if fills else -drawn
    rate = (c[PER_MASS] * entering - c[EXPONENT] * pressure * slope * length_rate) / volume
    pull = (pressure - c[AMBIENT]) * (3.0 * square - c[B2]) * c[SCALE]
    return max(pull, 0.0), (command - spool) * c[PER_LAG], rate


@inlined
def joint(c: Any, u: Any, y: Any, dy: Any) -> None:
    """Write the rates of one joint."""
    turned, wound = c[RADIUS] * y[0], c[RADIUS] * y[1]
    first, dy[2], dy[3] = muscle(c, c[NEUTRAL] - turned, -wound, u[0], y[2], y[3])
    second, dy[4], dy[5] = muscle(c, c[NEUTRAL] + turned, wound, u[1], y[4], y[5])
    torque = c[RADIUS] * (first - second) - c[VISCOUS] * y[1] - c[GRAVITY] * sine(y[0])
    dy[0] = y[1]
    dy[1] = torque * c[PER_INERTIA]


class LaneType(types.Type):
    """One lane of an array: entry i is at i * LANES + lane."""

    def __init__(self, array: Any) -> None:
        self.array = array
        super().__init__(f"Lane({array})")


@register_model(LaneType)
class LaneModel(models.StructModel):  # type: ignore[misc]
    """Holds the array and the number of the lane."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("array", kind.array), ("lane", types.intp)])


make_attribute_wrapper(LaneType, "array", "array")
make_attribute_wrapper(LaneType, "lane", "lane")


@intrinsic
def lane_of(_context: Any, array: Any, _lane: Any) -> Any:
    """One lane of an array, for compiled code."""
    kind = LaneType(array)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        view = cgutils.create_struct_proxy(kind)(context, builder)
        view.array, view.lane = arguments
        return view._getvalue()

    return kind(array, types.intp), generate


@overload(operator.getitem)
def read_lane(view: Any, i: Any) -> Any:
    """Entry i of a lane."""

    def read(view: Any, i: Any) -> Any:
        return view.array[i * LANES + view.lane]

    return read if isinstance(view, LaneType) else None


@overload(operator.setitem)
def write_lane(view: Any, i: Any, value: Any) -> Any:
    """Write entry i of a lane."""

    def write(view: Any, i: Any, value: Any) -> Any:
        view.array[i * LANES + view.lane] = value

    return write if isinstance(view, LaneType) else None


@apart
def rates_alone(c: Any, u: Any, y: Any, dy: Any) -> None:
    """One lane."""
    joint(c, u, y, dy)


@apart
def rates_of_slices(c: Any, u: Any, y: Any, dy: Any) -> None:
    """A loop over slices of arrays with two dimensions."""
    for lane in range(LANES):
        joint(c[:, lane], u[:, lane], y[:, lane], dy[:, lane])


@apart
def rates_of_views(c: Any, u: Any, y: Any, dy: Any) -> None:
    """A loop over lane views."""
    for lane in range(LANES):
        joint(lane_of(c, lane), lane_of(u, lane), lane_of(y, lane), lane_of(dy, lane))


@apart
def move(y: Any, dy: Any, h: Any, moved: Any) -> None:
    """Write a step with constant rates."""
    flat, rate, to = y.reshape(-1), dy.reshape(-1), moved.reshape(-1)
    for i in range(len(flat)):
        to[i] = flat[i] + h * rate[i]


@apart
def finish(y: Any, k: Any, h: Any) -> None:
    """Write a Runge-Kutta step."""
    flat = y.reshape(-1)
    a, b, c, d = k[0].reshape(-1), k[1].reshape(-1), k[2].reshape(-1), k[3].reshape(-1)
    for i in range(len(flat)):
        flat[i] += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i])


def measured(rates: Any, lanes: int, *, flat: bool) -> float:
    """Million steps/s of a batch whose rates are computed by a function for `lanes` lanes."""

    @apart
    def run(c: Any, u: Any, y: Any, k: Any, moved: Any, samples: Any) -> None:
        for _ in range(samples * STEPS):
            rates(c, u, y, k[0])
            move(y, k[0], 0.5 * STEP, moved)
            rates(c, u, moved, k[1])
            move(y, k[1], 0.5 * STEP, moved)
            rates(c, u, moved, k[2])
            move(y, k[2], STEP, moved)
            rates(c, u, moved, k[3])
            finish(y, k, STEP)

    @apart
    def batch(c: Any, u: Any, ys: Any, ks: Any, moved: Any, samples: Any) -> None:
        for i in range(len(ys)):
            run(c, u, ys[i], ks[i], moved[i], samples)

    def made(rows: Any) -> Any:
        wide = np.repeat(np.asarray(rows, dtype=float)[:, None], lanes, 1)
        return np.ascontiguousarray(wide.ravel() if flat else wide)

    start = made([0.0, 0.0, 0.0, NUMBERS[AMBIENT], 0.0, NUMBERS[AMBIENT]])
    ys = np.repeat(start[None], BATCH // lanes, 0)
    ks = np.zeros((len(ys), 4, *start.shape))
    given = (made(NUMBERS), made([0.05, -0.05]), ys, ks, np.zeros_like(ys))
    batch(*given, 1)
    seconds = min(timeit.repeat(lambda: batch(*given, SAMPLES), number=1, repeat=REPEATS))
    return 1e-6 * BATCH * SAMPLES * STEPS / seconds


def of_the_suite(way: str) -> float:
    """Million steps/s of the suite's plant: `all laws` or `no laws` of one joint, or a `block`."""
    parameters = PlantParameters.from_rig(load_rig(ELBOW))
    constants = np.repeat(derive_constants(parameters.values)[None], WIDTH, 0)
    states = np.repeat(initial_state(parameters)[None], WIDTH, 0)
    commands = np.tile([0.05, -0.05], (LONG, 1))
    outputs = np.empty((WIDTH, LONG, outputs_of(2)))
    tables = tuple(np.ascontiguousarray(table) for table in parameters.tables)
    kernel = lane_kernels(constants)[0].for_all(WIDTH)
    (group,) = blocks_of_lanes(constants, [kernel], STEPS * STEP, STEP)
    plant, long = Plant(parameters, STEP), np.tile(commands, (10, 1))

    def call() -> None:
        if way == "block":
            simulate_block(
                group, constants, tables, commands, states, outputs,
                sample_time=STEPS * STEP, shut=False,
            )  # fmt: skip
        elif way == "no laws":
            simulate(parameters, long, STEPS * STEP, step=STEP, kernels=[kernel.for_all(1)])
        else:
            plant.step((0.05, -0.05), len(long) * STEPS * STEP)

    call()
    seconds = min(timeit.repeat(call, number=1, repeat=REPEATS))
    return 1e-6 * (WIDTH * LONG if way == "block" else len(long)) * STEPS / seconds


def _declare(parser: Parser) -> None:
    """The bench has no options of its own."""


def _run(given: Arguments) -> Outcome:
    """Measure and print."""
    limit = c_rates()
    found = {
        **{f"C, {name}": rate for name, rate in limit.items()},
        "numba, one lane": measured(rates_alone, 1, flat=True),
        "numba, slices": measured(rates_of_slices, LANES, flat=False),
        "numba, lane views": measured(rates_of_views, LANES, flat=True),
        "suite, one joint": of_the_suite("all laws"),
        "suite, one joint without laws": of_the_suite("no laws"),
        "suite, a block of lanes": of_the_suite("block"),
    }
    for name, rate in found.items():
        share = f", {rate / limit['scalar']:5.2f} of scalar C" if limit else ""
        print(f"{name:32s} {rate:6.2f} million steps/s{share}")
    return Outcome({"million_steps_per_second": found})


BENCH = Command("lane_ways", "ways to simulate several plants at once", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/lane_ways.py"))
