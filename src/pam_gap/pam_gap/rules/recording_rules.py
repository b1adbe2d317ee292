"""Constants that decide how noisy a channel is and whether it was measured or computed."""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import NUMERICAL, proposal_rule, rule


@dataclass(frozen=True, slots=True)
class RecordingRules:
    """How the noise of a channel is estimated from the recording alone."""

    # fmt: off
    stretch: int = rule(64, unit="samples",
        decides="Length of the segments over which squared third differences are averaged; the "
                "median over the segments gives the noise.",
        trades="Shorter: the estimate is noisier. Longer: single events raise the estimate.",
        origin=NUMERICAL)
    smoothed_ratio: float = rule(0.5, unit="-",
        decides="Ratio of the fifth to the third differences below which a channel counts as "
                "filtered before it was recorded; white noise gives 1.",
        trades="Larger: channels with white noise count as filtered. Smaller: the noise of a "
               "filtered channel is underestimated and its errors look like a gap.")
    smoothed_share: float = rule(1e-3, unit="of the span",
        decides="Noise that is assumed for a filtered channel, because it cannot be estimated.",
        trades="Larger: gaps in filtered channels are hidden. Smaller: gaps are reported that do "
               "not exist.")
    cleanest_share: float = rule(1e-5, unit="of the span",
        decides="Noise below which a channel is treated as filtered.",
        trades="Larger: good sensors count as filtered. Smaller: a computed or constant channel "
               "gets a noise floor near zero, and rounding errors count as a gap.")
    visible_resolution: float = rule(0.3, unit="of the deviation",
        decides="Quantisation step, relative to the noise, below which a channel can count as "
                "filtered.",
        trades="Larger: coarsely quantised channels can count as filtered.")
    valid_share: float = rule(0.9, unit="of the samples",
        decides="Share of true samples above which the noise is estimated on the even time grid "
                "without the gaps; below it, the true samples are joined.",
        trades="Matters only in recordings with many missing samples.")
    fewest_steps: int = rule(20, unit="changes",
        decides="Number of changes of a channel below which its quantisation step is its "
                "smallest change.",
        trades="Larger: the step of a channel that seldom changes is overestimated.",
        origin=NUMERICAL)
    few_values: float = rule(0.2, unit="of the steps",
        decides="Number of distinct step sizes, relative to the number of steps, below which a "
                "channel counts as quantised.",
        trades="Larger: a smooth channel can count as quantised.")
    whole_step: float = rule(0.15, unit="of a step",
        decides="Largest deviation of a change from a whole number of quantisation steps.",
        trades="Smaller: quantisation is not recognised where a table holds rounded decimals.")
    whole_step_share: float = rule(0.9, unit="of the changes",
        decides="Share of the changes that must be whole numbers of quantisation steps.",
        trades="Smaller: a smooth channel can count as quantised.")
    least_seconds: float = rule(6.0, unit="s",
        decides="Time that counts in the channel with the most of it, below which the verdict is "
                "`not_identifiable`.",
        trades="Larger: short recordings get no answer. Smaller: an effect can be named that "
               "happened to fit a few seconds.",
        origin="Derived: both folds need at least three score blocks of 1 s each to be compared.")
    short_seconds: float = proposal_rule(13.5, unit="s",
        decides="Time that counts below which an answer carries a warning.",
        trades="Larger: more answers carry it. Smaller: answers from little data carry none.",
        origin="Three whole pairs of folds of 4 s, less their guards: recordings of 15 s.")
    wanted_range: float = proposal_rule(0.5, unit="of the joint's range",
        decides="Share of its range that a joint should use in a recording. An answer without a "
                "cause carries a warning below it.",
        trades="Larger: more answers carry it. Smaller: a load that hardly acts in a small "
               "motion may be missed without a warning.",
        origin="Chosen by hand.")
    jagged_commands: float = proposal_rule(0.15, unit="of the pressure's noise",
        decides="Change of a pressure within a row by what a valve command deviates from the "
                "mean of its neighbours. Above it, an answer warns of a log that is slower than "
                "the loop.",
        trades="Larger: fewer slow logs are warned of. Smaller: more full logs carry the warning.",
        origin="Chosen by hand: drawn logs of every command gave 0.1 or less, those of every "
               "tenth one up to 0.5. It only adds a warning.")
    fewest_changes: int = proposal_rule(40, unit="-",
        decides="Changes of the commands below which their intervals are not judged.",
        trades="Larger: fewer slow logs are warned of. Smaller: an experiment of a few steps "
               "carries the warning.",
        origin="Chosen by hand: 4 s of commands at 10 Hz. It only adds a warning.")
    even_changes: float = proposal_rule(0.8, unit="of the intervals",
        decides="Share of the intervals between changes of the commands that must be equal to "
                "warn of commands that are logged more slowly than the measurements.",
        trades="Larger: fewer slow logs are warned of. Smaller: experiments with steps carry the "
               "warning.",
        origin="Chosen by hand; it only adds a warning.")
    longest_step: float = rule(0.04, unit="s",
        decides="Sample time above which the verdict is `not_identifiable`.",
        trades="Larger: joints are judged whose motion falls between the samples. Smaller: slow "
               "logs get no answer.",
        origin="A joint swings at 2 to 5 Hz; five samples a period, as a rule of thumb.")
    dead_encoder: float = rule(0.25, unit="of the mean square",
        decides="What a free joint leaves in the pressures, over what a locked one leaves, below "
                "which a position that never changes is that of a dead encoder.",
        trades="Larger: a joint that was locked is taken for one with a dead encoder. Smaller: a "
               "dead encoder is taken for a locked joint, and a wrong cause can be named.",
        origin="Half of the RMS error; chosen by hand.")
    longest_gap: float = rule(0.3, unit="s",
        decides="Longest time without commands or pressures after which a prediction goes on; at "
                "a longer gap, a recording is cut in parts.",
        trades="Larger: what happened in a gap counts as an error of the model. Smaller: "
               "recordings with lost rows fall into parts of which the beginning does not count.",
        origin="The horizon within which predictions are corrected by the measurements.")
    spoiled_share: float = rule(0.5, unit="of the time",
        decides="Share of the time in gaps of commands or pressures, or within the horizon of "
                "the predictions after one, above which the verdict is `not_identifiable`.",
        trades="Larger: what gaps leave is taken for an unknown cause. Smaller: recordings with "
               "some gaps get no answer.",
        origin="Most of the recording, by definition.")
    told_share: float = proposal_rule(0.05, unit="of the time",
        decides="Share of the time in gaps, or of lost messages, that is reported: by `record` "
                "while it records, and as a caution of an answer.",
        trades="Larger: bad recordings are reported late. Smaller: every recording on a usual "
               "computer is said to have gaps.",
        origin="Chosen by hand; it only adds a warning.")
    shortest_part: float = rule(3.0, unit="s",
        decides="Shortest part between two gaps that is used.",
        trades="Larger: data are lost. Smaller: parts are used of which hardly anything counts.",
        origin="Twice the time at the start of a recording that never counts.")
    wrong_wiring: float = rule(0.5, unit="of the RMS error",
        decides="Share of the error of the rig as written, mean over the channels, that must "
                "disappear when swapped or reversed channels are put right; such a recording is "
                "not diagnosed.",
        trades="Larger: wrongly wired rigs are diagnosed. Smaller: a rig with strong effects is "
               "taken for a wrongly wired one.",
        origin="Half of it, by definition.")
    direction_coherence: float = rule(0.5, unit="-",
        decides="Coherence of the pressures with the commands, or of the motion with the "
                "pressures, at low frequencies, from which their phase shows the direction.",
        trades="Larger: reversed signs are reported less often. Smaller: a motion that has other "
               "causes shows a direction.",
        origin="Half of the power of one signal follows from the other.")
    bench_band: float = rule(5.0, unit="Hz",
        decides="Upper end of the band in which the pressure of a muscle on a bench must follow "
                "its command, and its force the pressure.",
        trades="Larger: the lag of valves is taken for a reversed sign. Smaller: quick motions "
               "show nothing.",
        origin="Muscles of usual sizes fill within some hundredths of a second.")
    direction_phase: float = rule(60.0, unit="deg",
        decides="Phase up to which two signals agree, and its distance from 180 degrees up to "
                "which they are opposed.",
        trades="Larger: lags of friction and hysteresis can look like a reversed sign. Smaller: "
               "nothing is said on joints with much friction.",
        origin="Derived: Coulomb friction as large as the torque of the muscles lags by 90 "
               "degrees; with friction of half of it, the lag stays below 45 degrees.")
    direction_band: float = rule(0.4, unit="of the natural frequency",
        decides="Upper end of the band in which the joint must follow the pressures like a "
                "spring.",
        trades="Larger: the inertia turns the phase. Smaller: short recordings hold no such "
               "motion.",
        origin="Derived: the phase turns at the natural frequency, which is off by a third if "
               "the stated stiffness and inertia are off by a third each, in opposite directions.")
    direction_lines: int = rule(3, unit="-",
        decides="Fewest frequencies in this band.",
        trades="Larger: short recordings show no direction. Smaller: a single frequency is "
               "always coherent.",
        origin="Two unrelated signals are coherent at one frequency.")
    direction_gain: float = rule(0.1, unit="of the RMS error",
        decides="Share of the simulation's error, mean over the channels that an exchange "
                "changes, that must disappear when it is undone, where the phases show that "
                "something is exchanged.",
        trades="Larger: reversed signs on rigs with wrong numbers are not reported. Smaller: the "
               "simulation no longer confirms the phase.",
        origin="Chosen by hand: it only has to point in the same direction as the phase.")
    same_pressure: float = rule(0.02, unit="of the pressure's deviation",
        decides="Difference of the two pressures of a joint that moves, below which both sensors "
                "are in one muscle.",
        trades="Larger: muscles that are filled together by a poor loop count as one. Smaller: "
               "two sensors of different gains in one muscle are not recognised.",
        origin="Gains of two good sensors differ by less.")
    same_motion: float = rule(0.1, unit="of the joint's range",
        decides="Motion for which the two pressures of a joint must differ.",
        trades="Larger: small motions are not judged. Smaller: a joint that is only stiffened "
               "counts as one with a wrong sensor.",
        origin="Chosen by hand; muscles of unequal size move a joint a little at equal pressures.")
    dead_opening: float = rule(0.1, unit="of the range",
        decides="Valve command above which a muscle is filled.",
        trades="Larger: a dead pressure sensor is found less often. Smaller: a leak can hold the "
               "pressure at zero while its valve is slightly open.",
        origin="Chosen by hand.")
    dead_seconds: float = rule(0.5, unit="s",
        decides="Time with such a command after which a pressure without any change is that of a "
                "dead sensor.",
        trades="As for `dead_opening`.",
        origin="A muscle fills in some tenths of a second.")
    least_excitation: float = proposal_rule(1.0, unit="RMS over floor",
        decides="Change that an effect causes at its usual size, in the second in which it is "
                "largest, below which the report says that the recording does not show this "
                "effect.",
        trades="Larger: more effects are said not to be shown. Smaller: the absence of an effect "
               "is claimed that could not be seen.",
        origin="Derived: in one second the effect changes a channel by as much as its noise.")
    clipped_samples: int = rule(16, unit="samples",
        decides="Shortest run of samples exactly at the largest or smallest value of a noisy "
                "channel that counts as clipped.",
        trades="Longer: short clippings are fitted. Shorter: equal samples by chance are left "
               "out.",
        origin=NUMERICAL)
    clipped_share: float = rule(0.01, unit="of the samples",
        decides="Smallest share of samples in such runs for which a channel counts as clipped.",
        trades="Larger: short clippings are fitted. Smaller: a coarse channel that turns at its "
               "largest value counts as clipped.",
        origin="A coarse encoder that turned slowly stood at its largest value for 0.07 % of a "
               "practice recording.")
    clipped_noise: float = rule(0.5, unit="of a step",
        decides="Noise relative to the quantisation step above which equal neighbours are no "
                "coincidence.",
        trades="Smaller: a channel at rest counts as clipped. Larger: clippings of coarse "
               "channels are not seen.",
        origin=NUMERICAL)
    frozen_time: float = rule(0.3, unit="s",
        decides="Shortest time in which a sensor repeats one value for which it can count as "
                "frozen.",
        trades="Longer: short losses of a sensor are fitted. Shorter: the samples of a coarse "
               "sensor at rest are left out.",
        origin="As `longest_gap`.")
    frozen_runs: float = rule(20.0, unit="of the median run",
        decides="The same time in runs of equal values of the channel, which are long where a "
                "slow channel is logged in the rows of a fast one. Without a jump at its end, a "
                "frozen run is that many times longer than the longest of the others.",
        trades="As for `frozen_time`.",
        origin=NUMERICAL)
    frozen_jump: float = rule(3.0, unit="of the largest usual step",
        decides="Step of a channel before or after a run of equal values, relative to the step "
                "that 0.1 % of its samples exceed and to its noise, above which its sensor was "
                "frozen.",
        trades="Larger: frozen sensors without visible noise are fitted. Smaller: a coarse "
               "sensor at rest before a quick motion is left out.",
        origin="Chosen by hand; within one sample, speeds do not treble.")
    frozen_push: float = rule(0.5, unit="of the span",
        decides="Change of the difference of the pressures during a run of equal positions that "
                "lasts to the end, relative to its span, above which the encoder was frozen.",
        trades="Larger: encoders that fail for good are fitted. Smaller: a joint that dry "
               "friction holds is taken for a dead encoder.",
        origin="Half of it; chosen by hand. Friction that holds a joint against half of all that "
               "moves it would stop every motion.")
    saturated_share: float = rule(0.5, unit="of the time",
        decides="Share of clipped samples of a channel above which the verdict is "
                "`not_identifiable`.",
        trades="Larger: answers rest on the few samples that were not clipped. Smaller: "
               "recordings with a few clipped peaks get no answer.",
        origin="Most of the recording, by definition.")
    finest_share: float = rule(6e-8, unit="of full scale",
        decides="Step below which no sensor resolves: one part in 2^24 of the supply pressure, "
                "of one turn, or of the force of the muscle at supply pressure. The noise of a "
                "channel is never assumed to be below this step divided by the square root of "
                "twelve.",
        trades="Larger: gaps in very good channels are hidden. Smaller: rounding of the "
               "simulation counts as a gap in a channel that is constant or was computed.",
        origin="The resolution of 24 bit converters.")
    still_span: float = rule(8.0, unit="of the noise",
        decides="Span of the means over `stretch` samples, relative to the noise expected in "
                "them, up to which a channel counts as constant. A position that is constant "
                "belongs to a locked joint, and a channel without any noise that is constant is "
                "not compared.",
        trades="Larger: very small motions count as no motion. Smaller: a drifting sensor on a "
               "locked joint counts as a motion.",
        origin="The largest of a few hundred means of white noise is below 4 deviations on "
               "either side.")
    computed_difference: float = rule(1e-2, unit="of the span",
        decides="Median difference between a recorded force and the nominal model's force below "
                "which the recorded force may be computed instead of measured.",
        trades="Larger: load cells on a rig without a gap are ignored. Smaller: forces that a "
               "node computed count as measurements and agree with the nominal model by "
               "construction.")
    computed_noise: float = rule(0.5, unit="of the noise",
        decides="Noise of that difference, relative to the noise of the force, below which the "
                "force has no noise of its own and is ignored as computed.",
        trades="As for `computed_difference`.")
    # fmt: on
