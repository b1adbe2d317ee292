"""Every format is read, and damage of any kind ends in a recording or in a line for each reason."""

from __future__ import annotations

import ast
import bz2
import gzip
import io
import lzma
import random
import re
import sqlite3
import struct
import time
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from backports import zstd
from scipy.io import savemat

from pam_check.fuzz.damaged_files import DamagedFiles, log_of
from pam_check.fuzz.sample_logs import ENDINGS, sample
from pam_gap.import_log.import_log import columns_of
from pam_gap.recordings import packed_chunks, size_limits, unpacked
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import RecordingError
from pam_model.errors import PamError
from pam_model.reading import reading
from pam_model.rig import load_rig
from support.rigs import ELBOW
from support.source_tree import ROOT, SOURCE

RIG = load_rig(ELBOW)
FILES = DamagedFiles(RIG)


@pytest.mark.parametrize("ending", ENDINGS)
def test_every_format_is_read(ending: str) -> None:
    """Alike, whatever the format."""
    log = log_of(RIG)
    recording = import_recording(FILES.recording(ending))
    assert set(recording.values) == set(log) - {"time"}
    for name, values in recording.values.items():
        np.testing.assert_allclose(values[1:-1], log[name][1:-1], rtol=0.05, atol=0.02)
    assert len(columns_of(FILES.recording(ending)).columns) >= len(recording.values)


def test_the_page_names_every_format_and_no_other() -> None:
    page = (ROOT / "docs/any_log.md").read_text(encoding="utf-8").split("## Formats")[1]
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| ")]
    named = set(re.findall(r"`(\.\w+)`", " ".join(rows)))
    assert named == {f".{part}" for ending in ENDINGS for part in ending.split(".") if part}


@pytest.mark.parametrize("kind", FILES.kinds)
def test_damage_ends_in_a_line_for_each_reason(kind: str) -> None:
    """A few damaged files of each kind; `./pam check fuzz files` tries more."""
    for number in range(6):
        FILES.check(kind, random.Random(f"{kind} {number}"))


def _npy(header: bytes) -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header


def _zipped(name: str, content: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as file:
        file.writestr(name, content)
    return out.getvalue()


def _hdf5(**options: object) -> bytes:
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        file.create_dataset("p", dtype="f8", chunks=True, **options)
    return out.getvalue()


def _cells(claimed: int, *, packed: bool) -> bytes:
    """A MAT file with a cell array whose dimensions are claimed."""
    out = io.BytesIO()
    cells = np.empty((3, 1), dtype=object)
    cells[:, 0] = [1.0, 2.0, 3.0]
    savemat(out, {"c": cells})
    plain = bytearray(out.getvalue())
    at = plain.index(struct.pack("<ii", 3, 1))
    plain[at : at + 8] = struct.pack("<ii", claimed, 1)
    if packed:
        body = zlib.compress(bytes(plain[128:]))
        plain[128:] = struct.pack("<II", 15, len(body)) + body
    return bytes(plain)


def _bag_bomb() -> bytes:
    """An MCAP file of some kilobytes with a chunk that unpacks to 64 GB."""
    frame = zstd.compress(b"x" * 100)
    packed = bytearray(frame)
    # RFC 8878: the frame's claim of its size has 1 byte in a single segment; make it 8
    packed[4:6] = bytes((0xE0,)) + struct.pack("<Q", 1 << 36)
    head = struct.pack("<QQQII", 0, 1, 1000, 0, 4) + b"zstd" + struct.pack("<Q", len(packed))
    chunk = head + packed
    return b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(chunk)) + chunk


def _database() -> bytes:
    """A bag with a text where a stamp should be."""
    bag = sqlite3.connect(":memory:")
    bag.deserialize(sample(".db3", log_of(RIG)))
    bag.execute("UPDATE messages SET timestamp = 'noon'")
    bag.commit()
    return bag.serialize()


HUGE = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }\n"
TEXT = sample(".csv", log_of(RIG))
DAMAGE: dict[str, tuple[str, Callable[[], bytes]]] = {
    "zip without an end": (".npz", lambda: _zipped("p.npy", _npy(HUGE))[:-10]),
    "npz that claims 8 TB": (".npz", lambda: _zipped("p.npy", _npy(HUGE))),
    "npz of objects": (".npz", lambda: _zipped("p.npy", _npy(HUGE.replace(b"<f8", b"|O")))),
    "hdf5 that claims 8 TB": (".h5", lambda: _hdf5(shape=(10**12,))),
    "mat that claims 16 GB of cells": (".mat", lambda: _cells(2**31 - 1, packed=False)),
    "the same, packed": (".mat", lambda: _cells(2**31 - 1, packed=True)),
    "mat with a negative size": (".mat", lambda: _cells(-5, packed=False)),
    "mat of version 4 that claims 16 GB": (
        ".mat", lambda: struct.pack("<5i", 0, 2**31 - 1, 1, 0, 2) + b"p\0" + bytes(64),
    ),
    "json nested too deeply": (".json", lambda: b"[" * 200_000),
    "json with a number of 5000 digits": (".json", lambda: b"[" + b"9" * 5000 + b"]"),
    "gzip cut": (".csv.gz", lambda: gzip.compress(TEXT)[:-200]),
    "gzip flipped": (".csv.gz", lambda: gzip.compress(TEXT).replace(b"\x00", b"\xff")),
    "bzip2 cut": (".csv.bz2", lambda: bz2.compress(TEXT)[:-200]),
    "xz flipped": (".csv.xz", lambda: lzma.compress(TEXT)[:500] + bytes(500)),
    "zstandard cut": (".csv.zst", lambda: zstd.compress(TEXT)[:-200]),
    "no end of a line": (".csv", lambda: b"t" * (1 << 24)),
    "parquet cut": (".parquet", lambda: sample(".parquet", log_of(RIG))[:-200]),
    "a stamp that is text": (".db3", _database),
    "a chunk that claims 64 GB": (".mcap", _bag_bomb),
}  # fmt: skip


@pytest.mark.parametrize("what", DAMAGE)
def test_what_a_file_claims_is_checked_before_it_is_believed(what: str, tmp_path: Path) -> None:
    """None of these is listed anywhere: each library reports damage in its own way."""
    ending, content = DAMAGE[what]
    path = tmp_path / f"log{ending}"
    path.write_bytes(content())
    tracemalloc.start()
    begin = time.process_time()
    with pytest.raises(RecordingError) as error:
        import_recording(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 600
    assert time.process_time() - begin < 10.0
    assert peak < 400e6


def test_a_frame_that_claims_nothing_is_unpacked_as_far_as_the_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(packed_chunks, "MOST_CHUNK", 1 << 20)
    packer = zstd.ZstdCompressor()
    frame = packer.compress(bytes(1 << 22)) + packer.flush()
    assert zstd.get_frame_info(frame).decompressed_size is None
    with pytest.raises(ValueError, match="unpacks to more than"):
        packed_chunks.refuse_bomb(frame, "zstd", 100)
    packed_chunks.refuse_bomb(zstd.compress(bytes(1000)), "zstd", 1000)


@pytest.mark.parametrize("packing", unpacked.PACKINGS)
def test_what_unpacks_to_too_much_is_refused(
    packing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bomb: the limit is on what was unpacked, not on what is said beforehand."""
    monkeypatch.setattr(unpacked, "MOST_BYTES", 1 << 18)
    pack = {".gz": gzip.compress, ".bz2": bz2.compress, ".xz": lzma.compress, ".zst": zstd.compress}
    path = tmp_path / f"log.csv{packing}"
    path.write_bytes(pack[packing](b"time,p\n" + b"0.5,100000\n" * 30_000))
    with pytest.raises(RecordingError, match="GiB of text"):
        import_recording(path)


def test_numbers_in_other_files_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(np.arange(500.0).tobytes())
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        place = [(str(tmp_path / "secret"), 0, 4000)]
        file.create_dataset("p", shape=(500,), dtype="f8", external=place)
    with pytest.raises(RecordingError, match="no array of numbers"):
        columns_of(path)


@pytest.mark.parametrize(
    "text",
    ["channels: {a: 2024-13-45}", "channels: {a: &x [*x]}", "[" * 2000, "a: \0"],
)
def test_a_map_with_any_mistake_is_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(RecordingError) as error:
        load_column_map(path)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    "error", [KeyError("x"), MemoryError(), RecursionError(), zlib.error("a\nb"), OSError(5, "I/O")]
)
def test_the_boundary_lists_no_exceptions(error: Exception) -> None:
    with (
        pytest.raises(PamError, match=r"^f\.x: not a table \([^\n]+\)$"),
        reading("f.x", "a table"),
    ):
        raise error


def test_40_000_columns_take_seconds(tmp_path: Path) -> None:
    """Every step is linear in the number of columns."""
    names = ["time", *(f"channel_{k}_bar" for k in range(39_999))]
    path = tmp_path / "wide.csv"
    rows = [",".join([f"{0.01 * k}", *["1.5"] * 39_999]) for k in range(3)]
    path.write_text("\n".join([",".join(names), *rows]))
    begin = time.process_time()
    assert len(columns_of(path).columns) == 40_000
    assert time.process_time() - begin < 12.0


PARSERS = {
    "load", "loads", "safe_load", "loadmat", "read_csv", "read_parquet", "File", "AnyReader",
    "read_metadata", "load_all",
}  # fmt: skip
MODULES = {"json", "yaml", "np", "pd", "pq", "h5py", ""}
BEHIND = {  # readers that are only called within a boundary, and by whom
    "pam_gap/recordings/array_files.py": "pam_gap/recordings/import_csv.py",
    "pam_gap/recordings/array_process.py": "pam_gap/recordings/import_csv.py",
    "pam_gap/recordings/text_table.py": "pam_gap/recordings/import_csv.py",
    "pam_gap/recordings/bag_columns.py": "pam_gap/recordings/broken_bag.py",
    "pam_gap/recordings/import_rosbag.py": "pam_gap/recordings/broken_bag.py",
    "pam_gap/fleet/recording_time.py": "pam_gap/recordings/broken_bag.py",
}
OWN = {  # files of the suite itself, with a reason
    "pam_model/rig/file.py": "has its own boundary, which names lines",
    "pam_model/commands/size.py": "reads what it has just written",
    "pam_gap/recordings/broken_bag.py": "reads metadata, and goes on without them",
}


def unguarded(tree: ast.AST) -> list[int]:
    """Lines that call a parser outside of `with reading(...)` and outside of what it calls."""
    guarded = {
        id(inner)
        for block in ast.walk(tree)
        if isinstance(block, ast.With)
        and any("reading(" in ast.unparse(item) for item in block.items)
        for inner in ast.walk(block)
    }
    called = {
        getattr(call.func, "attr", getattr(call.func, "id", ""))
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and id(call) in guarded
    }
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef) and function.name in called:
            guarded |= {id(inner) for inner in ast.walk(function)}
    lines = []
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call) or id(call) in guarded:
            continue
        name = ast.unparse(call.func)
        module, _, last = name.rpartition(".")
        if last in PARSERS and module in MODULES:
            lines.append(call.lineno)
    return lines


@pytest.mark.parametrize("package", ["pam_gap", "pam_model"])
def test_every_parser_is_called_within_the_boundary(package: str) -> None:
    found = {}
    for path in sorted((SOURCE / package / package).rglob("*.py")):
        name = str(path.relative_to(SOURCE / package))
        lines = unguarded(ast.parse(path.read_text(encoding="utf-8")))
        if lines and name not in {*BEHIND, *OWN}:
            found[name] = lines
    assert found == {}


def test_the_rule_finds_a_parser_outside() -> None:
    assert unguarded(ast.parse("def f(p):\n    return json.loads(p)")) == [2]
    inside = "def g(p):\n    with reading(p, 'x'):\n        return f(p)\n"
    assert unguarded(ast.parse(inside + "def f(p):\n    return json.loads(p)")) == []


def test_limits_leave_room_for_a_long_recording() -> None:
    """Five hours at 500 Hz with the channels of four joints."""
    assert size_limits.MOST_CELLS > 5 * 3600 * 500 * 29


def _long_text(file: h5py.File) -> None:
    file["remark"] = "as built"


def _long_attribute(file: h5py.File) -> None:
    file["time"].attrs["MATLAB_class"] = "double"


@pytest.mark.parametrize(
    ("add", "answer"),
    [(_long_text, "no channel"), (_long_attribute, "did not come to an end")],
)
def test_a_damaged_text_in_an_hdf5_file_holds_no_reader(
    add: Callable[[h5py.File], None], answer: str, tmp_path: Path
) -> None:
    """HDF5 looks for a text of variable length in its heap without an end if a size is wrong."""
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(3.0)
        add(file)
    content = bytearray(path.read_bytes())
    size = content.index(b"GCOL") + 24
    content[size : size + 8] = (2**64 - 16).to_bytes(8, "little")
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=answer):
        import_recording(path)


def test_a_file_that_ends_its_library_ends_no_diagnosis(tmp_path: Path) -> None:
    """There is no kind of numbers 10, which scipy does not ask before it looks it up."""
    out = io.BytesIO()
    savemat(out, {"time": np.arange(3.0)})
    content = bytearray(out.getvalue())
    numbers = content.index(struct.pack("<II", 9, 24))
    content[numbers : numbers + 4] = struct.pack("<I", 10)
    path = tmp_path / "log.mat"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="SIGSEGV"):
        import_recording(path)
