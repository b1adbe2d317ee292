"""Writes a version into every file that states one: `tools/set_version.py 0.3.0 2027-02-01`.

`tools/release.sh` calls it. Each package.xml holds the version of its package, from which setup.py
and the installed metadata take it; bloom wants it there. All packages have the same version.
"""

from __future__ import annotations

import re
import sys
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FORM = re.compile(r"\d+\.\d+\.\d+")


def packages() -> list[Path]:
    """Folders of all packages."""
    return sorted(path.parent for path in ROOT.glob("src/*/package.xml"))


def versions() -> dict[str, set[str]]:
    """The versions that the files state, each with these files."""
    found: dict[str, set[str]] = {}
    for folder in packages():
        text = (folder / "package.xml").read_text(encoding="utf-8")
        for version in re.findall(r"<version>(.*?)</version>", text):
            found.setdefault(version, set()).add(str(folder.relative_to(ROOT) / "package.xml"))
        changes = (folder / "CHANGELOG.rst").read_text(encoding="utf-8")
        first = changes.splitlines()[4].partition(" ")[0]
        found.setdefault(first, set()).add(str(folder.relative_to(ROOT) / "CHANGELOG.rst"))
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    for version in re.findall(r"^version: (\S+)$", citation, re.MULTILINE):
        found.setdefault(version, set()).add("CITATION.cff")
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    for version in re.findall(r"^## (\S+)", changes, re.MULTILINE)[:1]:
        found.setdefault(version, set()).add("CHANGELOG.md")
    return found


def set_version(version: str, day: str) -> None:
    """Write version and date of a release; CHANGELOG.md is left to towncrier."""
    for folder in packages():
        _replace(folder / "package.xml", r"<version>.*?<", f"<version>{version}<")
        heading = f"{version} ({day})"
        lines = (folder / "CHANGELOG.rst").read_text(encoding="utf-8").splitlines()
        if lines[4] == "Forthcoming":
            lines[4:6] = [heading, "-" * len(heading)]
        elif lines[4].partition(" ")[0] != version:
            lines[4:4] = [heading, "-" * len(heading), "* See CHANGELOG.md of the suite.", ""]
        (folder / "CHANGELOG.rst").write_text("\n".join(lines) + "\n", encoding="utf-8")
    _replace(ROOT / "CITATION.cff", r"(?m)^version: .*$", f"version: {version}")
    _replace(ROOT / "CITATION.cff", r"(?m)^date-released: .*$", f"date-released: {day}")


def _replace(path: Path, pattern: str, text: str) -> None:
    old = path.read_text(encoding="utf-8")
    new, count = re.subn(pattern, text, old, count=1)
    if not count:
        raise SystemExit(f"error: {path}: nothing to replace for {pattern}")
    path.write_text(new, encoding="utf-8")


def main(words: list[str]) -> None:
    """Set the version that is given, or print the one that all files state."""
    if words:
        if not FORM.fullmatch(words[0]):
            raise SystemExit(f"error: {words[0]} is no version; expected three numbers, as 0.3.0")
        set_version(words[0], words[1] if len(words) > 1 else date.today().isoformat())
        return
    found = versions()
    if len(found) != 1:
        told = "; ".join(
            f"{version} in {', '.join(sorted(files))}" for version, files in found.items()
        )
        raise SystemExit(f"error: the files state several versions: {told}")
    print(*found)


if __name__ == "__main__":
    main(sys.argv[1:])
