"""Reads the numbers of NPZ, MAT, HDF5 and JSON files as named columns of equal length.

A two-dimensional array gives one column for each of its own, named `name.0`, `name.1`, and so on.
What lies in a group, a structure or an object is called `group.name`, and what lies in a cell
`name.0.field`. Single numbers and arrays of other lengths than the longest are left out, and so is
text, but for that in a list of JSON, such as a date or the name of a signal.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from pam_gap.recordings.size_limits import Allowance
from pam_model.reading import read_text
from pam_ros.foreign_text import shown

MAT: Final = (".mat",)
HDF5: Final = (".h5", ".hdf5", ".he5")
HDF5_SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
_OF_MATLAB: Final = "#refs#"
"""Group in which MATLAB keeps cells and objects of a file of version 7.3."""
_MOST_NESTED: Final = 4
"""Levels of structures and objects that are searched for numbers."""
_MOST_CELLS: Final = 1000
"""Cells of a list of arrays or structures that are searched for numbers."""

Named = Iterator[tuple[str, Any]]


def _nested(name: str, value: Any, depth: int = 0) -> Named:
    """The arrays in a value: of structures, objects, lists of objects and arrays."""
    if depth > _MOST_NESTED:
        return
    inside = f"{name}." if name else ""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _nested(f"{inside}{key}", part, depth + 1)
    elif hasattr(value, "_fieldnames"):  # a MATLAB structure
        for key in value._fieldnames:
            yield from _nested(f"{inside}{key}", getattr(value, key), depth + 1)
    elif isinstance(value, Sequence) and value and isinstance(value[0], Mapping):
        yield from _of_rows(inside, value)
    elif isinstance(value, np.ndarray):
        yield from _of_array(name, inside, value, depth)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        yield name, _numbers(value)


def _of_rows(inside: str, value: Sequence[Any]) -> Named:
    """The columns of a list of objects."""
    rows = [dict(_leaves("", row)) for row in value if isinstance(row, Mapping)]
    keys = dict.fromkeys(key for row in rows for key in row)
    Allowance().take((len(rows), len(keys)), 8, "a list of objects with different names")
    for key in keys:
        yield f"{inside}{key}", _numbers([row.get(key) for row in rows])


def _of_array(name: str, inside: str, value: Any, depth: int) -> Named:
    """The arrays in an array: itself, its named fields, or what its cells hold."""
    if value.dtype.names:
        for key in value.dtype.names:
            yield f"{inside}{key}", value[key]
    elif value.dtype == object:  # cells, or several structures
        for place, part in enumerate(value.ravel()[:_MOST_CELLS]):
            yield from _nested(f"{inside}{place}", part, depth + 1)
    else:
        yield name, value


def _leaves(name: str, value: Any) -> Named:
    """The values of one row of a log, with the names of the objects and lists around them."""
    inside = f"{name}." if name else ""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _leaves(f"{inside}{key}", part)
    elif isinstance(value, list):
        for place, part in enumerate(value):
            yield from _leaves(f"{inside}{place}", part)
    else:
        yield name, value


def _numbers(values: Sequence[Any]) -> Any:
    """A list as an array of numbers, or of objects if it holds text; None if its rows differ."""
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        if any(isinstance(value, Sequence) and not isinstance(value, str) for value in values):
            return None
    if any(isinstance(value, str) for value in values):
        texts = np.empty(len(values), dtype=object)
        texts[:] = values
        return texts
    return np.array([_number(value) for value in values])


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return np.nan


def npz_arrays(path: Path) -> Iterator[tuple[str, Any]]:
    """The arrays of an NPZ file; what their headers claim is checked before they are read."""
    left = Allowance()
    with np.load(path, allow_pickle=False) as file:
        for name in file.files:
            with file.zip.open(f"{name}.npy") as entry:
                version = np.lib.format.read_magic(entry)
                read = np.lib.format.read_array_header_1_0
                if version != (1, 0):
                    read = np.lib.format.read_array_header_2_0
                shape, _, kind = read(entry)
            left.take(shape, kind.itemsize, f"array {shown(name)}")
            yield name, file[name]


def _npz(path: Path) -> Named:
    for name, array in npz_arrays(path):
        yield from _nested(name, array)


def _mat(path: Path) -> Named:
    with path.open("rb") as file:
        # MATLAB puts a header of 512 bytes before an HDF5 file.
        if HDF5_SIGNATURE in (file.read(8), file.seek(512) and file.read(8)):
            yield from _hdf5(path)
            return
    from scipy.io import loadmat  # noqa: PLC0415  (slow to import, for these files alone)

    for name, value in loadmat(path, squeeze_me=True, struct_as_record=False).items():
        if not name.startswith("__"):
            yield from _nested(name, value)


def _hdf5(path: Path) -> Named:
    import h5py  # noqa: PLC0415  (slow to import, for these files alone)

    left = Allowance()
    found: list[tuple[str, Any]] = []

    def visit(name: str, item: object) -> None:
        if not isinstance(item, h5py.Dataset) or name.startswith(_OF_MATLAB):
            return
        # Numbers that lie in other files are none of this log.
        if item.shape is None or item.external or item.is_virtual:
            return
        if item.dtype.hasobject:  # texts, which are left out in any case
            return
        if item.attrs.get("MATLAB_class") not in (b"char", b"cell"):
            left.take(item.shape, item.dtype.itemsize, f"array {shown(name)}")
            found.extend(_nested(name.replace("/", "."), np.asarray(item[()])))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    yield from found


def _json(path: Path) -> Named:
    text = read_text(path)
    if path.suffix.lower() in (".jsonl", ".ndjson"):
        lines = enumerate(text.split("\n"), 1)
        content: Any = [_row(number, line) for number, line in lines if line.strip()]
    else:
        content = json.loads(text)
    yield from _nested("", content)


def _row(number: int, line: str) -> Any:
    try:
        return json.loads(line)
    except json.JSONDecodeError as error:
        raise ValueError(f"line {number}, column {error.colno}: {error.msg}") from None


_READERS: Final[Mapping[str, Callable[[Path], Named]]] = {
    ".npz": _npz,
    **dict.fromkeys(MAT, _mat),
    **dict.fromkeys(HDF5, _hdf5),
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), _json),
}
ARRAYS: Final = tuple(_READERS)
"""Endings of the files that this module reads."""


def read_arrays(path: Path) -> dict[str, Any]:
    """The numbers in a file, and the text in lists of JSON, as columns of equal length.

    Parameters
    ----------
    path : Path
        A file with one of the endings `ARRAYS`.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        The columns.

    Raises
    ------
    ValueError
        When the file holds no array of numbers, or claims more than `size_limits` allows; others of
        the libraries when it is damaged, for a caller within `reading`.
    """
    columns: dict[str, Any] = {}
    for name, array in _READERS[path.suffix.lower()](path):
        if array is None or not (array.dtype == object or np.issubdtype(array.dtype, np.number)):
            continue
        flat = np.squeeze(array)
        if flat.ndim == 1:
            columns[name or "values"] = flat
        elif flat.ndim == 2:
            tall = flat if flat.shape[0] >= flat.shape[1] else flat.T
            start = f"{name}." if name else ""
            columns |= {f"{start}{k}": tall[:, k] for k in range(tall.shape[1])}
    longest = max((column.size for column in columns.values()), default=0)
    if longest < 2:
        raise ValueError("no array of numbers")
    return {name: column for name, column in columns.items() if column.size == longest}
