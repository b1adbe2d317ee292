"""What people do with the driver, as acts on the chain: hold, vent, clear, activate, restart."""

from __future__ import annotations

from pam_check.fault_kinds.fault_kind import VENT
from pam_check.faults.chain import STEP, FaultChain
from pam_check.faults.rig_bounds import EMPTY
from pam_driver.start_up import StartUp
from pam_model.errors import PamError

GLIDE = 0.8  # rad/s, mean speed on the way to an angle
EMPTYING = 6.0  # s; until then the joint is lowered, hangs, and the muscles are empty


def hold_at(chain: FaultChain, angle: float) -> None:
    """Move the joints to an angle [rad] without a jump and hold it there."""
    start, begin = chain.reference, chain.now
    time = abs(angle - start) / GLIDE + 0.3

    def motion(now: float) -> tuple[float, float]:
        s = min((now - begin) / time, 1.0)
        share, rate = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / time
        return start + share * (angle - start), rate * (angle - start)

    chain.motion = motion
    chain.wait(time + 0.5)


def vent(chain: FaultChain) -> None:
    """Call `~/vent`, as the driver's node does it."""
    chain.driver.vent(chain.now)
    chain.start_up.cancel()


def activate(chain: FaultChain) -> bool:
    """Activate the driver; whether it did."""
    try:
        chain.start_up.activate(chain.driver, chain.now)
    except PamError:
        chain.noticed["refused activation"] += 1
        return False
    return True


def clear_faults(chain: FaultChain) -> None:
    """Call `~/clear_faults`."""
    chain.start_up.clear_faults(chain.driver, chain.now)


def clean_up_and_configure(chain: FaultChain) -> None:
    """Close the driver and open it again, in the same process."""
    chain.start_up.leave(chain.driver)
    chain.driver.close(chain.now)
    chain.step()
    chain.driver = chain.make_driver()


def start_new_process(chain: FaultChain, *, activates: bool) -> None:
    """Start a new process of the driver; the old one has been killed.

    Parameters
    ----------
    chain : FaultChain
    activates : bool
        Whether the process was asked to activate by itself when the boards answer.
    """
    chain.driver = chain.make_driver()
    chain.driver_runs = True
    chain.start_up = start_up = StartUp()
    start_up.begin(chain.now + 5.0, activates)

    def watch(now: float) -> None:
        advice = start_up.step(chain.driver, now).advice
        if advice.value == "activate":
            activate(chain)

    chain.after.append(watch)


def claim_no_air(chain: FaultChain, after: float = STEP) -> None:
    """From some time after now on, no valve may do anything but vent."""
    since = chain.now + after

    def no_air() -> str:
        late = chain.now > max(since, chain.lowered_at + VENT) and chain.moves_air
        return "air moves although nobody asked for it" if late else ""

    chain.claims.append(no_air)


def claim_stays(chain: FaultChain, allowed: float) -> None:
    """The first joint may not leave its present angle by more than this [rad]."""
    angle = chain.truth.positions[0]

    def stays() -> str:
        way = abs(chain.truth.positions[0] - angle)
        return f"the joint moves by {way:.2f} rad by itself" if way > allowed else ""

    chain.claims.append(stays)


def settle(chain: FaultChain) -> None:
    """Wait until the muscles are empty and the joint hangs."""
    end = chain.now + EMPTYING
    while chain.now < end:
        chain.wait(0.1)
        truth = chain.truth
        if max(truth.pressures) < 0.5 * EMPTY and abs(truth.velocities[0]) < 0.01:
            return
