"""CANopen devices for tests."""

from __future__ import annotations

from typing import Any

from support.rigs import CONFIG

ELBOW_CANOPEN = CONFIG / "elbow_canopen.yaml"
ELBOW_REGULATOR = CONFIG / "elbow_canopen_regulator.yaml"


def io_module(node: int) -> dict[str, Any]:
    """An analogue I/O module with two regulators, two pressure sensors, an angle and the supply."""

    def volts() -> dict[str, list[float]]:  # a new one each time: a rig file has no aliases
        return {"V": [0.0, 10.0], "bar": [0.0, 8.0]}

    return {
        "kind": "canopen",
        "profile": "cia401_analogue",
        "node": node,
        "setpoints": {
            name: {"object": f"0x6411:{place}", "scale": volts(), "reference": "gauge"}
            for place, name in enumerate(("port_a", "port_b"), 1)
        },
        "pressures": {
            name: {"object": f"0x6401:{place}", "scale": volts(), "reference": "gauge"}
            for place, name in enumerate(("port_a", "port_b"), 1)
        },
        "supply": {"object": "0x6401:4", "scale": volts(), "reference": "gauge"},
        "angles": {
            "shaft": {"object": "0x6401:3", "scale": {"V": [0.0, 10.0], "deg": [-180.0, 180.0]}}
        },
    }
