"""Rig files that tests share."""

from pathlib import Path

CONFIG = Path(__file__).parents[3] / "config"
ELBOW = CONFIG / "elbow.yaml"
