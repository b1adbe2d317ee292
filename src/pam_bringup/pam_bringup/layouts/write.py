"""Writes the layouts of a robot into a folder: the work of `pam bringup layouts`."""

from __future__ import annotations

from pam_bringup.layouts.foxglove import foxglove_layout
from pam_bringup.layouts.plotjuggler import plotjuggler_layout
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.rig import load_rig

FILES = {"foxglove.json": foxglove_layout, "plotjuggler.xml": plotjuggler_layout}


def run(given: Arguments) -> Outcome:
    """Write a layout for each program."""
    rig = load_rig(chosen_rig(given))
    inner = given.namespace.strip("/")
    prefix = f"/{inner}" if inner else ""
    folder = given.out
    folder.mkdir(parents=True, exist_ok=True)
    for name, made in FILES.items():
        (folder / name).write_text(made(rig, prefix), encoding="utf-8")
        print(f"written: {folder / name}")
    return Outcome({"files": [folder / name for name in FILES]})
