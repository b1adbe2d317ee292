"""Constants that turn held-out scores into a verdict.

Levels are sums over channels of log mean squared error over the noise floor, so that a difference
of levels is a likelihood ratio per observation, and a fall of 1 in one channel a factor of 1.65 in
its RMS error.
"""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import AFTER_3727343088, BEFORE_3727343088, DECISION, PROPOSAL, rule


@dataclass(frozen=True, slots=True)
class DecisionRules:
    """What a hypothesis must achieve to be named, and which others are named beside it."""

    no_gap: float = rule(
        0.35,
        unit="level per channel",
        decides="Level of the re-tuned nominal plant up to which the verdict is `none`: 0.35 is an "
        "RMS error of 1.19 floors.",
        trades="Larger: weak effects are taken for none. Smaller: anything but white noise on a "
        "good rig is a gap.",
        acts=DECISION,
    )
    no_gain: float = rule(
        0.25,
        unit="level",
        decides="Fall of the level below which no effect may be named.",
        trades="Larger: weak effects become `unknown`. Smaller: chance gains get a name.",
        acts=DECISION,
    )
    further_gain: float = rule(
        1.2,
        unit="level",
        decides="Fall of the level that a further effect must bring at least.",
        trades="Larger: small second effects are left out. Smaller: surplus effects that mop up "
        "what the first one's approximate law leaves.",
        acts=DECISION,
    )
    further_share: float = rule(
        0.22,
        unit="of the first fall",
        decides="Share of the fall before it that a further effect must bring (or one of the two "
        "conditions below).",
        trades="As for `further_gain`.",
        acts=DECISION,
    )
    further_rest: float = rule(
        0.5,
        unit="of the rest",
        decides="Or the share of what the effects before it leave.",
        trades="As for `further_gain`.",
        origin=BEFORE_3727343088,
        acts=DECISION,
    )
    further_alone: float = rule(
        3.0,
        unit="-",
        decides="Or how many times the gain of the next best further effect: several effects can "
        "mop up, only the true one explains.",
        trades="As for `further_gain`.",
        origin=BEFORE_3727343088,
        acts=DECISION,
    )
    simpler_gain: float = rule(
        1.0,
        unit="level",
        decides="Fall of the level that a richer form of the same effect must bring.",
        trades="Larger: Stribeck friction is reported as Coulomb friction. Smaller: the reverse.",
        acts=DECISION,
    )
    simpler_share: float = rule(
        0.03,
        unit="of the fall",
        decides="Or this share of the whole fall of the level, when that is more.",
        trades="As for `simpler_gain`.",
        acts=DECISION,
    )
    rival_gap: float = rule(
        0.5,
        unit="level",
        decides="Hypotheses closer than this are reported together: both laws are approximate.",
        trades="Larger: more `ambiguous` verdicts and larger sets. Smaller: a near tie is decided.",
        acts=DECISION,
    )
    rival_share: float = rule(
        0.06,
        unit="of the fall",
        decides="Or closer than this share of the whole fall of the level, when that is more.",
        trades="As for `rival_gap`.",
        acts=DECISION,
    )
    rival_tied: float = rule(
        2.0,
        unit="-",
        decides="How many times that distance counts when the Model Confidence Set holds both.",
        trades="As for `rival_gap`.",
        acts=DECISION,
    )
    rival_part: float = rule(
        0.5,
        unit="of the last gain",
        decides="Share of what the last effect brings that one in its place must bring to be "
        "reported beside it.",
        trades="Larger: fewer rivals. Smaller: rivals that explain little.",
        origin=BEFORE_3727343088,
        acts=DECISION,
    )
    price: float = rule(
        0.05,
        unit="level per free number",
        decides="What each free number of a hypothesis must bring when hypotheses that leave the "
        "same are put in order.",
        trades="Larger: effects with few numbers lead. Smaller: effects with many numbers lead by "
        "chance.",
        origin=AFTER_3727343088,
        acts=DECISION,
    )
    closed_at_least: float = rule(
        0.60,
        unit="of the RMS gap",
        decides="Share of the gap, mean over channels, that effects whose law has many forms must "
        "close; else the verdict is `unknown`.",
        trades="Larger: true effects whose law differs from the fitted one become `unknown`. "
        "Smaller: effects outside the table are named as known ones.",
        acts=DECISION,
    )
    gap_of_channel: float = rule(
        1.5,
        unit="RMS over floor",
        decides="Error from which a channel takes part in that mean.",
        trades="Larger: only the loudest channels decide. Smaller: channels with hardly a gap "
        "veto.",
        origin="Introduced with the measured pair of shut muscles (tests/data/closed_pair), "
        "so that channels with hardly a gap do not count. No derivation.",
        acts=DECISION,
    )
    sharp_fall: float = rule(
        0.60,
        unit="of the level",
        decides="Share of the level that effects whose law has one form must take away; else the "
        "verdict is `unknown`.",
        trades="As for `closed_at_least`.",
        acts=DECISION,
    )
    sharp_left: float = rule(
        3.5,
        unit="level",
        decides="Level that effects whose law has one form may leave; else the verdict is "
        "`unknown`.",
        trades="Larger: effects outside the table are named as known ones. Smaller: any background "
        "on an ordinary rig makes offsets, gains and delays `unknown`.",
        acts=DECISION,
    )
    confidence_size: float = rule(
        0.10,
        unit="-",
        decides="Size of the test of the Model Confidence Set.",
        trades="Larger: smaller sets. Smaller: more ties.",
        origin="One of the two levels, 0.10 and 0.25, that Hansen, Lunde and Nason (2011) report.",
        acts=DECISION,
    )
    bootstraps: int = rule(
        500,
        unit="-",
        decides="Bootstrap samples of the confidence set, the weights and the intervals.",
        trades="Fewer: the weights and p-values are noisier. More: time.",
        origin="Numerical setting: a p-value of 0.1 is known to 0.013.",
        acts=DECISION,
    )
    bootstrap_blocks: int = rule(
        4,
        unit="score blocks",
        decides="Score blocks that the bootstrap draws together.",
        trades="Shorter than the memory of the errors: sets and intervals too small. Longer: too "
        "few independent blocks.",
        acts=DECISION,
    )
    fewest_blocks: int = rule(
        8,
        unit="score blocks",
        decides="With fewer, no confidence set is computed, and levels within `rival_gap` count as "
        "tied.",
        trades="Matters for recordings of a few seconds only.",
        acts=DECISION,
    )
    equal_level: float = rule(
        1e-3,
        unit="level",
        decides="Hypotheses this close share the weight of a bootstrap sample.",
        trades="Smaller: which of two equal hypotheses leads is decided by rounding.",
        origin="Numerical setting: the rounding of the scores.",
        acts=DECISION,
    )
    motion_spread: float = rule(
        0.55,
        unit="log of the share left",
        decides="Standard deviation by which the share of the gap that is left differs from one "
        "motion to another; widens the interval of `closed`.",
        trades="Larger: intervals that say little. Smaller: intervals that miss.",
        origin="Measured on eleven withheld rigs of another plant, each recorded twice; on 78 "
        "others the interval held 75 times.",
        acts=DECISION,
    )
    floor_share: float = rule(
        0.1,
        unit="of the floor",
        decides="How far the noise floor may be off; widens the interval of `closed`.",
        trades="As for `motion_spread`.",
        acts=DECISION,
    )
    leftover_ridge: float = rule(
        1e-3,
        unit="-",
        decides="Ridge of the flexible regression on what the best hypothesis leaves. Its result "
        "is reported and enters no verdict.",
        trades="Changes the figure `leftover_explained` only.",
        acts=PROPOSAL,
    )
    bound_reach: float = rule(
        1e-3,
        unit="of the range",
        decides="Distance from its upper bound at which a parameter is noted as being at it.",
        trades="Changes the note beside a hypothesis only.",
        acts=PROPOSAL,
    )
    fold_disagreement: float = rule(
        0.5,
        unit="-",
        decides="Half the relative difference of a parameter between the folds that is noted.",
        trades="Changes the note beside a hypothesis only.",
        acts=PROPOSAL,
    )
