"""Add up pytest's JUnit files and print one line with the totals.

Usage: ``python tools/test_totals.py FILE.xml...``. The exit code is 1 if a file is missing, if
it contains no test, a failure or an error, or if a SocketCAN test was skipped.
"""

import sys
import xml.etree.ElementTree as ET
from pathlib import Path


def main(paths: list[str]) -> int:
    """Print the totals of all files; return the exit code."""
    passed = failed = skipped = 0
    seconds = 0.0
    sound = True
    for path in map(Path, paths):
        if not path.exists():
            print(f"{path}: missing, its tests did not run", file=sys.stderr)
            sound = False
            continue
        suite = next(ET.parse(path).getroot().iter("testsuite"))
        tests, bad, left = (
            int(suite.get("tests", 0)),
            int(suite.get("failures", 0)) + int(suite.get("errors", 0)),
            int(suite.get("skipped", 0)),
        )
        if tests == 0 or ("vcan" in path.name and left):
            print(f"{path}: {tests} tests, {left} skipped: not accepted", file=sys.stderr)
            sound = False
        passed += tests - bad - left
        failed += bad
        skipped += left
        seconds += float(suite.get("time", 0.0))
    print(f"{passed} passed, {failed} failed, {skipped} skipped in {seconds:.0f} s")
    return 0 if sound and not failed else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
