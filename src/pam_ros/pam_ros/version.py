"""The version of a package, and the answer of every tool and node to `--version`.

It is written in one place, the package.xml, from which an installation makes its metadata.
"""

from __future__ import annotations

from pam_ros.program_name import PROGRAM

_MODELS = "pam_model"


def version_line(program: str) -> str:
    """Name and version of the package that a program belongs to, from its metadata.

    Parameters
    ----------
    program : str
        What the user types, such as "pam gap diagnose" or "python -m pam_check.blind.cases"; what
        names no package tells the version of pam_model.
    """
    words = [word.partition(".")[0] for word in program.removeprefix(PROGRAM).split()]
    if program.startswith(f"{PROGRAM} "):
        words[0] = f"pam_{words[0]}"
    package = next((word for word in words if word.startswith("pam_")), _MODELS)
    return f"{package} {installed_version(package)}"


def installed_version(package: str) -> str:
    """Version of a package as it is installed; where it is not, a text that says so."""
    from importlib import metadata  # noqa: PLC0415  (only this answer needs the time)

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "of unknown version: the package is not installed"
