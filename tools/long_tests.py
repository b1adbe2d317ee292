"""Write the table of the tests that only `make test-all` runs into CONTRIBUTING.md.

Usage: ``.venv/bin/python tools/long_tests.py``. A test compares the page with the markers.
"""

import sys
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/helpers"))

from support.long_run import long_tests  # noqa: E402

PAGE = ROOT / "CONTRIBUTING.md"
BEGIN, END = "<!-- long tests: begin -->\n", "<!-- long tests: end -->\n"


def table() -> str:
    """One row for each file and reason."""
    lines = [
        "| file in tests/ | what only `make test-all` runs | what stands for it |",
        "|---|---|---|",
    ]
    for (place, reason), group in groupby(long_tests(ROOT / "tests"), lambda row: (row[0], row[2])):
        names = dict.fromkeys(name for _, name, _ in group)
        lines.append(f"| {place} | {', '.join(names)} | {reason} |")
    return "\n".join(lines) + "\n"


def written_into(page: str) -> str:
    """The page with the table of today."""
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}{table()}{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(written_into(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
