"""Constants that decide what a prediction error is, and how a fit makes it small."""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import DECISION, NUMERICAL, rule


@dataclass(frozen=True, slots=True)
class PredictionRules:
    """How the plant is run along a recording and fitted to it."""

    horizon: float = rule(
        0.3,
        unit="s",
        decides="Time in which the observer lets an error of the pressures fade.",
        trades="Shorter: slow effects (leak, creep, temperature) are corrected away before they "
        "show. Longer: errors add up and the first cause hides the second.",
    )
    settling: float = rule(
        1.5,
        unit="s",
        decides="Time at the start of a recording that no score counts.",
        trades="Shorter: the unknown initial state looks like a gap. Longer: short recordings lose "
        "most of their data.",
    )
    block: int = rule(
        4,
        unit="samples",
        decides="Samples averaged into one row of prediction errors.",
        trades="Larger: less noise and time, but delays of a few samples blur.",
    )
    step: float = rule(
        2e-3,
        unit="s",
        decides="Longest step of the integration.",
        trades="Larger steps are faster and less exact; 0.5 ms gives the same errors to 1e-4 of "
        "their size.",
        origin="Numerical setting, checked against a step of 0.5 ms.",
    )
    catch_time: float = rule(
        1.0,
        unit="s",
        decides="Time at the start in which the predicted motion is pulled to the measured one.",
        trades="Shorter: a joint that is still swinging starts with a false motion.",
    )
    catch_bandwidth: float = rule(
        15.0,
        unit="rad/s",
        decides="Bandwidth of that pull.",
        trades="Larger values follow the noise, smaller ones do not catch the motion in time.",
    )
    least_floor: float = rule(
        0.05,
        unit="of the white noise, squared",
        decides="Least mean square error that the noise is taken to leave in a channel.",
        trades="Larger hides small gaps in channels that the observer corrects strongly, smaller "
        "lets rounding count.",
    )
    force_bandwidth: float = rule(
        3.0,
        unit="rad/s",
        decides="Pull of the measured motion on the motion predicted from measured forces.",
        trades="Larger: slow torque errors are corrected away. Smaller: the prediction drifts.",
    )
    stage_from: float = rule(
        1.5,
        unit="RMS over floor",
        decides="Gap of a stage, fed its measured inputs, from which the verdict `unknown` names "
        "that stage.",
        trades="Larger: fewer stages are named. Smaller: stages are named for noise.",
        acts=DECISION,
    )
    fit_difference: float = rule(
        0.03,
        unit="of a sizeable change",
        decides="Step of the forward differences that make the slopes of a fit.",
        trades="Larger: curvature enters the slopes. Smaller: rounding and stick-slip edges do.",
        origin=NUMERICAL,
    )
    fit_damping: float = rule(
        1e-3,
        unit="of the curvature",
        decides="First Levenberg damping of a fit.",
        trades="Larger: the few steps of the screening are shorter. Smaller: more steps fail.",
        origin=NUMERICAL,
    )
    fit_attempts: int = rule(
        3,
        unit="-",
        decides="Dampings that are tried from one point before a fit ends there.",
        trades="Fewer: fits end early at edges. More: time.",
        origin=NUMERICAL,
    )
    fit_tolerance: float = rule(
        1e-3,
        unit="of the mean log error",
        decides="Fall of the objective below which a fit ends.",
        trades="Larger: fits end early. Smaller: time.",
        origin=NUMERICAL,
    )
    fit_weight_floor: float = rule(
        0.5,
        unit="of the floor",
        decides="Channels that fit better than this share of their noise floor get no more weight.",
        trades="Smaller: a channel that is fitted below its noise outweighs the others.",
        origin=NUMERICAL,
    )
