"""Cases of the oracle for the length-force models: contraction, extension, bidirectional."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from pam_model.muscles.braid import NEUTRAL_ANGLE, ThinCylinder
from pam_model.muscles.braid_limits import BraidLimits
from pam_model.muscles.models.al_fahaam import AlFahaam, design_pair_forces
from pam_model.muscles.models.al_ibadi import AlIbadi, extension_factor
from pam_model.muscles.models.ashwin_ghosal import AshwinGhosal
from pam_model.muscles.models.braid_bladder import BraidBladder
from pam_model.muscles.models.caldwell_cells import CaldwellCells
from pam_model.muscles.models.doumit_fahim import DoumitFahim
from pam_model.muscles.models.extensible_braid import ExtensibleBraid
from pam_model.muscles.models.extensible_braid import thread_tension as tension_of_thread
from pam_model.muscles.models.hunt_sigmoid import HuntSigmoid
from pam_model.muscles.models.sarosi import Sarosi
from pam_model.muscles.models.schulte import Schulte
from pam_model.muscles.models.tondu_lopez_friction import TonduLopezFriction
from pam_model.muscles.models.variable_thread_angle import VariableThreadAngle
from pam_model.muscles.models.zheng_shen import ZhengShen

Numbers = Mapping[str, Any]
Case = Callable[[Numbers], Numbers]
CASES: dict[str, Case] = {}


def case(function: Case) -> Case:
    """Enter a case under the name of the function."""
    CASES[function.__name__] = function
    return function


@case
def ideal_stroke_limit(given: Numbers) -> Numbers:
    muscle = VariableThreadAngle(0.2, 0.02, given["theta0"])
    return {
        "theta_star": NEUTRAL_ANGLE,
        "L_ratio": muscle.free_length_ratio,
        "contraction_max": muscle.free_contraction,
    }


@case
def thread_tension(given: Numbers) -> Numbers:
    length = given["b"] * math.cos(given["theta"])
    return {"T": tension_of_thread(given["P"], given["b"], given["n"], length, given["N"])}


@case
def extensible_braid(given: Numbers) -> Numbers:
    muscle = ExtensibleBraid(given["b0"], given["n"], given["N"], given["EA"])
    return {
        "b": muscle.stretched_thread(given["P"], given["L"]),
        "F": muscle.force(given["P"], given["L"]),
    }


@case
def schulte(given: Numbers) -> Numbers:
    thread = given["n"] * math.pi * given["D90"]
    muscle = Schulte(
        thread,
        given["n"],
        bladder_length=given["L_rest"],
        bladder_diameter=given["D_rest"],
        axial_constant=given["k_e"],
        hoop_constant=given["k_e"],
        friction=given["mu_s"] + given["mu_st"],
    )
    length = thread * math.cos(given["gamma"])
    loss = muscle.friction(given["P_c"], length)
    return {"F": muscle.force(given["P"], length) - given["shortening"] * loss}


@case
def tondu_lopez_friction(given: Numbers) -> Numbers:
    thread = given["l0"] / math.cos(given["theta0"])
    turns = thread * math.sin(given["theta0"]) / (2.0 * math.pi * given["r0"])
    muscle = TonduLopezFriction(
        thread,
        turns,
        given["l0"],
        static_friction=given["f_s"],
        kinetic_friction=given["f_k"],
        friction_speed=given["v_s"],
    )
    length = given["l0"] * (1.0 - given["eps"])
    velocity = -given["shortening_velocity"]
    return {
        "F": muscle.force(given["P"], length, velocity),
        "S_contact": muscle.contact_area(length),
        "mu": muscle.friction_coefficient(velocity),
    }


@case
def al_ibadi_q(given: Numbers) -> Numbers:
    rest, pressure = 0.2, given["p_bar"] * 1e5
    thread = rest / math.cos(given["theta0"])
    turns = thread * math.sin(given["theta0"]) / (2.0 * math.pi * given["r0"])
    muscle = AlIbadi(thread, turns, rest)
    return {
        "q": extension_factor(pressure),
        "F": muscle.force(pressure, rest * (1.0 + given["eps_ext"])),
    }


@case
def caldwell_cells(given: Numbers) -> Numbers:
    muscle = CaldwellCells(given["A"], given["B"], given["l"])
    length = float(muscle.length(given["alpha"]))
    return {
        "L": length,
        "D": muscle.diameter(given["alpha"]),
        "b": muscle.thread_length,
        "n": muscle.turns,
        "F": muscle.force(given["P"], length),
    }


@case
def davis_min_angle(given: Numbers) -> Numbers:
    limits = BraidLimits(given["D_s"], given["N"], given["D0"], given["b"])
    return {
        "I": limits.thread_segment,
        "theta_min": limits.minimum_angle,
        "L_max": limits.longest_length,
        "theta_lock_max": limits.lock_angle,
        "eps_range": limits.contraction_range,
    }


@case
def doumit_fahim_ends(given: Numbers) -> Numbers:
    muscle = DoumitFahim(given["b"], given["n"], given["L_z"], given["d"])
    state = muscle.state(given["L_m"])
    return {
        "D": state.diameter,
        "L_L": state.cone_length,
        "L": state.length,
        "V": muscle.volume(state.length),
        "beta": muscle.cone_angle(given["L_m"]),
        "F": muscle.force(given["P"], state.length),
    }


@case
def ashwin_ghosal_kinematics(given: Numbers) -> Numbers:
    rest = given["b"] * math.cos(given["theta0"])
    muscle = AshwinGhosal(given["b"], given["N"], rest, c10=1e5, c01=1e5, wall_thickness=1e-4)
    length = muscle.length_at(given["theta"])
    axial, hoop, _ = muscle.stretches(length)
    return {
        "L0": muscle.length_at(given["theta0"]),
        "r0": muscle.radius(rest),
        "L": length,
        "r": muscle.radius(length),
        "lambda1": axial,
        "lambda2": hoop,
    }


@case
def ecpam_force(given: Numbers) -> Numbers:
    pair, contractor, annulus = design_pair_forces(
        given["b_c"],
        given["n_c"],
        contractor_pressure=given["P_c"],
        extensor_pressure=given["P_e"],
        contractor_angle=given["theta_c"],
        extensor_angle=given["theta_e"],
        length_ratio=given["dLc_dL"],
    )
    return {"F": pair, "F_c": contractor, "F_e_annulus_ext": annulus}


@case
def ecpam_common_length(given: Numbers) -> Numbers:
    muscle = AlFahaam(
        ThinCylinder(given["b_c"], given["n_c"]),
        ThinCylinder(given["b_e"], given["n_e"]),
        given["P_e"],
    )
    return {
        "F": muscle.force(given["P_c"], given["L"]),
        "K": muscle.pair_stiffness(given["P_c"], given["P_e"], given["L"]),
    }


@case
def sleeve_muscle(given: Numbers) -> Numbers:
    thread = given["n"] * math.pi * given["D90"]
    muscle = ZhengShen(thread, given["n"], given["d_i"], given["d_ext"], given["P_ext"])
    length = thread * math.cos(given["theta"])
    push = muscle.push(given["P_ext"])
    net = muscle.force(given["P"], length)
    return {
        "F_contract": net + push,
        "F_extend": push,
        "F_net": net,
        "V2_over_V": muscle.gas_ratio(length),
    }


@case
def hunt_sigmoid(given: Numbers) -> Numbers:
    muscle = HuntSigmoid(0.25, 2.0, 0.23, given["eps_max"])
    return {"P": muscle.pressure(given["F"], given["eps"], given["S"])}


@case
def sarosi_exponential(given: Numbers) -> Numbers:
    constants = {f"a{number}": value for number, value in enumerate(given["a"], start=1)}
    muscle = Sarosi(0.25, 2.0, 0.2, **constants)
    length = 0.2 * (1.0 - given["kappa_pct"] / 100.0)
    return {"F": muscle.force(given["p_kPa"] * 1e3, length)}


@case
def mooney_rivlin_bladder(given: Numbers) -> Numbers:
    muscle = BraidBladder(
        given["b"],
        given["n"],
        given["L0"],
        c10=given["C10"],
        c01=given["C01"],
        bladder_volume=given["V_b"],
    )
    return {
        "F": muscle.force(given["P"], given["L"]),
        "F_bladder": muscle.bladder.force(given["L"]),
    }
