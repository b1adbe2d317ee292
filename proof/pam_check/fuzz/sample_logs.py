"""A small sound file of each format that a diagnosis reads, whose inner layer can be spoilt, too.

What is packed or zipped has a checksum, so that damage to the file is found before its content is
read. `spoil` therefore acts on the content before it is packed.
"""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import h5py
import numpy as np
import pandas as pd
from backports import zstd
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from pam_gap.recordings.array_files import ARRAYS
from pam_gap.recordings.broken_bag import ROSBAG1, STORAGES
from pam_gap.recordings.import_csv import PARQUET, TABLES, TEXTS

Spoil = Callable[[bytes], bytes]
Log = Mapping[str, Any]
ENDINGS: Final = (*TABLES, *STORAGES, ROSBAG1)
"""Endings of all files that a diagnosis reads."""
LAYERED: Final = (*TEXTS, ".npz", ".mat")
"""Endings of formats with an inner layer that is packed."""
_PACK: Final[Mapping[str, Callable[[bytes], bytes]]] = {
    ".gz": lambda data: gzip.compress(data, 1),
    ".bz2": bz2.compress,
    ".xz": lambda data: lzma.compress(data, preset=0),
    ".zst": zstd.compress,
}
_SEPARATORS: Final = {
    ".csv": ",", ".txt": " ", ".tsv": "\t", ".dat": ";", ".lvm": "\t", ".asc": " ",
}  # fmt: skip
_START: Final = 1_700_000_000_000_000_000


def sound(data: bytes) -> bytes:
    """Leave the content as it is."""
    return data


def _text(log: Log, ending: str, spoil: Spoil) -> bytes:
    kind = next(kind for kind in _SEPARATORS if ending.startswith(kind))
    decimal = "," if kind == ".dat" else "."
    text = pd.DataFrame(log).to_csv(index=False, sep=_SEPARATORS[kind], decimal=decimal)
    data = spoil(text.encode())
    packing = ending.removeprefix(kind)
    return _PACK[packing](data) if packing else data


def _npz(log: Log, spoil: Spoil) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file:
        for name, column in log.items():
            entry = io.BytesIO()
            np.save(entry, column)
            file.writestr(f"{name}.npy", spoil(entry.getvalue()))
    return out.getvalue()


def _mat(log: Log, spoil: Spoil) -> bytes:
    out = io.BytesIO()
    cells = np.empty(2, dtype=object)
    cells[:] = [{"a": np.arange(3.0)}, "text"]
    content = {**log, "arm": {"q": np.arange(120.0)}, "cells": cells}
    savemat(out, content, do_compression=spoil is sound)
    return spoil(out.getvalue())


def _hdf5(log: Log) -> bytes:
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        for place, (name, column) in enumerate(log.items()):
            packed = {"chunks": True, "compression": "gzip"} if place % 2 else {}
            file.create_dataset(name.replace(".", "/"), data=column, **packed)
        file["remark"] = "text"
    return out.getvalue()


def _json(log: Log, ending: str) -> bytes:
    if ending == ".json":
        return json.dumps({name: column.tolist() for name, column in log.items()}).encode()
    rows = zip(*log.values(), strict=True)
    lines = (json.dumps(dict(zip(log, map(float, row), strict=True))) for row in rows)
    return "\n".join(lines).encode()


def _parquet(log: Log) -> bytes:
    out = io.BytesIO()
    pd.DataFrame(log).to_parquet(out, index=False)
    return out.getvalue()


def _bag(log: Log, ending: str) -> bytes:
    """The channels as JointStates, each in a topic of its own."""
    is_old = ending == ROSBAG1
    store = get_typestore(Stores.ROS1_NOETIC if is_old else Stores.ROS2_JAZZY)
    kind = "sensor_msgs/msg/JointState"
    state, header = store.types[kind], store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"]
    first: dict[str, Any] = {"seq": 0} if is_old else {}
    write = store.serialize_ros1 if is_old else store.serialize_cdr
    with TemporaryDirectory() as folder:
        place = Path(folder) / "bag"
        writer: Any
        if is_old:
            writer = Writer1(place)
        else:
            plugin = StoragePlugin.MCAP if ending == ".mcap" else StoragePlugin.SQLITE3
            writer = Writer(place, version=9, storage_plugin=plugin)
            if ending == ".mcap":
                writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        none = np.zeros(0)
        with writer:
            topics = dict.fromkeys(name.partition(".")[0] for name in log if name != "time")
            links = {t: writer.add_connection(f"/{t}", kind, typestore=store) for t in topics}
            for row, time in enumerate(log["time"]):
                now = _START + round(1e9 * float(time))
                for topic, link in links.items():
                    names = [n for n in log if n.startswith(f"{topic}.")]
                    owners = [n.split(".")[1] for n in names]
                    values = np.array([float(log[n][row]) for n in names])
                    fields = {"position": none, "effort": none, "velocity": none}
                    fields["effort" if topic == "pressure_states" else "position"] = values
                    message = state(
                        header=header(**first, stamp=stamp(now // 10**9, now % 10**9), frame_id=""),
                        name=owners, **fields,
                    )  # fmt: skip
                    writer.write(link, now, bytes(write(message, kind)))
        file = place if is_old else next(place.glob(f"*{ending}"))
        return file.read_bytes()


def sample(ending: str, log: Log, spoil: Spoil = sound) -> bytes:
    """The content of a file with this ending.

    Parameters
    ----------
    ending : str
        One of `ENDINGS`.
    log : mapping of str to ndarray, shape (n,)
        `time` and channels of the rig contract.
    spoil : callable
        Changes the content before it is packed; formats without an inner layer ignore it.

    Raises
    ------
    KeyError
        For a format that has no sample yet: add one, so that it is tested and fuzzed.
    """
    if ending in TEXTS:
        return _text(log, ending, spoil)
    if ending in PARQUET:
        return _parquet(log)
    if ending in (*STORAGES, ROSBAG1):
        return _bag(log, ending)
    if ending in ARRAYS:
        makers: dict[str, Callable[[], bytes]] = {
            ".npz": lambda: _npz(log, spoil),
            ".mat": lambda: _mat(log, spoil),
            **dict.fromkeys((".h5", ".hdf5", ".he5"), lambda: _hdf5(log)),
            **dict.fromkeys((".json", ".jsonl", ".ndjson"), lambda: spoil(_json(log, ending))),
        }
        return makers[ending]()
    raise KeyError(ending)
