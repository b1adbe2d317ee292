"""`pam check pages`: what the documentation and config/ show of the code, written again.

A page holds tables between two comments, `<!-- NAME: begin -->` and `<!-- NAME: end -->`. Two pages
and the controller's parameter file are made as a whole.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final

from pam_check.doc_pages.comparison_tables import comparison_tables
from pam_check.doc_pages.constants_page import constants_page
from pam_check.doc_pages.effect_tables import control_table, keys_table
from pam_check.doc_pages.effects_page import draw_effects, effects_page
from pam_check.doc_pages.markdown import places, updated
from pam_check.doc_pages.models_table import draw_models, models_table
from pam_check.doc_pages.parameter_tables import (
    controller_parameters_table,
    driver_parameters_table,
)
from pam_check.doc_pages.safety_tables import (
    categories_table,
    diagram_as_mermaid,
    faults_table,
    states_table,
)
from pam_check.fault_kinds.device_kinds import DEVICE_KINDS
from pam_check.fault_kinds.kinds import KINDS
from pam_control.parameter_file import yaml_text
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.reading import read_text, reading
from pam_model.rig import load_rig

PARTS: Final[Mapping[str, Callable[[], str]]] = {
    "diagram": diagram_as_mermaid,
    "states": states_table,
    "categories": categories_table,
    "faults": partial(faults_table, KINDS),
    "devices": partial(faults_table, DEVICE_KINDS),
    "effects of a muscle": partial(keys_table, "muscle"),
    "effects of a joint": partial(keys_table, "joint"),
    "effects of the rig": partial(keys_table, "rig"),
    "effects and the controller": control_table,
    "parameters of the controller": controller_parameters_table,
    "parameters of the driver": driver_parameters_table,
    "models": models_table,
}
"""What stands between the comments of a page, by their name."""
WHOLE: Final[Mapping[str, Callable[[], str]]] = {
    "docs/effects.md": effects_page,
    "docs/constants_of_the_diagnosis.md": constants_page,
    "config/controller.yaml": yaml_text,
}
"""Files that are made as a whole."""


def texts(clone: Path, comparison: str = "") -> dict[Path, str]:
    """The files of a clone of this project that are made from the code, with their texts.

    Parameters
    ----------
    clone : Path
        The clone.
    comparison : str, optional
        The comparison of models; empty: it stays as it is.

    Raises
    ------
    PamError
        If the folder is no clone, or a page holds a place with an unknown name.
    """
    if not (clone / "docs").is_dir():
        raise PamError(f"{clone}: no clone of this project; it has no folder docs")
    parts = {**PARTS, "comparison": (lambda: comparison) if comparison else None}
    made = {clone / name: text() for name, text in WHOLE.items()}
    for path in sorted((clone / "docs").glob("*.md")):
        page = path.read_text(encoding="utf-8")
        if path not in made and places(page):
            try:
                made[path] = updated(page, parts)
            except PamError as error:
                raise PamError(f"{path}: {error}") from None
    return made


def run(given: Arguments) -> Outcome:
    """Write what has changed, and the pictures where wanted."""
    clone, comparison = given.clone, ""
    if given.comparison is not None:
        with reading(given.comparison, "what `pam model compare --json` prints"):
            comparison = comparison_tables(json.loads(read_text(given.comparison)))
    changed = []
    for path, text in texts(clone, comparison).items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            changed.append(path)
    if given.pictures:
        draw_effects(load_rig(clone / "config/elbow.yaml"), clone / "docs/images/effects")
        draw_models(clone / "docs/gallery")
    print("written: " + ", ".join(map(str, changed)) if changed else "all is up to date")
    return Outcome({"changed": changed})
