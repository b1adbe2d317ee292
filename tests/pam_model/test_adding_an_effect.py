"""A new effect is one file: rig file, plant, diagnosis and docs use it without another edit.

CONTRIBUTING.md shows the text below as its worked example. The file lies in a folder that the
environment variable PAM_EFFECTS names; one in pam_model/effects/ is found in the same way.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pam_model.gas import GAS_CONSTANT, reference_density
from pam_model.rig import load_rig

RIG = Path(__file__).parents[2] / "config" / "elbow.yaml"

LAMINAR_LEAK = '''
"""A leak through a narrow gap, whose flow is proportional to the pressure difference.

Source: Hagen-Poiseuille flow.
"""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Nothing, Portrait, Range, Search
from pam_model.effects.slots import Leak


def laminar_flow(
    pressure: float, ambient_pressure: float, critical_ratio: float, conductance: float
) -> float:
    """Flow out of the muscle over the reference density [m^3/s]; pressures absolute [Pa]."""
    return conductance * (pressure - ambient_pressure)


EFFECT = Effect(
    name="laminar_leak",
    order=85,
    stage="valve",
    scope="muscle",
    description="air leaves the muscle through a narrow gap",
    law="mdot = rho_0 C_g (P - P_ambient)",
    source="Hagen-Poiseuille flow",
    parameters={"conductance": EffectParameter("C_g", "m^3/(s Pa)", 0.0, 0.0, 1e-9, "of the gap")},
    slots=(Leak(laminar_flow),),
    control=Nothing("nothing, because the pressure loop corrects the error"),
    plausibility=Included("the pressure observer loses the gap's flow"),
    search=Search(
        ranges=lambda rig: {"conductance": Range(0.0, 0.1 * rig.flow, 1e-12, (0.01 * rig.flow,))},
        shown_by=("commands",),
        shows_when_shut=True,
    ),
    portrait=Portrait(
        sizes={"conductance": 2e-11},
        signature="The pressure sinks exponentially with shut valves.",
        easily_taken_for="leakage.",
        told_apart_by="Leak-downs from several pressures.",
    ),
)
'''

JOINT_SPRING = '''
"""A spring that draws the joint to its position 0."""

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Nothing, Portrait, Range, Search
from pam_model.effects.slots import JointTorque


def spring_torque(position: float, speed: float, rate: float) -> float:
    """Torque [N m]."""
    return -rate * position


EFFECT = Effect(
    name="joint_spring",
    order=205,
    stage="joint",
    scope="joint",
    description="a spring at the joint",
    law="torque = -k_q q",
    source="Hooke",
    parameters={"rate": EffectParameter("k_q", "N m/rad", 0.0, 0.0, 1e3, "of the spring")},
    slots=(JointTorque(spring_torque),),
    control=Nothing("nothing, because the integrator holds against it"),
    plausibility=Nothing("it is weak"),
    search=Search(
        ranges=lambda rig: {"rate": Range(0.0, 100.0, 1.0, (1.0,))},
        shown_by=("position",),
    ),
    portrait=Portrait({"rate": 5.0}, "The joint is stiffer.", "payload.", "A vented swing."),
)
'''

REPORT = """
import json, sys
import numpy as np
from pam_check.doc_pages.effect_tables import control_table, keys_table
from pam_check.doc_pages.effects_page import effects_page
from pam_gap.inference.candidates import candidates_for
from pam_model.plant.parameters import NAMES, PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import load_rig, rig_from_parameters

effect, parameter, place, value = json.loads(sys.argv[2])
tree = load_rig(sys.argv[1]).to_parameters()
tree[place].setdefault("effects", {})[effect] = {parameter: value}
rig = rig_from_parameters(tree)
parameters = PlantParameters.from_rig(rig)
start = initial_state(parameters, position=0.3, pressures=(2e5, 1e5))
still = simulate(
    parameters, np.zeros((26, 2)), 0.02, start, 2e-3, positions=np.zeros(26), shut=True
)
free = simulate(parameters, np.zeros((26, 2)), 1e-4, start, 1e-4)
print(json.dumps({
    "names": [name for name in NAMES if effect in name],
    "candidates": [c.label for c in candidates_for(rig, rig.joints[0])],
    "page": effects_page(),
    "tables": {scope: keys_table(scope) for scope in ("muscle", "joint")},
    "control": control_table(),
    "pressures": still.pressures.tolist(),
    "acceleration": float((free.velocity[1] - free.velocity[0]) / 1e-4),
}))
"""


def report(folder: Path, effect: str, parameter: str, place: str, value: float) -> dict[str, Any]:
    """Load an effect from `folder` in a new interpreter, with one value in the rig file.

    Without numba: what takes half a minute to compile takes a second to interpret.
    """
    environment = {**os.environ, "PAM_EFFECTS": str(folder), "PAM_NO_NUMBA": "1"}
    arguments = json.dumps([effect, parameter, place, value])
    done = subprocess.run(
        [sys.executable, "-c", REPORT, str(RIG), arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_a_new_leak_is_one_file(tmp_path: Path) -> None:
    (tmp_path / "laminar_leak.py").write_text(LAMINAR_LEAK)
    conductance = 2e-10
    found = report(tmp_path, "laminar_leak", "conductance", "elbow_flexor", conductance)

    assert found["names"] == [
        "agonist.laminar_leak.conductance",
        "antagonist.laminar_leak.conductance",
    ]
    labels = found["candidates"]
    assert labels.index("leakage") + 1 == labels.index("laminar_leak")
    assert "### `laminar_leak`" in found["page"]
    assert "sinks exponentially" in found["page"]
    assert "| `laminar_leak` | valve |" in found["tables"]["muscle"]
    assert "| `laminar_leak` | nothing, because" in found["control"]
    assert "`laminar_leak`" not in found["tables"]["joint"]

    rig = load_rig(RIG)
    assert rig.gas.polytropic_exponent == 1.0
    muscle = rig.muscle("elbow_flexor")
    model = muscle.create_force_model()
    volume = float(model.volume(muscle.neutral_length)) + muscle.dead_volume
    temperature = rig.gas.temperature
    rate = GAS_CONSTANT * temperature * reference_density(temperature) * conductance / volume
    first, second = zip(*found["pressures"], strict=True)
    assert first[-1] == pytest.approx(first[0] * math.exp(-rate * 0.5), rel=1e-6)
    assert first[-1] < 0.95 * first[0]
    assert second[-1] == pytest.approx(second[0], rel=1e-12)


def test_a_new_torque_is_one_file(tmp_path: Path) -> None:
    (tmp_path / "joint_spring.py").write_text(JOINT_SPRING)
    without = report(tmp_path, "joint_spring", "rate", "elbow", 0.0)
    found = report(tmp_path, "joint_spring", "rate", "elbow", 4.0)
    assert found["names"] == ["joint_spring.rate"]
    assert "joint_spring" in found["candidates"]
    assert "| `joint_spring` | joint |" in found["tables"]["joint"]
    joint = load_rig(RIG).joints[0]
    change = found["acceleration"] - without["acceleration"]
    assert change == pytest.approx(-4.0 * 0.3 / joint.inertia, rel=1e-3)


def test_a_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import pam_model.effects"],
        env={**os.environ, "PAM_EFFECTS": str(tmp_path / "nowhere")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert f"PAM_EFFECTS names {tmp_path / 'nowhere'}, which is not a folder" in done.stderr
