"""The signals of a small log of an elbow, and a table of text as laboratories write it."""

from pathlib import Path
from typing import Final

import numpy as np

TIME: Final = np.arange(400) * 0.004
FIRST, SECOND = (2e5 + s * 6e4 * np.sin(5.0 * TIME) for s in (1.0, -1.0))
ANGLE: Final = 0.3 * np.sin(5.0 * TIME)
PRESSURE: Final = "pressure_states.elbow_flexor"


def written(path: Path, names: str, *columns: np.ndarray | list[str], between: str = ";") -> Path:
    """A table of text; numbers are written with four decimals."""
    cells = [c if isinstance(c, list) else [f"{v:.4f}" for v in c] for c in columns]
    rows = [between.join(row) for row in zip(*cells, strict=True)]
    path.write_text("\n".join([names, *rows, ""]), encoding="utf-8")
    return path
