"""Constants of the prediction errors and of the fit that minimises them."""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import DECISION, NUMERICAL, rule


@dataclass(frozen=True, slots=True)
class PredictionRules:
    """How the plant is simulated along a recording and fitted to it."""

    # fmt: off
    horizon: float = rule(0.3, unit="s",
        decides="Time constant with which the observer corrects an error of the pressures.",
        trades="Shorter: slow effects (leak, creep, temperature) are corrected away before they "
               "become visible. Longer: errors accumulate, and a strong effect hides a weaker "
               "one.")
    settling: float = rule(1.5, unit="s",
        decides="Time at the start of a recording that is not scored.",
        trades="Shorter: the unknown initial state looks like a gap. Longer: short recordings "
               "lose most of their data.")
    block_time: float = rule(0.01, unit="s",
        decides="Time over which samples are averaged into one row of prediction errors; a row "
                "has at least one sample.",
        trades="Longer: less noise and shorter computing time, but short delays and lags become "
               "indistinct.",
        origin="The time constant of a quick valve. It was four samples at any rate before, which "
               "hid what is quick in a slow log.")
    step: float = rule(2e-3, unit="s",
        decides="Longest step of the integration.",
        trades="Larger: faster and less accurate. A step of 0.5 ms changes the errors by 1e-4 of "
               "their size.",
        origin="Numerical setting, checked against a step of 0.5 ms.")
    catch_time: float = rule(1.0, unit="s",
        decides="Time at the start of a recording in which the predicted motion is corrected "
                "towards the measured one.",
        trades="Shorter: the prediction starts with a wrong motion where the joint still swings.")
    catch_bandwidth: float = rule(15.0, unit="rad/s",
        decides="Bandwidth of the correction during `catch_time`.",
        trades="Larger: the correction follows the noise. Smaller: it does not reach the "
               "measured motion in time.")
    least_floor: float = rule(0.05, unit="of the white noise, squared",
        decides="Lower bound of the mean squared error that noise alone is assumed to cause.",
        trades="Larger: small gaps are hidden in channels that the observer corrects strongly. "
               "Smaller: rounding errors count as a gap.")
    force_bandwidth: float = rule(3.0, unit="rad/s",
        decides="Bandwidth with which the motion predicted from measured forces is corrected "
                "towards the measured motion.",
        trades="Larger: slow torque errors are corrected away. Smaller: the prediction drifts.")
    stage_from: float = rule(1.5, unit="RMS over floor",
        decides="Smallest gap of a stage, computed from its measured inputs, for which the "
                "verdict `unknown` names the stage.",
        trades="Larger: fewer stages are named. Smaller: noise can cause a stage to be named.",
        acts=DECISION)
    fit_difference: float = rule(0.03, unit="of a typical change",
        decides="Step of the forward differences that approximate the Jacobian of a fit.",
        trades="Larger: curvature distorts the Jacobian. Smaller: rounding and stick-slip "
               "distort it.",
        origin=NUMERICAL)
    fit_damping: float = rule(1e-3, unit="of the curvature",
        decides="Initial Levenberg damping of a fit.",
        trades="Larger: the few steps of the screening are shorter. Smaller: more steps fail.",
        origin=NUMERICAL)
    fit_attempts: int = rule(3, unit="-",
        decides="Number of dampings that are tried at one point before the fit ends there.",
        trades="Fewer: fits end early at points that are not smooth. More: the diagnosis takes "
               "longer.",
        origin=NUMERICAL)
    fit_tolerance: float = rule(1e-3, unit="of the mean log error",
        decides="Decrease of the objective in one step below which a fit ends.",
        trades="Larger: fits end early. Smaller: the diagnosis takes longer.",
        origin=NUMERICAL)
    fit_promise: float = rule(0.7, unit="of the promised decrease",
        decides="Decrease by a step, relative to what its Jacobian promised, above which the "
                "next step reuses the columns of the nominal parameters.",
        trades="Larger: the diagnosis takes longer. Smaller: more steps with outdated columns.",
        origin=NUMERICAL)
    fit_weight_floor: float = rule(0.5, unit="of the floor",
        decides="Mean squared error below which the weight of a channel no longer increases.",
        trades="Smaller: a channel whose error is below its noise outweighs the others.",
        origin=NUMERICAL)
    # fmt: on
