"""Types of command line arguments: numbers within bounds, files and folders that can be used.

Each is used as `add_argument(type=...)`. A value that cannot be used ends the command at once with
one line that names the option, the value and what was expected.
"""

from __future__ import annotations

import argparse
import math
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from pam_model.errors import PamError
from pam_model.muscle_sizes import size_name
from pam_model.unit_hints import other_units, read_with_unit

WrongArgument = argparse.ArgumentTypeError
"""What a type raises for a value that cannot be used."""


def count(least: int = 1, most: int | None = None) -> Callable[[str], int]:
    """A whole number from `least` to `most`."""
    wanted = f"a whole number of {least} or more"
    if most is not None:
        wanted = f"a whole number from {least} to {most}"

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least or (most is not None and value > most):
            raise argparse.ArgumentTypeError(f"{text}: expected {wanted}")
        return value

    return read


def number(
    unit: str, *, above: float | None = None, least: float | None = None, most: float | None = None
) -> Callable[[str], float]:
    """A finite number within bounds; a unit may follow it (`unit_hints.read_with_unit`).

    Parameters
    ----------
    unit : str
        Unit in the message; "" for none.
    above, least, most : float, optional
        Open lower bound, closed lower bound, closed upper bound.
    """
    wanted = "a number" + (f" in {unit}" if unit else "")
    bounds = [f"above {above:g}"] if above is not None else []
    bounds += [f"of {least:g} or more"] if least is not None else []
    bounds += [f"at most {most:g}"] if most is not None else []
    if bounds:
        wanted += " " + " and ".join(bounds)

    def is_within(value: float) -> bool:
        return (
            math.isfinite(value)
            and (above is None or value > above)
            and (least is None or value >= least)
            and (most is None or value <= most)
        )

    def read(text: str) -> float:
        value = read_with_unit(text, unit)
        if is_within(value):
            return value
        meant = [name for name, factor in other_units(unit).items() if is_within(value * factor)]
        hint = f"; did you mean {' or '.join(text + name for name in meant)}?" if meant else ""
        raise argparse.ArgumentTypeError(f"{text}: expected {wanted}{hint}")

    return read


def names(text: str) -> tuple[str, ...]:
    """Names as ROS takes them, separated by commas, each once."""
    found = tuple(name.strip() for name in text.split(","))
    if len(set(found)) != len(found) or not all(
        re.fullmatch("[a-z][a-z0-9_]*", name) for name in found
    ):
        raise argparse.ArgumentTypeError(
            f"{text}: expected names of small letters, digits and _, separated by commas, each once"
        )
    return found


def one_of(*values: str) -> Callable[[str], str]:
    """One of these words."""

    def read(text: str) -> str:
        if text not in values:
            raise argparse.ArgumentTypeError(f"{text}: expected {' or '.join(values)}")
        return text

    return read


def muscle_size(text: str) -> str:
    """A size of muscle that can be bought, as its maker spells it."""
    try:
        return size_name(text)
    except PamError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def named_number(text: str) -> tuple[str, float]:
    """A NAME=NUMBER pair."""
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: expected NAME=NUMBER") from None


def input_path(text: str) -> Path:
    """A file or folder that exists."""
    path = Path(text)
    if not path.exists():
        raise argparse.ArgumentTypeError(f"{text}: there is no such file or folder")
    return path


def input_file(text: str) -> Path:
    """A file that exists."""
    path = Path(text)
    if path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: is a folder; expected a file")
    if not path.exists():
        raise argparse.ArgumentTypeError(f"{text}: there is no such file")
    return path


def input_folder(text: str) -> Path:
    """A folder that exists."""
    path = Path(text)
    if not path.is_dir():
        what = "is a file; expected a folder" if path.exists() else "there is no such folder"
        raise argparse.ArgumentTypeError(f"{text}: {what}")
    return path


def output_file(text: str) -> Path:
    """A file that can be written; see `make_parents`."""
    path = Path(text)
    if path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: is a folder; expected a file")
    if path.exists() and not os.access(path, os.W_OK):
        raise argparse.ArgumentTypeError(f"{text}: no permission to write this file")
    _check_parent(path)
    return path


def new_file(text: str) -> Path:
    """A file that does not exist yet, for what its owner goes on to edit, such as a rig file."""
    path = output_file(text)
    if path.exists():
        raise argparse.ArgumentTypeError(
            f"{text}: exists already and would be lost; expected the name of a new file"
        )
    return path


def output_folder(text: str) -> Path:
    """A folder that exists or can be created."""
    path = Path(text)
    if path.exists() and not path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: is a file; expected a folder")
    _check_parent(path, (path.absolute(), *path.absolute().parents))
    return path


def _check_parent(path: Path, above: Sequence[Path] = ()) -> None:
    """Refuse a path that cannot be created, by the nearest folder above it that exists."""
    parent = next(folder for folder in above or path.absolute().parents if folder.exists())
    if not parent.is_dir():
        raise argparse.ArgumentTypeError(f"{path}: {parent} is a file; expected a folder")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise argparse.ArgumentTypeError(f"{path}: no permission to write to {parent}")


def make_parents(path: Path) -> Path:
    """Create the folders above a file, and return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return path
