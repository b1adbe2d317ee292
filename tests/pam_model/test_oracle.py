"""The models against numbers of an independent derivation (50 digits), formula by formula.

A case takes a vector's inputs and returns its outputs under the oracle's names. The file can be
replaced by another with the environment variable PAM_ORACLE.
"""

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from pam_model import gas
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.joints.joint_statics import JointStatics
from pam_model.muscles import braid
from pam_model.muscles.models.chou_hannaford import ChouHannaford
from pam_model.muscles.models.gaylord import Gaylord
from pam_model.muscles.models.tondu_lopez import TonduLopez
from support import oracle_bending_and_supply, oracle_length_force

Numbers = Mapping[str, Any]
Case = Callable[[Numbers], Numbers]

_PATH = Path(os.environ.get("PAM_ORACLE", Path(__file__).with_name("oracle.json")))
ORACLE: dict[str, Any] = json.loads(_PATH.read_text(encoding="utf-8"))["models"]
CASES: dict[str, Case] = {**oracle_length_force.CASES, **oracle_bending_and_supply.CASES}


def case(model: str) -> Callable[[Case], Case]:
    """Register a case for one model of the oracle."""

    def enter(function: Case) -> Case:
        assert model not in CASES, f"two cases for {model}"
        CASES[model] = function
        return function

    return enter


# --- section 1: the ideal cylinder ---


@case("braid_geometry")
def _(given: Numbers) -> Numbers:
    length = given["b"] * math.cos(given["theta"])
    return {
        "L": length,
        "D": braid.braid_diameter(given["b"], given["n"], length),
        "V": Gaylord(given["b"], given["n"]).volume(length),
    }


@case("gaylord_chou_force")
def _(given: Numbers) -> Numbers:
    return {"F": Gaylord(given["b"], given["n"]).force(given["P"], given["L"])}


@case("gaylord_force_D90")
def _(given: Numbers) -> Numbers:
    thread = given["D90"] * math.pi
    return {"F": Gaylord(thread, 1.0).force(given["P"], thread * math.cos(given["theta"]))}


@case("stiffness_constant_pressure")
def _(given: Numbers) -> Numbers:
    return {"K": Gaylord(given["b"], given["n"]).stiffness(given["P"], given["L"])}


@case("stiffness_closed_chamber")
def _(given: Numbers) -> Numbers:
    return {
        "K": Gaylord(given["b"], given["n"]).closed_stiffness(
            given["P_abs"] - given["P_atm"],
            given["L"],
            dead_volume=given["V_dead"],
            ambient_pressure=given["P_atm"],
            exponent=given["polytropic"],
        )
    }


# --- sections 2 and 4 ---


@case("chou_thick_wall")
def _(given: Numbers) -> Numbers:
    muscle = ChouHannaford(given["b"], given["n"], given["t_k"])
    length = given["b"] * math.cos(given["theta"])
    return {
        "F": muscle.force(given["P"], length),
        "K": muscle.stiffness(given["P"], length),
    }


@case("tondu_lopez")
def _(given: Numbers) -> Numbers:
    # the rest length is arbitrary: neither it nor the turns enter the force
    rest = 0.2
    thread = rest / math.cos(given["theta0"])
    turns = thread * math.sin(given["theta0"]) / (2.0 * math.pi * given["r0"])
    muscle = TonduLopez(thread, turns, rest, given["k"])
    return {
        "F": muscle.force(given["P"], rest * (1.0 - given["eps"])),
        "eps_max": muscle.maximum_contraction,
    }


# --- section 14: gas ---


@case("iso6358_flow")
def _(given: Numbers) -> Numbers:
    return {
        "mdot": gas.mass_flow(given["C"], given["b"], given["p_up"], given["p_down"], given["T_up"])
    }


@case("isentropic_orifice")
def _(given: Numbers) -> Numbers:
    return {
        "mdot": gas.orifice_flow(
            given["C_d"], given["A"], given["p_up"], given["p_down"], given["T_up"]
        ),
        "r_crit": gas.critical_pressure_ratio(),
    }


@case("chamber_polytropic")
def _(given: Numbers) -> Numbers:
    return {
        "Pdot": gas.pressure_rate(
            given["mdot"],
            given["P_abs"],
            given["V"],
            given["Vdot"],
            temperature=given["T"],
            exponent=given["polytropic"],
        )
    }


# --- section 17: two muscles on a joint ---


@case("antagonistic_joint")
def _(given: Numbers) -> Numbers:
    muscle = Gaylord(given["b"], given["n"])
    joint = JointStatics(
        [JointMuscle(muscle, given[length], 0.0, 1e6) for length in ("L1_0", "L2_0")],
        [given["r"], -given["r"]],
    )
    at = (given["P1"], given["P2"]), given["phi"]
    return {"tau": joint.torque(*at), "K_phi": joint.stiffness(*at)}


# --- the comparison ---

VECTORS = [
    pytest.param(model, number, id=f"{model}-{number}")
    for model in ORACLE
    for number in range(len(ORACLE[model]["vectors"]))
]


@pytest.mark.parametrize(("model", "number"), VECTORS)
def test_vector(model: str, number: int) -> None:
    assert model in CASES, f"no case computes {model}"
    entry = ORACLE[model]
    vector = entry["vectors"][number]
    got = CASES[model](vector["in"])
    assert set(got) == set(vector["out"])
    for name, expected in vector["out"].items():
        assert got[name] == pytest.approx(expected, rel=entry["rtol"], abs=entry["atol"]), name


def test_unknown_model_fails_and_path_is_read(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    model = next(iter(ORACLE))
    path = tmp_path / "vectors.json"
    one = {model: {**ORACLE[model], "vectors": ORACLE[model]["vectors"][:1]}}
    path.write_text(
        json.dumps({"models": {**one, "no_such_model": ORACLE[model]}}), encoding="utf-8"
    )
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "-k",
            "test_vector",
            str(Path(__file__)),
        ],
        cwd=pytestconfig.rootpath,
        env=os.environ | {"PAM_ORACLE": str(path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 1, done.stdout + done.stderr
    assert "no case computes no_such_model" in done.stdout
    assert "1 passed" in done.stdout


def test_all_cases_have_vectors() -> None:
    assert not (set(CASES) - set(ORACLE))
