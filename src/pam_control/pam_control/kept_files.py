"""The one folder whose files parameters may name while the controller runs.

Whoever can set a parameter over the network must not read or write files elsewhere. The folder is
chosen by the person who starts the node.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from pam_model.errors import PamError
from pam_ros.foreign_text import shown


def kept_folder(given: str, environment: Mapping[str, str] = os.environ) -> Path:
    """The folder; without one, `pam_control` in $ROS_HOME or in ~/.ros.

    Raises
    ------
    PamError
        Where no folder is given and there is no home folder.
    """
    if given:
        return Path(given).expanduser().absolute()
    home = environment.get("ROS_HOME") or (
        environment.get("HOME", "") and str(Path(environment["HOME"]) / ".ros")
    )
    if not home:
        raise PamError("files.folder: must name a folder, because there is no home folder")
    return Path(home).absolute() / "pam_control"


def file_inside(folder: Path, name: str, key: str) -> Path:
    """A file in the folder or below it.

    Parameters
    ----------
    folder : Path
        From `kept_folder`.
    name : str
        Relative to the folder, or a whole path in it.
    key : str
        The parameter, for messages.

    Raises
    ------
    PamError
        For a name that leads out of the folder, by `..` or by a symbolic link.
    """
    try:
        path = (folder / name).resolve()
        is_inside = folder.resolve() in path.parents and not name.startswith("~")
    except (OSError, ValueError, RuntimeError):
        is_inside = False
    if not is_inside:
        raise PamError(
            f"{key} = {shown(name)}: must be the name of a file in {folder}, the folder of the "
            "parameter files.folder, which is read at the start"
        )
    return path
