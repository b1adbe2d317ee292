"""Runs the notebooks in examples/notebooks and stores their outputs: tools/run_notebooks.py."""

import json
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests/helpers"))

from support.notebooks import NOTEBOOKS, run_notebook  # noqa: E402

for path in NOTEBOOKS:
    path.write_text(json.dumps(run_notebook(path), indent=1) + "\n", encoding="utf-8")
    print(f"written: {path.relative_to(ROOT)}")
