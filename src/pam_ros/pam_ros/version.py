"""The answer of every tool and node to `--version`."""

from __future__ import annotations

from pam_ros.program_name import PROGRAM

_MODELS = "pam_model"


def version_line(program: str) -> str:
    """Name and version of the package that a program belongs to, from its metadata.

    Parameters
    ----------
    program : str
        What the user types, such as "pam gap diagnose" or "python -m pam_check.blind.cases"; what
        names no package shows the version of pam_model.
    """
    from importlib import metadata  # noqa: PLC0415  (only this answer needs the time)

    words = [word.partition(".")[0] for word in program.removeprefix(PROGRAM).split()]
    if program.startswith(f"{PROGRAM} "):
        words[0] = f"pam_{words[0]}"
    package = next((word for word in words if word.startswith("pam_")), _MODELS)
    try:
        return f"{package} {metadata.version(package)}"
    except metadata.PackageNotFoundError:
        return f"{package}, version unknown: the package is not installed"
