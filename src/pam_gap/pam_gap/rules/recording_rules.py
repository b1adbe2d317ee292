"""Constants that decide how noisy a channel is and whether it was measured at all."""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import NUMERICAL, rule


@dataclass(frozen=True, slots=True)
class RecordingRules:
    """How the noise of a channel is estimated from the recording alone."""

    stretch: int = rule(
        64,
        unit="samples",
        decides="Length of the stretches over which the third differences are averaged; the median "
        "of the stretches is the noise.",
        trades="Shorter stretches give a noisier estimate, longer ones let events into it.",
        origin=NUMERICAL,
    )
    smoothed_ratio: float = rule(
        0.5,
        unit="-",
        decides="A channel whose fifth differences fall below this share of its third differences "
        "counts as filtered before it was recorded; white noise gives 1.",
        trades="Larger: white channels are taken for filtered ones. Smaller: the noise of a "
        "filtered channel is underestimated and its errors look like a gap.",
    )
    smoothed_share: float = rule(
        1e-3,
        unit="of the span",
        decides="Noise that a filtered channel is taken to have, since it cannot be seen.",
        trades="Larger hides gaps in filtered channels, smaller invents them.",
    )
    cleanest_share: float = rule(
        1e-5,
        unit="of the span",
        decides="A channel with less noise than this is treated as filtered.",
        trades="Larger: good sensors are taken for filtered ones. Smaller: a computed or constant "
        "channel gets a floor near zero and any rounding counts as a gap.",
    )
    visible_resolution: float = rule(
        0.3,
        unit="of the deviation",
        decides="Quantisation steps below this share of the noise do not stand against a channel "
        "being filtered.",
        trades="Larger: coarsely quantised channels can be taken for filtered ones.",
    )
    valid_share: float = rule(
        0.9,
        unit="of the samples",
        decides="With more true samples than this the noise is taken from the even grid and gaps "
        "are left out; with fewer, from the true samples in a row.",
        trades="Matters only for recordings with many missing samples.",
    )
    few_values: float = rule(
        0.2,
        unit="of the steps",
        decides="A channel counts as quantised when its steps have fewer distinct sizes than this.",
        trades="Larger: a smooth channel can be taken for a quantised one.",
    )
    whole_step: float = rule(
        0.15,
        unit="of a step",
        decides="How far a change may be from a whole number of quantisation steps.",
        trades="Smaller: rounded decimals in a table hide the quantisation.",
    )
    whole_step_share: float = rule(
        0.9,
        unit="of the changes",
        decides="Share of the changes that must be whole numbers of quantisation steps.",
        trades="Smaller: a smooth channel can be taken for a quantised one.",
    )
    computed_difference: float = rule(
        1e-2,
        unit="of the span",
        decides="A recorded force that differs from the nominal model's answer by less than this "
        "(median) may be computed instead of measured.",
        trades="Larger: load cells on a rig without a gap are left out. Smaller: forces that a "
        "node computed count as measurements and agree with the nominal model by construction.",
    )
    computed_noise: float = rule(
        0.5,
        unit="of the noise",
        decides="Noise of that difference, over the noise of the force, below which the force has "
        "no noise of its own and is left out as computed.",
        trades="As for `computed_difference`.",
    )
