"""What is believed about a rig before its recording is seen; docs/what_we_believe.md is its page.

The statement is generative: rigs could be drawn from it. `pam_gap.inference.posterior` turns it
into probabilities of sets of causes, and into the answer with the least expected cost.
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
    hidden : float
        Probability that a rig with one cause that shows has a second one that changes it too little
        to be seen.
    background_spread : float
        Standard deviation of the logarithm of the mean squared error that an ordinary background
        leaves, common to all channels of a rig, about the one that `discrepancy` predicts.
    least_background : float
        RMS error that is ordinary on every rig, also on one without a background, as a share of the
        error that matters (`material_share` of the motion): no model is better. Set by hand.
    channel_freedom : float
        Degrees of freedom with which the background of one channel scatters about that (a scaled
        inverse chi-squared distribution): small numbers have heavy tails.
    independent_errors : float
        Number of independent errors that the recording of one channel is worth. What no law of the
        table describes is correlated over the whole recording, so that it is a handful and not the
        thousands of samples.
    number_price : float
        What each free number of a hypothesis takes off its log likelihood. What is correlated over
        the whole recording is fitted a little by every number, on held-out data as well.
    sharp_law_error, law_error : float
        RMS error of the laws of the causes, as a share of the RMS change that they make: of laws
        with one form only (a delay; `is_sharp` in the file of each effect), and the largest one of
        laws with several forms in the literature (a bladder). All errors between these two are
        equally probable on a logarithmic scale.
    right_law : float
        Probability that a law with several forms is the true one; it errs as little as a law with
        one form only then.
    flexible_price : float
        What a flexible law of the recorded signals takes off its log likelihood for each channel,
        which has a regression of its own. It has no physics and stands for a cause outside the
        table that follows a law of its own; its many numbers are priced together, and it errs as
        laws with several forms do.
    least_unknown, largest_unknown : float
        RMS change that a cause outside the table makes of each channel, in multiples of what an
        ordinary background leaves: all sizes between these two are equally probable on a
        logarithmic scale. Set by hand, from what hides in any background to a whole motion.
    false_name, silence, further_name : float
        Cost of naming what is not there, of not naming what is, and of each further alternative of
        an ambiguous answer.
    """

    nothing: float = 0.25
    one: float = 0.42
    two: float = 0.11
    three: float = 0.02
    outside: float = 0.2
    hidden: float = 0.08
    background_spread: float = 0.8
    least_background: float = 0.5
    channel_freedom: float = 17.0
    independent_errors: float = 4.2
    number_price: float = 0.4
    sharp_law_error: float = 0.02
    law_error: float = 0.55
    right_law: float = 0.15
    flexible_price: float = 1.2
    least_unknown: float = 0.2
    largest_unknown: float = 300.0
    false_name: float = 1.0
    silence: float = 1.0
    further_name: float = 0.1


STATEMENT = Statement()
"""The statement in use; calibrated on the 370 rigs whose commands docs/what_we_believe.md gives."""
CALIBRATED = (
    "background_spread", "channel_freedom", "independent_errors", "number_price",
    "sharp_law_error", "law_error", "right_law", "hidden",
    "flexible_price",
)  # fmt: skip
"""Numbers that `pam check calibrate-statement` finds from drawn rigs."""
BY_USER = (
    "nothing", "one", "two", "three", "outside", "false_name", "silence", "further_name",
)  # fmt: skip
"""Probabilities beforehand, of which only the ratios count, and costs: `diagnose --belief`."""
