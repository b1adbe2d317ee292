"""`kernel.run` without the laws that a joint does not have.

The kernel with all laws asks in every step which of them act. Without these questions, an ideal
joint is simulated half as fast again, with the same result.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from pam_model.plant.compiled import fused_entry_point
from pam_model.plant.kernel import contact_of, record, rk4_step, run
from pam_model.plant.lane_twins import LaneVariant, kernel_name, twin_without_laws


@cache
def run_without_laws(variant: LaneVariant) -> Callable[..., None]:
    """`run` for joints of a variant of the plant; it takes the same arguments."""
    plain: Any = getattr(run, "py_func", run)
    twins = {
        function.__name__: twin_without_laws(function, variant)
        for function in (record, contact_of, rk4_step)
    }
    made = FunctionType(plain.__code__, {**plain.__globals__, **twins}, plain.__name__)
    made.__qualname__ = f"{plain.__name__}_{kernel_name(variant)}"
    made.__module__ = plain.__module__
    return fused_entry_point(made)
