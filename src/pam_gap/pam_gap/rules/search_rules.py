"""Constants that decide which hypotheses are fitted, how far, and how they are scored held out."""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import rule

_STEPS = "Fewer: a hypothesis is judged before it is fitted. More: time."
_COUNT = "Fewer: the true effect can be dropped after a bad start. More: time."


@dataclass(frozen=True, slots=True)
class SearchRules:
    """How many hypotheses are tried, and how hard."""

    tolerance_reach: float = rule(
        1.05,
        unit="of the tolerance",
        decides="How far re-tuning may move a nominal parameter.",
        trades="Smaller: a parameter that is off by the whole tolerance looks like an effect. "
        "Larger: small effects are re-tuned away.",
    )
    tolerance_size: float = rule(
        0.3,
        unit="of the tolerance",
        decides="What counts as a sizeable change of a nominal parameter; sets the difference step "
        "and the damping of its fit.",
        trades="Numerical: the fit takes other steps.",
    )
    behind: float = rule(
        6.0,
        unit="level",
        decides="How far a candidate may trail the leader before it is dropped; twice this after "
        "the screening.",
        trades="Smaller: the true effect is dropped after a bad start. Larger: time.",
    )
    screening_steps: int = rule(
        3,
        unit="steps",
        decides="Steps of every candidate's fit before the candidates are compared.",
        trades=_STEPS,
        origin="Two at first; raised to three after misses in the withheld check of seed "
        "3727343088.",
    )
    refine_steps: int = rule(
        5, unit="steps", decides="Further steps of the leading candidates.", trades=_STEPS
    )
    finish_steps: int = rule(
        8, unit="steps", decides="Last steps of the leading candidates.", trades=_STEPS
    )
    settled_steps: int = rule(
        12,
        unit="steps",
        decides="Steps by which a hypothesis is fitted to its end before another effect is added.",
        trades=_STEPS,
    )
    nominal_steps: int = rule(
        6, unit="steps", decides="Steps that re-tune the nominal parameters alone.", trades=_STEPS
    )
    first_screened: int = rule(
        10, unit="-", decides="Single effects that are fitted further.", trades=_COUNT
    )
    first_finished: int = rule(
        5, unit="-", decides="Single effects that are fitted to their end.", trades=_COUNT
    )
    further_screened: int = rule(
        8, unit="-", decides="Further effects that are fitted further.", trades=_COUNT
    )
    further_finished: int = rule(
        4, unit="-", decides="Further effects that are fitted to their end.", trades=_COUNT
    )
    challenge_screened: int = rule(
        4,
        unit="-",
        decides="Effects fitted further in place of one that was already chosen.",
        trades=_COUNT,
    )
    challenge_finished: int = rule(
        3,
        unit="-",
        decides="Effects fitted to their end in place of one that was already chosen.",
        trades=_COUNT,
    )
    challenge_gain: float = rule(
        1.0,
        unit="level",
        decides="Fall of the level by a further effect from which the effects chosen before it are "
        "challenged.",
        trades="Larger: a first effect that was wrong stays. Smaller: time.",
    )
    most_effects: int = rule(
        3,
        unit="effects",
        decides="Effects that a hypothesis holds at most.",
        trades="Fewer: rigs with several effects become `unknown`. More: time, and mopping up.",
    )
    left_to_explain: float = rule(
        2.5,
        unit="RMS over floor",
        decides="Error of the worst channel from which a further effect is sought.",
        trades="Larger: small second effects are never sought. Smaller: time, and more chances for "
        "a surplus effect.",
    )
    level_to_explain: float = rule(
        1.0,
        unit="level",
        decides="Level of the best hypothesis from which a further effect is sought.",
        trades="As for `left_to_explain`.",
    )
    finalists_one: int = rule(
        8, unit="-", decides="Hypotheses of one effect that are scored held out.", trades=_COUNT
    )
    finalists_two: int = rule(
        5, unit="-", decides="Hypotheses of two effects that are scored held out.", trades=_COUNT
    )
    finalists_three: int = rule(
        3, unit="-", decides="Hypotheses of three effects that are scored held out.", trades=_COUNT
    )
    restarts: int = rule(
        3,
        unit="-",
        decides="How often a hypothesis is fitted anew from the written numbers, at most, before "
        "it is reported.",
        trades="Fewer: parameters caught at the ends of their tolerance stay there. More: time.",
        origin="Introduced after the check of seed 1097762585, because the start of the search can "
        "trap re-tuned parameters at their tolerance; the number is hand-set.",
    )
    restart_gain: float = rule(
        1.0,
        unit="log likelihood",
        decides="Fall of the objective for which fitting anew goes on.",
        trades="Larger: fewer restarts. Smaller: time.",
        origin="As for `restarts`; one unit of the log likelihood.",
    )
    restart_steps: int = rule(
        25,
        unit="steps",
        decides="Steps of each of these fits at most.",
        trades=_STEPS,
        origin="As for `restarts`.",
    )
    restart_tolerance: float = rule(
        1e-5,
        unit="of the mean log error",
        decides="Fall of the objective below which such a fit ends.",
        trades="Larger: fits end early. Smaller: time.",
        origin="As for `restarts`.",
    )
    fold_time: float = rule(
        4.0,
        unit="s",
        decides="Length of the blocks that belong to one fold in turn.",
        trades="Shorter: guards eat the data. Longer: the folds see different motions.",
    )
    guard: float = rule(
        0.9,
        unit="s",
        decides="Time left out at each border of the folds.",
        trades="Shorter: a fold knows what the other one remembers. Longer: less data.",
        origin="Three horizons of the observer: e^-3, or 5 %, of an error is left.",
    )
    score_time: float = rule(
        1.0,
        unit="s",
        decides="Length of the blocks whose errors are compared and resampled.",
        trades="Shorter: neighbouring blocks are correlated. Longer: too few blocks.",
    )
    fold_steps: int = rule(
        2,
        unit="steps",
        decides="Steps by which a fit to everything is fitted to one fold.",
        trades="Fewer: the score is not quite held out. More: time.",
    )
