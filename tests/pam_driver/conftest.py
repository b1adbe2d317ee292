from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_model.rig import Rig, load_rig

from .driver_bench import Bench

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def codec() -> BoardCodec:
    return BoardCodec.from_dbc()


@pytest.fixture(scope="session")
def rig() -> Rig:
    return load_rig(ROOT / "config/elbow.yaml")


@pytest.fixture
def ports() -> Iterator[tuple[CanPort, CanPort]]:
    """Two ends of a bus inside this process."""
    channel = uuid.uuid4().hex
    ends = open_bus("virtual", channel), open_bus("virtual", channel)
    yield ends
    for end in ends:
        end.close()


@pytest.fixture
def bench(rig: Rig, codec: BoardCodec, ports: tuple[CanPort, CanPort]) -> Bench:
    return Bench(rig, codec, ports)


@pytest.fixture
def inside(monkeypatch: pytest.MonkeyPatch, codec: BoardCodec) -> Iterator[Any]:
    """The driver node in this process."""
    from .node_inside import Inside

    made = Inside(monkeypatch, codec)
    yield made
    made.close()


@pytest.fixture
def eager(monkeypatch: pytest.MonkeyPatch, codec: BoardCodec) -> Iterator[Any]:
    """A node that is asked to activate itself."""
    from .node_inside import Inside

    made = Inside(monkeypatch, codec, ("activate_on_start", "true"))
    yield made
    made.close()
