"""What is believed about a rig before its recording is seen; docs/what_we_believe.md is its page.

The statement is generative: rigs could be drawn from it. `pam_check.blind.posterior` turns it into
probabilities of sets of causes, and into the answer with the least expected cost. It does not
decide in the product: `pam check decide-again` shows its answers next to those of the rules.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Statement:
    """The whole statement.

    Attributes
    ----------
    nothing, one, two, three, outside : float
        Probability that a rig which is diagnosed has no cause beyond an ordinary background, one,
        two or three causes of the table, or a cause outside of it. All causes of the table are
        equally probable. Set by hand.
    background_spread : float
        Standard deviation of the logarithm of the mean squared error that an ordinary background
        leaves, common to all channels of a rig, about the one that `discrepancy` predicts.
    channel_freedom : float
        Degrees of freedom with which the background of one channel scatters about that (a scaled
        inverse chi-squared distribution): small numbers have heavy tails.
    independent_errors : float
        Number of independent errors that the recording of one channel is worth. What no law of the
        table describes is correlated over the whole recording, so that it is a handful and not the
        thousands of samples.
    law_error : float
        RMS error of the law of a cause, as a share of the RMS change that the cause makes.
    unknown_law : float
        Logarithm of the odds, per channel, against a smooth law of unknown form that explains the
        channel down to an ordinary background.
    false_name, silence, further_name : float
        Cost of naming what is not there, of not naming what is, and of each further alternative of
        an ambiguous answer.
    """

    nothing: float = 0.25
    one: float = 0.45
    two: float = 0.12
    three: float = 0.03
    outside: float = 0.15
    background_spread: float = 0.8
    channel_freedom: float = 5.0
    independent_errors: float = 10.0
    law_error: float = 0.2
    unknown_law: float = 5.0
    false_name: float = 1.0
    silence: float = 0.6
    further_name: float = 0.2


STATEMENT = Statement()
"""The statement in use."""
CALIBRATED = (
    "background_spread", "channel_freedom", "independent_errors", "law_error", "unknown_law",
)  # fmt: skip
"""Numbers that `pam check calibrate-statement` finds from drawn rigs."""
