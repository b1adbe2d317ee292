"""Cases of the oracle for bending, phenomenological and empirical models, losses and supply."""

from collections.abc import Callable, Mapping
from typing import Any

from pam_model.atlas.bending.extensor_bending import ExtensorBending
from pam_model.atlas.bending.inflated_beam import InflatedBeam
from pam_model.atlas.bending.reinforced_braid import arc_from_lengths
from pam_model.atlas.bending.three_muscle_segment import ThreeMuscleSegment
from pam_model.atlas.losses.bouc_wen import BoucWen
from pam_model.atlas.losses.maxwell_slip import MaxwellSlip
from pam_model.atlas.losses.prandtl_ishlinskii import PrandtlIshlinskii
from pam_model.atlas.losses.standard_linear_solid import StandardLinearSolid
from pam_model.atlas.phenomenological.colbrunn import ColbrunnMuscle
from pam_model.atlas.phenomenological.three_element import ThreeElementMuscle, serres_coefficients
from pam_model.atlas.supply.fill_time import fill_time
from pam_model.atlas.supply.thermal_chamber import ThermalChamber
from pam_model.atlas.supply.tube import StraightTube
from pam_model.muscles.models.wickramatunge import Wickramatunge

Numbers = Mapping[str, Any]
Case = Callable[[Numbers], Numbers]
CASES: dict[str, Case] = {}


def case(function: Case) -> Case:
    """Enter a case under the name of the function."""
    CASES[function.__name__] = function
    return function


@case
def ebpam_bending(given: Numbers) -> Numbers:
    muscle = ExtensorBending(given["b"], given["n"], given["theta_max"], given["t_c"])
    state = muscle.state(given["P"], given["theta"])
    return {
        "L_n": state.free_length,
        "L_o": state.fixed_length,
        "L_c": state.middle_length,
        "D_out": state.diameter,
        "D_in": state.bore,
        "alpha": state.angle,
        "V": state.volume,
        "M": state.moment,
    }


@case
def arc_from_lengths_(given: Numbers) -> Numbers:
    angle, curvature = arc_from_lengths(given["L_o"], given["L_n"], given["D"])
    return {"alpha": angle, "kappa_mid": curvature}


CASES["arc_from_lengths"] = CASES.pop("arc_from_lengths_")


@case
def three_muscle_constant_curvature(given: Numbers) -> Numbers:
    arc = ThreeMuscleSegment(given["d"]).arc([given["l1"], given["l2"], given["l3"]])
    return {"s": arc.length, "kappa": arc.curvature}


@case
def inflated_beam_wrinkled(given: Numbers) -> Numbers:
    beam = InflatedBeam(given["r"], given["E"], given["t"])
    moment, curvature = beam.wrinkled(given["P"], given["phi0"])
    return {"M": moment, "kappa": curvature}


@case
def three_element_step(given: Numbers) -> Numbers:
    muscle = ThreeElementMuscle(given["M"], given["B"], given["K"], given["F_ce"])
    shortening, speed = muscle.step_response(given["load"], given["t"])
    return {"y": shortening, "ydot": speed, "y_ss": muscle.final_shortening(given["load"])}


@case
def serres_coefficients_(given: Numbers) -> Numbers:
    found = serres_coefficients(1e3 * given["P_kPa"], contracting=given["contracting"])
    return {
        "K_N_per_mm": 1e-3 * found.stiffness,
        "B_Ns_per_mm": 1e-3 * found.damping,
        "F_ce_N": found.contractile_force,
        "K_SI": found.stiffness,
        "B_SI": found.damping,
    }


CASES["serres_coefficients"] = CASES.pop("serres_coefficients_")


@case
def colbrunn_parallel(given: Numbers) -> Numbers:
    muscle = ColbrunnMuscle(given["k"], given["B"], given["F_c"])
    return {"F": muscle.force(given["x"], given["xdot"])}


@case
def wickramatunge_stiffness(given: Numbers) -> Numbers:
    constants = {key: given[key] for key in ("a0", "a1", "a2", "a3")}
    muscle = Wickramatunge(1.0, 2.0, 0.5, {**constants, "zero_force_ratio": 1.0})
    pressure, stretch = given["P"], given["L_s"]
    return {
        "K": muscle.secant_stiffness(pressure, stretch),
        "F": muscle.force(pressure, 0.5 + stretch),
        "dFdLs": muscle.stiffness(pressure, 0.5 + stretch),
    }


@case
def maxwell_slip(given: Numbers) -> Numbers:
    element = MaxwellSlip(given["k"], given["W"])
    return {"F": [element.update(x) for x in given["x"]]}


@case
def prandtl_ishlinskii_play(given: Numbers) -> Numbers:
    element = PrandtlIshlinskii(given["r"], given["w"])
    return {"y": [element.update(x) for x in given["x"]]}


@case
def bouc_wen_n1(given: Numbers) -> Numbers:
    element = BoucWen(given["A"], given["beta"], given["gamma"])
    loaded = element.update(given["x_load"])
    return {"z_load": loaded, "z_unload": element.update(given["x_unload_to"])}


@case
def sls_creep(given: Numbers) -> Numbers:
    solid = StandardLinearSolid(given["E1"], given["E2"], given["eta"])
    return {"strain": solid.strain(given["sigma"], given["t"])}


@case
def isothermal_fill_time(given: Numbers) -> Numbers:
    time = fill_time(
        given["V"],
        given["C"],
        given["b"],
        supply_pressure=given["p_supply"],
        start_pressure=given["p_start"],
        end_pressure=given["p_end"],
        temperature=given["T"],
    )
    return {"t_fill": time}


@case
def tube_laminar(given: Numbers) -> Numbers:
    tube = StraightTube(given["L_t"], given["D"], given["T"])
    flow = tube.laminar_flow(given["p1"], given["p2"])
    return {
        "mdot_laminar": flow,
        "delay": tube.delay,
        "reynolds": tube.reynolds(flow),
        "attenuation": tube.attenuation(given["p1"]),
    }


@case
def chamber_thermal(given: Numbers) -> Numbers:
    chamber = ThermalChamber(given["h"], given["A"], given["T_wall"])
    pressure_rate, temperature_rate = chamber.rates(
        given["P_abs"],
        given["T"],
        volume=given["V"],
        volume_rate=given["Vdot"],
        inflow=given["mdot_in"],
        inflow_temperature=given["T_in"],
        outflow=given["mdot_out"],
    )
    return {"Pdot": pressure_rate, "Tdot": temperature_rate}
