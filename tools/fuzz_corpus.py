"""Converts the kept inputs of a fuzz target, lines of hexadecimal digits, to files and back."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path


def unpack(kept: Path, folder: Path) -> None:
    """Write one file for each line."""
    folder.mkdir(parents=True, exist_ok=True)
    for line in kept.read_text().split() if kept.exists() else ():
        data = bytes.fromhex(line)
        (folder / hashlib.sha1(data).hexdigest()).write_bytes(data)


def pack(kept: Path, folder: Path) -> int:
    """Write one line for each file that is not empty; returns the number of lines."""
    inputs = sorted({path.read_bytes().hex() for path in folder.iterdir()} - {""})
    if inputs:
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text("\n".join(inputs) + "\n")
    return len(inputs)


if __name__ == "__main__":
    what, where, files = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    if what == "unpack":
        unpack(where, files)
    else:
        print(f"{where.stem}: {pack(where, files)} inputs kept")
