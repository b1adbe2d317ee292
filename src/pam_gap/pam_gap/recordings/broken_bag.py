"""Salvages recordings that were never finished or are cut short.

A recorder that is killed leaves a bag without index and metadata; a copy that is cut short may end
in the middle of a chunk. The intact messages are written into a new bag that any reader can open,
and remarks say what is missing.

Formats: MCAP specification (mcap.dev/spec), SQLite database file format (sqlite.org/fileformat2).
"""

from __future__ import annotations

import contextlib
import mmap
import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import yaml

from pam_gap.recordings.packed_chunks import refuse_bomb
from pam_gap.recordings.recording import RecordingError
from pam_model.reading import read_text, reading

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

MAGIC: Final = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F
_SQLITE: Final = b"SQLite format 3\0"
_TABLES: Final = ("schema", "metadata", "message_definitions", "topics", "messages")
STORAGES: Final = (".mcap", ".db3")
ROSBAG1: Final = ".bag"
_FARTHEST: Final = 10  # times its size; limits the disk space used for a file with a wrong header
_BESIDE: Final = ("-journal", "-wal")  # what a killed recorder leaves beside an SQLite file


@dataclass(slots=True)
class Salvage:
    """What was found in one storage file."""

    messages: int = 0  # number of intact messages
    # start, end: times of the first and the last intact message [ns]
    start: int = 0
    end: int = 0
    # time of the last message according to the file [ns]; 0 if the file does not state it
    known_end: int = 0
    damage: list[str] | None = None  # description of the damage


def storage_files(path: Path) -> list[Path]:
    """The storage files of a rosbag2, whether or not it has metadata."""
    if path.is_file():
        return [path]
    found = [child for child in path.iterdir() if child.suffix in STORAGES and child.is_file()]
    # Sort by length first, so that bag_2 comes before bag_10.
    return sorted(found, key=lambda child: (len(child.name), child.name))


def is_unfinished(path: Path) -> bool:
    """Whether a recorder was killed while writing a database; a plain reader does not notice."""
    return any(
        source.with_name(source.name + ending).is_file()
        for source in storage_files(path)
        for ending in _BESIDE
    )


def bag_reader(files: Sequence[Path]) -> AnyReader:
    """A reader of the messages of a bag; types that the bag does not define are those of Jazzy."""
    from rosbags.highlevel import AnyReader  # noqa: PLC0415  (optional)
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    return AnyReader(list(files), default_typestore=get_typestore(Stores.ROS2_JAZZY))


def beginning(files: Sequence[Path]) -> float:
    """When a bag begins [s since the epoch]."""
    with bag_reader(files) as reader:
        return 1e-9 * float(reader.start_time)


def stamp_in(message: Any) -> int:
    """The stamp in the header of a message [ns]; 0 without one."""
    header = getattr(message, "header", None)
    if header is None:
        return 0
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def read_bag[T](path: Path, read: Callable[[list[Path]], T]) -> tuple[T, list[str]]:
    """Read a bag, or what is intact of it.

    Parameters
    ----------
    path : Path
        rosbag2 folder or storage file, or rosbag1 file; only a rosbag2 is salvaged.
    read : callable
        Reads a bag of these paths; called a second time, for a copy, if the first call fails.

    Returns
    -------
    tuple of object, list of str
        Result of `read`, and remarks on what is missing; none for a whole bag.

    Raises
    ------
    RecordingError
        When nothing can be read. A RecordingError of `read` about a whole bag is passed on.
    """
    import rosbags  # noqa: F401, PLC0415  (optional; where it is missing, no bag is damaged)

    with reading(path, "a readable bag", RecordingError):
        if path.suffix == ROSBAG1:
            return read([path]), []
        for source in storage_files(path):
            if source.suffix == ".mcap":
                _refuse_bombs(source)
        if not is_unfinished(path):
            try:
                return read([path]), []
            except RecordingError:
                raise
            except (
                Exception
            ):  # its layers report damage with many exceptions: salvage what there is
                pass
        with tempfile.TemporaryDirectory(prefix="pam_gap_") as folder:
            files, remarks = salvage(path, Path(folder))
            told = "; ".join(remarks)
            try:
                with reading(path, "a readable rosbag2", RecordingError):
                    return read(files), remarks
            except RecordingError as error:
                raise RecordingError(f"{error} ({told})") from None


def _refuse_bombs(source: Path) -> None:
    """Refuse an MCAP file with a chunk that unpacks to too much, before it is unpacked."""
    if source.stat().st_size < len(MAGIC):
        return
    with (
        source.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped,
        memoryview(mapped) as data,
        data[len(MAGIC) :] as body,
    ):
        for code, content, whole in _records(body):
            with content:
                if code == _CHUNK and whole and len(content) >= 40:
                    size, _, letters = struct.unpack_from("<QII", content, 16)
                    compression = bytes(content[32 : 32 + letters][:8]).decode(errors="replace")
                    with content[32 + letters + 8 :] as packed:
                        refuse_bomb(packed, compression, size)
            if code in (_DATA_END, _FOOTER):
                break


def salvage(path: Path, folder: Path) -> tuple[list[Path], list[str]]:
    """Write the intact messages of a rosbag2 into new storage files.

    Parameters
    ----------
    path : Path
        A bag's folder or storage file.
    folder : Path
        Folder to write to; it must exist and be empty.

    Returns
    -------
    tuple of list of Path, list of str
        New storage files, and remarks on what is missing.

    Raises
    ------
    RecordingError
        When the bag holds no intact message.
    """
    files = storage_files(path)
    expected = _end_by_metadata(path)
    made: list[Path] = []
    remarks: list[str] = []
    for number, source in enumerate(files):
        target = folder / f"salvaged_{number}{source.suffix}"
        found = (_salvage_mcap if source.suffix == ".mcap" else _salvage_sqlite)(source, target)
        last = source is files[-1]
        remarks.append(f"{source.name}: {_in_words(found, expected if last else 0)}")
        if found.messages:
            made.append(target)
    if not made:
        reason = "; ".join(remarks) or "no .mcap and no .db3 in it"
        raise RecordingError(f"{path}: not a readable rosbag2 ({reason})")
    return made, remarks


def _in_words(found: Salvage, expected: int) -> str:
    damage = " and ".join(found.damage or ["is whole, but the bag was never finished"])
    if not found.messages:
        return f"{damage}: no intact message in it"
    read = 1e-9 * (found.end - found.start)
    end = max(found.known_end, expected)
    if end > found.end:
        return f"{damage}: {read:.1f} s of {1e-9 * (end - found.start):.1f} s read"
    return f"{damage}: {read:.1f} s read, the rest is lost"


def _end_by_metadata(path: Path) -> int:
    """End of a bag according to its metadata [ns]; 0 without readable metadata."""
    page = path / "metadata.yaml" if path.is_dir() else path.parent / "metadata.yaml"
    try:
        bag = yaml.safe_load(read_text(page))["rosbag2_bagfile_information"]
        start = int(bag["starting_time"]["nanoseconds_since_epoch"])
        return start + int(bag["duration"]["nanoseconds"])
    except Exception:  # metadata are only wanted for what is told of the end
        return 0


def _records(data: memoryview) -> Iterator[tuple[int, memoryview, bool]]:
    """Code and content of each record, and whether it is complete; the last may be incomplete."""
    place = 0
    while place < len(data):
        if len(data) - place < 9:
            yield data[place], data[len(data) :], False
            return
        size = struct.unpack_from("<Q", data, place + 1)[0]
        end = place + 9 + size
        yield data[place], data[place + 9 : end], end <= len(data)
        place = end


def _salvage_mcap(source: Path, target: Path) -> Salvage:
    if source.stat().st_size < len(MAGIC):
        return Salvage(damage=["file is empty"])
    with (
        source.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped,
        memoryview(mapped) as data,
    ):
        if bytes(data[: len(MAGIC)]) != MAGIC:
            return Salvage(damage=["is no MCAP file"])
        content = _McapContent()
        with data[len(MAGIC) :] as body:
            content.take_file(body)
    return content.write(target)


class _McapContent:
    """Definitions and messages of one file, inside and outside of chunks."""

    def __init__(self) -> None:
        self.found = Salvage(damage=[])
        self._definitions: dict[bytes, None] = {}
        self._channels: set[int] = set()
        self._messages: list[tuple[int, int, bytes]] = []

    def take_file(self, body: memoryview) -> None:
        finished = False
        broken_chunks = 0
        damage: list[str] = []
        for code, content, whole in _records(body):
            if code == _DATA_END:
                finished = True  # a summary follows, which repeats every definition
            elif code == _CHUNK:
                try:
                    self._take_chunk(content, whole)
                except Exception:  # each compression raises other exceptions
                    broken_chunks += whole
            elif whole:
                self._take(code, content)
            if code == _FOOTER:
                break  # no record follows the footer
            if not whole:
                part = "chunk" if code == _CHUNK else "record"
                damage.append(f"recording ends in the middle of a {part}")
        if not finished and not damage:
            damage.append("recording was never finished")
        if broken_chunks:
            damage.append(f"{broken_chunks} chunks cannot be read and are not used")
        self.found.damage = damage

    def _take_chunk(self, content: memoryview, whole: bool) -> None:
        _, end, size, crc, letters = struct.unpack_from("<QQQII", content)
        self.found.known_end = max(self.found.known_end, end)
        compression = bytes(content[32 : 32 + letters]).decode()
        packed = content[32 + letters + 8 :]
        from rosbags.rosbag2 import ReaderError  # noqa: PLC0415  (optional)
        from rosbags.rosbag2.storage_mcap import decompress  # noqa: PLC0415

        refuse_bomb(packed, compression, size)
        if whole:
            records = decompress(bytes(packed), compression, size, crc)
        elif not compression:
            records = bytes(packed)
        else:
            raise ReaderError("part of a compressed chunk")
        for code, inner, complete in _records(memoryview(records)):
            if complete:
                self._take(code, inner)

    def _take(self, code: int, content: memoryview) -> None:
        record = bytes((code,)) + struct.pack("<Q", len(content)) + bytes(content)
        if code == _MESSAGE and len(content) >= 22:
            channel, _, time = struct.unpack_from("<HIQ", content)
            self._messages.append((time, channel, record))
        elif code == _SCHEMA:
            self._definitions[record] = None
        elif code == _CHANNEL and len(content) >= 4:
            self._channels.add(struct.unpack_from("<H", content)[0])
            self._definitions[record] = None

    def write(self, target: Path) -> Salvage:
        found = self.found
        known = [entry for entry in self._messages if entry[1] in self._channels]
        known.sort(key=lambda entry: entry[0])
        found.messages = len(known)
        if known:
            found.start, found.end = known[0][0], known[-1][0]
        header = struct.pack("<I4sI", 4, b"ros2", 0)
        with target.open("wb") as out:
            out.write(MAGIC + struct.pack("<BQ", 0x01, len(header)) + header)
            out.writelines(self._definitions)
            out.writelines(record for _, _, record in known)
            out.write(struct.pack("<BQI", _DATA_END, 4, 0))
            out.write(struct.pack("<BQQQI", _FOOTER, 20, 0, 0, 0) + MAGIC)
        return found


def _salvage_sqlite(source: Path, target: Path) -> Salvage:
    """Copy rows until a branch of the B-tree is missing; it can hold some MB before the cut."""
    copy = target.with_name(f"copy_of_{target.name}")
    shutil.copyfile(source, copy)
    damage: list[str] = []
    for ending in _BESIDE:  # SQLite recovers the data from these files
        beside = source.with_name(source.name + ending)
        if beside.is_file():
            shutil.copyfile(beside, copy.with_name(copy.name + ending))
            damage.append("recording was never finished")
    with copy.open("r+b") as file:
        head = file.read(100)
        if len(head) < 100 or not head.startswith(_SQLITE):
            return Salvage(damage=["is no SQLite file" if head else "file is empty"])
        page = struct.unpack(">H", head[16:18])[0]
        page = 65536 if page == 1 else page
        full = page * struct.unpack(">I", head[28:32])[0]
        left = copy.stat().st_size
        if full > left and page:
            # SQLite needs all pages. Pages of 0xFF belong to no B-tree; in a message they are NaN.
            file.truncate(left - left % page)
            file.seek(0, 2)
            for _ in range(min(full, _FARTHEST * left) // page - left // page):
                file.write(b"\xff" * page)
            damage.append("recording ends in the middle of its file")
    with (
        contextlib.closing(sqlite3.connect(copy)) as old,
        contextlib.closing(sqlite3.connect(target)) as new,
    ):
        old.execute("PRAGMA trusted_schema = OFF")
        for table in _TABLES:
            if not _copy_table(old, new, table):
                damage.append(f"the rest of its table {table} cannot be read")
        new.commit()
        return _span(new, damage)


def _copy_table(old: sqlite3.Connection, new: sqlite3.Connection, table: str) -> bool:
    """Copy a table row by row until an error; return whether all rows were copied."""
    try:
        columns = [row[1] for row in old.execute(f"PRAGMA table_info({table})")]
        if not columns:
            return True
        names = ", ".join('"' + name.replace('"', '""') + '"' for name in columns)
        new.execute(f"CREATE TABLE {table} ({names})")
        marks = ", ".join("?" * len(columns))
        # Rows are read by number, because an index may be damaged.
        for row in old.execute(f"SELECT {names} FROM {table} NOT INDEXED ORDER BY rowid"):
            new.execute(f"INSERT INTO {table} VALUES ({marks})", row)
    except sqlite3.Error:
        return False
    return True


def _span(new: sqlite3.Connection, damage: list[str]) -> Salvage:
    try:
        count, start, end = new.execute(
            "SELECT count(*), min(timestamp), max(timestamp) FROM messages"
        ).fetchone()
    except sqlite3.Error:
        return Salvage(damage=damage)
    return Salvage(count, int(start or 0), int(end or 0), 0, damage)
