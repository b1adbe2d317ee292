"""The arm that the benchmarks of chain and controller share: the elbow, several times."""

from __future__ import annotations

from pathlib import Path

from pam_model.rig import Rig, load_rig, rig_from_parameters

ELBOW = Path(__file__).parents[1] / "config/elbow.yaml"


def arm(joints: int) -> Rig:
    """The elbow, `joints` times, each on a board of its own."""
    tree = load_rig(ELBOW).to_parameters()
    names = [f"joint_{index}" for index in range(joints)]
    tree["joints"] = names
    for board, name in enumerate(names):
        muscles = [f"{name}_flexor", f"{name}_extensor"]
        encoder = {"board": board, "channel": 0}
        tree[name] = {**tree["elbow"], "muscles": muscles, "encoder": encoder}
        for channel, muscle in enumerate(muscles):
            tree[muscle] = {**tree["elbow_flexor"], "board": board, "channel": channel}
    for name in ("elbow", "elbow_flexor", "elbow_extensor"):
        del tree[name]
    return rig_from_parameters(tree)
