"""Constants of an ordinary background, of what matters, and of the intervals of an answer.

Which causes are named follows from `pam_gap.rules.statement`.

A level is the sum over channels of the log of mean squared error over noise floor. A difference of
levels is twice the log likelihood ratio per observation. A fall of the level by 1 in one channel
divides its RMS error by 1.65.
"""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import (
    decision_rule,
    proposal_rule,
    rule,
)


@dataclass(frozen=True, slots=True)
class DecisionRules:
    """What a good rig has, which error matters, and how wide intervals are."""

    # fmt: off
    ordinary_share: float = rule(0.58, unit="of the largest ordinary size",
        decides="Amount of each effect in an ordinary background, as a share of the largest "
                "amount that a good rig has (`ordinary` in the file of the effect); together "
                "with the constants `ordinary_...` it sets what an ordinary background leaves "
                "unexplained.",
        trades="Larger: effects must be stronger to be named. Smaller: the background of a good "
               "rig counts as a gap.",
        origin="Derived: the root mean square of amounts that are uniformly distributed up to "
               "the largest one, 1/sqrt(3).")
    ordinary_presliding: float = rule(3.0, unit="-",
        decides="Factor by which the stroke over which thread friction builds up may differ from "
                "the one assumed.",
        trades="As for `ordinary_share`.",
        origin="Published presliding strokes of braided muscles reach from 0.2 to 2 mm; the "
               "default is 0.5 mm.")
    ordinary_relaxation: float = rule(10.0, unit="-",
        decides="Factor between the time constants of the creep in an ordinary background: one "
                "step below the one assumed to one above it.",
        trades="As for `ordinary_share`.",
        origin="Rubber relaxes over many decades of time, which sums of elements a decade apart "
               "describe (Ferry, Viscoelastic Properties of Polymers, Wiley 1980). The range of "
               "three decades is set by hand.")
    ordinary_creep_order: float = rule(0.15, unit="-",
        decides="Power of time with which the pull of ordinary creep falls: the largest ordinary "
                "amount of a time constant falls with this power of the time constant.",
        trades="Larger: slow creep of good rigs counts as a cause. Smaller: creep and elasticity "
               "of a bladder must be stronger to be named.",
        origin="Set by hand to the small end of powers of time by which the relaxation of rubber "
               "is described (Ferry, Viscoelastic Properties of Polymers, Wiley 1980), because "
               "the largest ordinary amounts are sought. With 0.25, drawn rigs with nothing "
               "hidden were named as creep.")
    ordinary_nonlinearity: float = rule(0.003, unit="of the sensor's range",
        decides="Largest nonlinearity of a good pressure sensor, halfway up its range.",
        trades="As for `ordinary_share`.",
        origin="Data sheets of silicon pressure sensors state 0.1 to 0.3 % of the span.")
    ordinary_regulator: float = rule(0.01, unit="of the supply's gauge pressure",
        decides="Largest error of a good pressure regulator: its zero, its gain, and the width "
                "of its hysteresis.",
        trades="As for `ordinary_share`.",
        origin="Data sheets of electronic pressure regulators state a linearity of +-1 % and a "
               "hysteresis of 0.5 to 1 % of the range.")
    ordinary_spool: float = rule(0.01, unit="of the stroke",
        decides="Largest hysteresis of a good spool valve, peak to peak.",
        trades="As for `ordinary_share`.",
        origin="Data sheets of proportional directional valves state 0.4 to 1 % (Festo MPYE: 0.4 "
               "%).")
    ordinary_pressure: float = rule(0.0003, unit="of the supply's gauge pressure",
        decides="Coloured noise of a good pressure sensor, and of the supply behind its "
                "regulator.",
        trades="As for `ordinary_share`.",
        origin="Silicon sensors with amplifiers state a noise of 0.02 to 0.05 % of the range.")
    ordinary_position: float = rule(0.0003, unit="rad",
        decides="Eccentricity and drift of a good encoder.",
        trades="As for `ordinary_share`.",
        origin="An eccentricity of 10 um on a ring of 30 mm is 0.3 mrad.")
    ordinary_arm: float = rule(0.02, unit="radii, 1/rad, 1/rad^2 and rad",
        decides="Change of a lever arm over the angle up to which a pulley counts as round.",
        trades="Larger: eccentric pulleys are named as another effect. Smaller: the fit of an "
               "arm that does not change takes longer.",
        origin="Set by hand to several times an estimate of what is ordinary: a cable that lies "
               "on a turned pulley to 0.1 mm changes a radius of 30 mm by 0.3 %.")
    ordinary_force: float = rule(0.002, unit="of the pull at 40 % of the supply",
        decides="Nonlinearity and drift of a good load cell.",
        trades="As for `ordinary_share`.",
        origin="Data sheets of load cells with amplifiers state 0.1 to 0.3 %.")
    background_reach: float = decision_rule(2.0, unit="of the mean square",
        decides="Multiple of what the best hypothesis leaves above the noise (as a share of an "
                "ordinary background, mean over the channels) that counts as background, up "
                "to a whole ordinary background.",
        trades="Larger: weak effects on very clean rigs are not reported. Smaller: a hypothesis "
               "that fits the background by chance makes it count as a gap.",
        origin="1.4 times the RMS error; set by hand after the first drawn rigs had been seen.")
    background_shows: float = rule(0.3, unit="of the mean square",
        decides="Share of an ordinary background, with the margin `background_reach`, that must "
                "remain in addition to its fitted parts for a rig to count as one with a "
                "background at once; where less remains, `clean_share` decides.",
        trades="Larger: good rigs with a small background are judged like rigs without one. "
               "Smaller: effects outside the table are named as known ones on rigs without a "
               "background.",
        origin="Hand-set: drawn rigs with a background had 0.5 or more, one without had 0.12.")
    clean_share: float = rule(0.07, unit="of the mean square",
        decides="Share of a whole ordinary background, with the margin `background_reach`, that "
                "the best hypothesis without any background must leave for a rig to count as one "
                "with a background.",
        trades="Larger: on rigs with a small background the verdict is `unknown`. Smaller: "
               "effects outside the table are named as known ones on rigs without a background.",
        origin="Between rigs without a background, which left 0.03 at most (six of the check "
               "without one), and drawn rigs with one, of which the least left 0.14.")
    unlike_share: float = rule(0.04, unit="of the mean square",
        decides="Share of an ordinary background that remains after its parts have been fitted, "
                "because the laws of a real background differ from those of the effects; it is "
                "added to the noise floor.",
        trades="Larger: weak effects are not reported, and sets grow. Smaller: the shape of an "
               "ordinary background counts as a gap.",
        origin="0.2 of the RMS error: drawn rigs with nothing hidden left 0.1 to 0.2 of it at "
               "the joint.")
    material_share: float = decision_rule(0.001, unit="of the motion",
        decides="Share of a channel's range up to which a gap does not matter: silence about its "
                "cause costs nothing. If the re-tuned plant leaves no more in any channel, the "
                "verdict is `none`. Option `--material` of `diagnose`.",
        trades="Larger: small effects are called not worth a cause. Smaller: causes are sought "
               "for differences that no user would notice.",
        origin="The better end of the accuracy that data sheets of pressure sensors and encoders "
               "of such joints state (0.1 to 0.3 % of the range).")
    unexplained_factor: float = decision_rule(3.0, unit="of `material_share`",
        decides="Multiple of that share up to which a gap that no effect explains does not "
                "matter: the verdict is then `none` instead of `unknown`.",
        trades="Larger: effects outside the table are not reported. Smaller: errors within the "
               "accuracy of the sensors become `unknown`.",
        origin="The other end of the accuracy of such sensors, 0.3 % of the range.")
    ordinary_reach: float = rule(4.0, unit="of the RMS error",
        decides="Multiple of what an ordinary background leaves above which an effect that alone "
                "removes most of the error is a cause, however small it is.",
        trades="Larger: small effects on rigs that are sensitive to them are not named. Smaller: "
               "the hysteresis of a good rig is named on rigs with a larger background.",
        origin="Re-tuned rigs with nothing hidden left up to 1.8 times the predicted background "
               "on drawn rigs; the measured pair of shut muscles leaves 9 times as much.")
    most_of_the_gap: float = rule(0.5, unit="of the RMS error",
        decides="Share of an error that counts as most of it: of an effect of ordinary size that "
                "is a cause all the same, of lengths whose tolerance is not stated, and of an "
                "explanation at the end of its range that is said besides the named one.",
        trades="Larger: such effects, lengths and explanations are passed over. Smaller: those are "
               "named or said that explain little of the gap.",
        origin="Most of it, by definition.")
    bootstraps: int = decision_rule(500, unit="-",
        decides="Number of bootstrap samples for the intervals.",
        trades="Fewer: the intervals are noisier. More: the diagnosis takes longer.",
        origin="Numerical setting.")
    bootstrap_blocks: int = decision_rule(4, unit="score blocks",
        decides="Number of consecutive score blocks that the bootstrap draws together.",
        trades="Fewer than the correlation time of the errors: intervals are too small. "
               "More: too few independent blocks.")
    motion_spread: float = decision_rule(0.55, unit="log of the share left",
        decides="Standard deviation, from one motion to another, of the share of the gap that is "
                "left; it widens the interval of `closed`.",
        trades="Larger: the intervals are too wide to be useful. Smaller: they miss the true "
               "value.",
        origin="Measured on eleven withheld rigs of another plant, each recorded twice; on 78 "
               "other rigs the interval contained the value 75 times.")
    background_growth: float = decision_rule(0.37, unit="log of the share left",
        decides="Mean growth, from the motion of the recording to another one, of the share of "
                "the gap that is left on a rig with an ordinary background.",
        trades="Larger: the interval promises less than other motions show. Smaller: it promises "
               "more.",
        origin="Measured on drawn rigs of `blind --background`, each recorded twice: a factor of "
               "1.36 (0.31) on 185 rigs of seed 20261801 and 0.44 on 182 rigs of seed 20262911; "
               "between both. On fresh rigs, the intervals of `closed` held the share under "
               "another motion on 85 of 98 rigs of seed 20263004 and on 69 of 72 of seed "
               "20263019.")
    background_spread: float = decision_rule(0.55, unit="log of the share left",
        decides="Standard deviation of this growth; it widens the interval of `closed`.",
        trades="As for `motion_spread`.",
        origin="Measured on the 182 rigs of seed 20262911; checked as `background_growth`.")
    floor_share: float = decision_rule(0.1, unit="of the floor",
        decides="Relative uncertainty of the noise floor; it widens the interval of `closed`.",
        trades="As for `motion_spread`.")
    bound_reach: float = proposal_rule(1e-3, unit="of the range",
        decides="Distance from the upper bound below which a parameter is reported to be at the "
                "bound.",
        trades="Changes only the note on a hypothesis.")
    fold_disagreement: float = proposal_rule(0.5, unit="-",
        decides="Half the relative difference of a parameter between the folds above which the "
                "difference is reported.",
        trades="Changes only the note on a hypothesis.")
    # fmt: on
