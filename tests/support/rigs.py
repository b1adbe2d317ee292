"""Rig files that tests share."""

from pathlib import Path

CONFIG = Path(__file__).parents[2] / "config"
ELBOW = CONFIG / "elbow.yaml"
