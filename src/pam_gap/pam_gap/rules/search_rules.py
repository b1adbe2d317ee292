"""Constants that decide which hypotheses are fitted, how far, and how they are scored."""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import AFTER_3727343088, BEFORE_3727343088, NUMERICAL, rule

_STEPS = (
    "Fewer: a hypothesis is judged before its fit has converged. More: the diagnosis takes longer."
)
_COUNT = (
    "Fewer: the true effect can be dropped after a bad start. More: the diagnosis takes longer."
)


@dataclass(frozen=True, slots=True)
class SearchRules:
    """How many hypotheses are tried, and with how many steps each is fitted."""

    # fmt: off
    tolerance_reach: float = rule(1.05, unit="of the tolerance",
        decides="Largest change of a nominal parameter by re-tuning.",
        trades="Smaller: a parameter that is wrong by the whole tolerance looks like an effect. "
               "Larger: re-tuned parameters absorb small effects.")
    ruler: float = rule(0.005, unit="-",
        decides="Tolerance of the lengths with which a diagnosis is repeated if the rig file "
                "states none and lengths as uncertain as all other numbers explain most of an "
                "error.",
        trades="Larger: lengths hide an offset of the encoder. Smaller: an offset is named for "
               "lengths that are a little wrong.",
        origin="A ruler reads 1 mm of a muscle of 200 mm, a calliper 0.1 mm of a pulley of 25 mm.")
    tolerance_size: float = rule(0.3, unit="of the tolerance",
        decides="Typical change of a nominal parameter; it scales the difference step and the "
                "damping of the fit.",
        trades="The fit takes other steps; the result should not change.")
    search_time: float = rule(10.0, unit="s",
        decides="Time at the beginning of each recording in which effects are sought; the "
                "leading hypotheses are then fitted to whole recordings. It is doubled until "
                "`search_shows` holds.",
        trades="Longer: the diagnosis takes longer. Shorter: the true effect can be dropped "
               "before it is compared on all data.",
        origin="Chosen on recordings of 24 and 40 s; shorter ones are searched as a whole.")
    search_shows: float = rule(0.5, unit="-",
        decides="Share of the range of every channel, and of the mean square of its error, that "
                "the beginning of the recordings must show for effects to be sought in it alone.",
        trades="Larger: whole recordings are searched, which takes longer. Smaller: effects are "
               "sought where they hardly act.",
        origin=NUMERICAL)
    search_rows: int = rule(1000, unit="rows",
        decides="Fewest rows of prediction errors of such a beginning.",
        trades="Larger: slow recordings are searched as a whole. Smaller: hypotheses that hardly "
               "differ change places, and probabilities with them.",
        origin="With 600 rows of 40 ms in 24 s, a search of 10 s changed a probability by 0.3.")
    search_most: float = rule(0.7, unit="of the longest recording",
        decides="Length from which whole recordings are searched instead of their beginning.",
        trades="Larger: what leads is fitted again where little is saved.",
        origin=NUMERICAL)
    behind: float = rule(6.0, unit="level",
        decides="Distance from the best candidate beyond which a candidate is dropped; after the "
                "screening, twice this distance.",
        trades="Smaller: the true effect can be dropped after a bad start. Larger: the diagnosis "
               "takes longer.")
    screening_steps: int = rule(3, unit="steps",
        decides="Steps of each candidate's fit before the candidates are compared for the first "
                "time.",
        trades=_STEPS,
        origin="Two at first; raised to three after misses in the withheld check of seed "
               "3727343088.")
    refine_steps: int = rule(5, unit="steps",
        decides="Further steps of the leading candidates.",
        trades=_STEPS)
    finish_steps: int = rule(8, unit="steps",
        decides="Final steps of the leading candidates.",
        trades=_STEPS)
    settled_steps: int = rule(12, unit="steps",
        decides="Steps with which a fit is completed before another effect is added.",
        trades=_STEPS)
    nominal_steps: int = rule(6, unit="steps",
        decides="Steps that re-tune the nominal parameters alone.",
        trades=_STEPS)
    first_screened: int = rule(10, unit="-",
        decides="Number of single effects whose fit is continued after the screening.",
        trades=_COUNT)
    first_finished: int = rule(5, unit="-",
        decides="Number of single effects whose fit is completed.",
        trades=_COUNT)
    further_screened: int = rule(8, unit="-",
        decides="Number of second or third effects whose fit is continued after the screening.",
        trades=_COUNT)
    further_finished: int = rule(4, unit="-",
        decides="Number of second or third effects whose fit is completed.",
        trades=_COUNT)
    challenge_screened: int = rule(4, unit="-",
        decides="Number of effects whose fit is continued when they replace a chosen effect.",
        trades=_COUNT)
    challenge_finished: int = rule(3, unit="-",
        decides="Number of effects whose fit is completed when they replace a chosen effect.",
        trades=_COUNT)
    challenge_gain: float = rule(1.0, unit="level",
        decides="Fall of the level by a further effect above which each effect chosen before it "
                "is replaced by others on trial.",
        trades="Larger: a wrong first effect is kept. Smaller: the diagnosis takes longer.")
    twins_of: int = rule(2, unit="-",
        decides="Number of the best hypotheses with several effects of which a richer law is "
                "replaced by its simpler one on trial, and a simpler law by its richer one.",
        trades="Fewer: of two laws of one kind, the wrong one is named together with another "
               "one. More: the diagnosis takes longer.",
        origin="Introduced after a rig of the second plant, whose dry friction (Maxwell slip) "
               "was fitted by Stribeck friction together with another cause; the number is "
               "hand-set.")
    most_effects: int = rule(3, unit="effects",
        decides="Largest number of effects in a hypothesis.",
        trades="Fewer: rigs with several effects become `unknown`. More: the diagnosis takes "
               "longer, and surplus effects can be added.")
    finalists_one: int = rule(8, unit="-",
        decides="Number of hypotheses with one effect that are scored on held-out data.",
        trades=_COUNT)
    finalists_two: int = rule(5, unit="-",
        decides="Number of hypotheses with two effects that are scored on held-out data.",
        trades=_COUNT)
    finalists_three: int = rule(3, unit="-",
        decides="Number of hypotheses with three effects that are scored on held-out data.",
        trades=_COUNT)
    end_stop_gain: float = rule(0.3, unit="of the squared torque",
        decides="Share of the torque that a smooth law leaves, squared, which a one-sided spring "
                "must explain for an end stop to be tried as a cause outside the table.",
        trades="Larger: an effect of the muscles is named for a stop. Smaller: the diagnosis "
               "takes longer.",
        origin="Chosen by hand: a joint at a stop gave 0.48, and rigs with nothing hidden 0.2. "
               "Torque ripple and friction reach 0.7, so that it only decides whether a stop is "
               "tried.")
    end_stop_window: float = rule(0.1, unit="s",
        decides="Time over which angle, speed and acceleration are averaged for the balance of "
                "torques.",
        trades="Longer: quick motions are flattened. Shorter: the acceleration is noisier.",
        origin=NUMERICAL)
    end_stop_slow: float = rule(0.05, unit="rad/s",
        decides="Speed below which dry friction grows with the speed in the balance of torques.",
        trades="Larger: friction is left as a torque that is lacking. Smaller: so is noise of "
               "the speed at rest.",
        origin=NUMERICAL)
    clean_bases: int = rule(3, unit="-",
        decides="Number of the best single effects, each of which is paired with every other "
                "effect in the test for a rig with two causes and no background.",
        trades="Fewer: two causes on such a rig are missed where neither is among the best "
               "alone. More: the diagnosis takes longer.",
        origin="Numerical setting.")
    clean_left: float = rule(0.02, unit="of the mean square",
        decides="Share of a whole ordinary background, with the margin `background_reach`, that "
                "one effect or a pair must leave without any background for the rig to be "
                "searched without one.",
        trades="Larger: rigs with a small background are `unknown`. Smaller: the second of two "
               "causes on a rig without a background is missed.",
        origin="Set by hand between five rigs without a background (`blind --cases 60 --seed "
               "1097762585`), of which the best pair left 0.009 at most, and four rigs with one "
               "(`blind --background --seed 20261902`), on which it left 0.056 to 0.067; no "
               "fresh check yet.")
    clean_pairs: int = rule(4, unit="-",
        decides="Largest number of these pairs that are simulated. Only pairs are that would "
                "leave less than `clean_left` by the slopes of the single fits.",
        trades="Fewer: such pairs are missed. More: the diagnosis takes longer.",
        origin="Numerical setting.")
    clean_steps: int = rule(3, unit="steps",
        decides="Steps of the fit of such a pair after which it must have halved what it leaves, "
                "or it ends.",
        trades=_STEPS,
        origin=NUMERICAL)
    unlisted_rounds: int = rule(3, unit="-",
        decides="Largest number of times that the recordings are changed by what was found of a "
                "cause outside the table.",
        trades="Fewer: large causes outside the table are fitted badly. More: the diagnosis "
               "takes longer.",
        origin="Numerical setting; drawn rigs with an eccentric encoder needed two.")
    largest_arm: float = rule(1.0, unit="1/rad and 1/rad^2",
        decides="Largest relative change of a lever arm over the angle that is sought.",
        trades="Larger: over a small motion the fit of an arm wanders far. Smaller: very "
               "eccentric pulleys are not recognised.",
        origin="With an eccentricity of half the radius, an oval pulley has up to 1 per radian.")
    unlisted_moved: float = rule(0.05, unit="of the amount",
        decides="Change of the amount of such a cause below which its fit ends.",
        trades="Larger: fits end early. Smaller: the diagnosis takes longer.",
        origin="Numerical setting.")
    restarts: int = rule(3, unit="-",
        decides="Largest number of fits from the rig file's nominal values that a hypothesis "
                "gets before it is reported.",
        trades="Fewer: parameters that are trapped at the ends of their tolerance stay there. "
               "More: the diagnosis takes longer.",
        origin="Introduced after the check of seed 1097762585, because the first fit can trap "
               "re-tuned parameters at the ends of their tolerance; the number is hand-set.")
    restart_gain: float = rule(1.0, unit="log likelihood",
        decides="Smallest decrease of the objective for which another restart is made.",
        trades="Larger: fewer restarts. Smaller: the diagnosis takes longer.",
        origin="As for `restarts`; one unit of the log likelihood.")
    restart_steps: int = rule(25, unit="steps",
        decides="Largest number of steps of each restart.",
        trades=_STEPS,
        origin="As for `restarts`.")
    restart_tolerance: float = rule(1e-5, unit="of the mean log error",
        decides="Decrease of the objective in one step below which a restart ends.",
        trades="Larger: fits end early. Smaller: the diagnosis takes longer.",
        origin="As for `restarts`.")
    lengths_apart: float = rule(0.005, unit="of the rest length",
        decides="Lengths of a muscle on a bench that differ less are one length, and a length "
                "that is held varies less.",
        trades="Larger: lengths that differ are not withheld one by one. Smaller: a length that "
               "gives under force counts as moving.",
        origin="A load cell and its mounting give by some tenths of a millimetre.")
    fewest_lengths: int = rule(3, unit="-",
        decides="Held lengths from which each is withheld once and predicted from the others.",
        trades="Larger: fewer recordings are judged at lengths that were not fitted.",
        origin="Each can be predicted from two others, which a straight line needs.")
    least_length_time: float = rule(0.05, unit="of the time",
        decides="Share of the time for which a length must be held to be one of them.",
        trades="Larger: short holds are left out. Smaller: a slow motion is taken for holds.",
        origin="Set by hand; tests hold lengths for a third of the time.")
    mostly_held: float = rule(0.8, unit="of the time",
        decides="Share of the time at held lengths from which a muscle counts as held.",
        trades="Larger: recordings with long ways between holds are cut in time instead.",
        origin="Set by hand.")
    most_lengths: int = rule(6, unit="-",
        decides="With more held lengths than this, several are withheld together.",
        trades="Larger: more fits for each score.",
        origin="Set by hand, for the time of a diagnosis.")
    fold_time: float = rule(4.0, unit="s",
        decides="Length of the blocks that belong to the two folds in turn.",
        trades="Shorter: the guards take up much of the data. Longer: the folds contain "
               "different motions.")
    guard: float = rule(0.9, unit="s",
        decides="Time excluded at each border between the folds.",
        trades="Shorter: errors of one fold still influence the other. Longer: less data.",
        origin="Three horizons of the observer, after which e^-3, or 5 %, of an error is left.")
    score_time: float = rule(1.0, unit="s",
        decides="Length of the score blocks, whose errors are compared and resampled.",
        trades="Shorter: neighbouring blocks are correlated. Longer: too few blocks.")
    fold_steps: int = rule(2, unit="steps",
        decides="Steps with which the fit to all data is continued on one fold.",
        trades="Fewer: the score is not fully independent of the held-out data. More: the "
               "diagnosis takes longer.")
    no_gap: float = rule(0.35, unit="level per channel",
        decides="Level up to which nothing more is sought; 0.35 is an RMS error of 1.19 times the "
                "noise floor.",
        trades="Larger: weak second effects and causes outside the table are not tried. Smaller: "
               "the diagnosis takes longer.")
    further_gain: float = rule(1.2, unit="level",
        decides="Smallest fall of the level by a further effect after which one more is sought.",
        trades="Larger: rigs with several effects are not searched to the end. Smaller: the "
               "diagnosis takes longer.")
    further_share: float = rule(0.22, unit="of the first fall",
        decides="A further effect must reduce the level by this share of the reduction that the "
                "effects before it achieved. It is enough if one of the three conditions "
                "`further_share`, `further_rest` and `further_alone` holds.",
        trades="As for `further_gain`.")
    further_rest: float = rule(0.5, unit="of the rest",
        decides="A further effect reduces the level by this share of what the effects before it "
                "leave.",
        trades="As for `further_gain`.",
        origin=BEFORE_3727343088)
    further_alone: float = rule(3.0, unit="-",
        decides="A further effect reduces the level by this many times the reduction by the next "
                "best further effect. Several effects can absorb a model error equally well, but "
                "only the true effect stands out.",
        trades="As for `further_gain`.",
        origin=BEFORE_3727343088)
    completed_from: float = rule(0.1, unit="-",
        decides="Probability of a set of causes from which its fit is completed before the "
                "decision.",
        trades="Larger: an explanation is judged before its fit has converged. Smaller: the "
               "diagnosis takes longer.",
        origin="Set by hand, for the time of a diagnosis.")
    price: float = rule(0.05, unit="level per free number",
        decides="Penalty on the level for each free parameter when hypotheses are ranked, so "
                "that of equal hypotheses the one with fewer parameters comes first.",
        trades="Larger: effects with few parameters come first. Smaller: effects with many "
               "parameters come first by chance.",
        origin=AFTER_3727343088)
    # fmt: on
