"""Measured points of one muscle, and the tables from which they are read.

The usual table is a CSV with a header row and SI units: `pressure` [Pa gauge], `force` [N, pull
positive] and either `length` [m] or, if only a displacement was measured, `shortening` [m] from an
unknown rest length. Optional columns are `velocity` [m/s, lengthening positive], `block` (a number
or name for each run or cycle; one block at a time is held out) and `branch` (a name such as rising
or falling; branches are fitted separately). Rows that start with # are skipped.
A unit in brackets may follow a name, such as `pressure [bar]` or `length [mm]`. Semicolons and tabs
may separate columns, with decimal commas or points.

The other table, which begins with WEIGHT, is the pressure staircase of a platform on several
muscles; see `load_staircase`.
"""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pam_model.errors import PamError
from pam_model.reading import read_limited, reading
from pam_model.table_dialect import decimal_mark, decoded, separator
from pam_model.unit_hints import conversion_hint, other_units
from pam_ros.foreign_text import all_shown, shown

STANDARD_GRAVITY = 9.80665
NOMINAL_SPEED = 1e-3
"""Speed assigned to a quasi-static branch, so that dry friction has a direction [m/s]."""
_ZERO_SHARE = 0.05
"""Share of the largest pull by which the zero of a load cell may be off."""
_STAIRCASE_HEADER = ("WEIGHT", "STEPS", "mb per step", "CYCLES")
_FIRST_DISPLACEMENT = 4
_LEAST_PRESSURE = 1e3
_LARGEST_LENGTH = 10.0
_USUAL_PRESSURES = (3e4, 2.5e6)
"""Range of the largest pressure of a table, by which a foreign unit is recognised [Pa]."""

_UNITS = {"pressure": "Pa", "force": "N", "length": "m", "shortening": "m", "velocity": "m/s"}
_WITH_UNIT = re.compile(r"(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]")

Array = npt.NDArray[np.float64]

_OF_POINTS = ("pressure", "position", "force", "velocity", "block", "cluster", "branch")
"""Fields with one entry per point."""


@dataclass(frozen=True, slots=True)
class Measurements:
    """Points of one muscle; all arrays have one entry per point."""

    name: str  # source of the points, for messages and figures
    pressure: Array  # gauge [Pa]
    position: Array  # length [m], or shortening from an unknown rest length [m]
    force: Array  # pull [N]
    velocity: Array  # lengthening speed [m/s]
    block: npt.NDArray[np.str_]  # run or cycle; held out one at a time
    # points that share their errors (one moment, one stop), for intervals and the bootstrap
    cluster: npt.NDArray[np.int64]
    branch: npt.NDArray[np.str_]  # "" or the name of the branch
    is_shortening: bool  # whether `position` is a shortening
    assumptions: tuple[str, ...] = ()  # assumptions made when the table was read

    def __len__(self) -> int:
        return int(self.pressure.size)

    @property
    def only_pulls(self) -> bool:
        """Whether no point pushes by more than the zero of a load cell may be off."""
        pull = float(np.max(self.force, initial=0.0))
        return float(np.min(self.force, initial=0.0)) >= -_ZERO_SHARE * pull

    def select(self, mask: npt.NDArray[np.bool_]) -> Measurements:
        """The points where the mask is true."""
        selected = {name: getattr(self, name)[mask] for name in _OF_POINTS}
        return replace(self, **selected)

    def branches(self) -> dict[str, Measurements]:
        """The points of each branch, in order of first appearance."""
        names = list(dict.fromkeys(str(b) for b in self.branch))
        return {name: self.select(self.branch == name) for name in names}

    def with_pressure_blocks(self, number: int) -> Measurements:
        """The same points with pressure bands as blocks: held-out errors then test extrapolation.

        Raises
        ------
        PamError
            For more bands than different pressures, or fewer than 2 bands.
        """
        levels = np.unique(self.pressure)
        if not 2 <= number <= levels.size:
            raise PamError(
                f"{self.name}: {number} pressure bands, expected 2 to {levels.size}, "
                "the number of different pressures"
            )
        bands = np.array_split(levels, number)
        edges = [float(band[-1]) for band in bands[:-1]]
        block = np.searchsorted(edges, self.pressure, side="left").astype(np.str_)
        return replace(self, block=block)


def load_measurements(
    path: str | Path, *, load_share: int = 6, gravity: float = STANDARD_GRAVITY
) -> Measurements:
    """Read either kind of table.

    Parameters
    ----------
    path : str or Path
        The file.
    load_share : int
        For a staircase: number of muscles that carry the weight.
    gravity : float
        For a staircase: gravitational acceleration [m/s^2].

    Raises
    ------
    PamError
        For a file that cannot be read or used; the message names file, line, column and what was
        expected. Also if all pressures are below 1 kPa or a length is above 10 m, since such a
        table has other units.
    """
    path = Path(path)
    with reading(path, "a readable table of points"):
        return _load(path, load_share, gravity)


def _load(path: Path, load_share: int, gravity: float) -> Measurements:
    lines = decoded(read_limited(path)).splitlines()
    lines = [line for line in lines if not line.startswith("#")]
    between = separator(lines[0]) if lines else ","
    rows = list(csv.reader(lines, delimiter=between))
    if decimal_mark(lines[1:], between) == ",":
        rows = [rows[0], *([cell.replace(",", ".") for cell in row] for row in rows[1:])]
    if rows and rows[0] and rows[0][0] == _STAIRCASE_HEADER[0]:
        return load_staircase(path, rows, load_share=load_share, gravity=gravity)
    return _load_points(path, rows)


def _heading(cell: str, path: Path) -> tuple[str, float]:
    """Name of a column, and the factor of the unit behind it, such as "Pressure [bar]"."""
    found = _WITH_UNIT.fullmatch(cell)
    name = (found[1] if found else cell).lower()
    expected = _UNITS.get(name)
    if expected is None or found is None:
        return (cell if expected is None else name), 1.0
    scales = {expected: 1.0, **other_units(expected)}
    unit = found[2].removeprefix("in ")
    if unit not in scales:
        raise PamError(
            f"{path}: {shown(cell)}: unit {shown(unit)}; expected one of {', '.join(scales)}"
        )
    return name, scales[unit]


def _headings(cells: list[str], path: Path) -> list[tuple[str, float]]:
    """Name and factor of each column; one in another unit is a stranger if another will do."""
    found: list[tuple[str, float] | PamError] = []
    for cell in cells:
        try:
            found.append(_heading(cell, path))
        except PamError as error:
            found.append(error)
    known = {entry[0] for entry in found if isinstance(entry, tuple)}
    named: list[tuple[str, float]] = []
    for cell, entry in zip(cells, found, strict=True):
        if isinstance(entry, tuple):
            named.append(entry)
        elif re.split(r"\s*[\[(]", cell)[0].lower() in known:  # as volts beside bar
            named.append((cell, 1.0))
        else:
            raise entry
    return named


def _load_points(path: Path, rows: list[list[str]]) -> Measurements:
    rows = [row for row in rows if any(cell.strip() for cell in row)]
    if not rows:
        raise PamError(f"{path}: empty; expected a header row and points")
    headings = _headings([cell.strip() for cell in rows[0]], path)
    header, scales = [name for name, _ in headings], dict(headings)
    position = [name for name in ("length", "shortening") if name in header]
    missing = [name for name in ("pressure", "force") if name not in header]
    if not position:
        missing.append("length or shortening")
    if missing or len(position) != 1:
        wrong = f"no {', no '.join(missing)}" if missing else "both length and shortening"
        raise PamError(
            f"{path}: header has {all_shown(rows[0])}, {wrong}; expected pressure [Pa], force [N] "
            "and either length [m] or shortening [m], optionally velocity [m/s], block, branch; "
            "rename the columns"
        )

    def column(name: str, default: str | None = None) -> list[str]:
        if name not in header:
            assert default is not None
            return [default] * (len(rows) - 1)
        at = header.index(name)
        short = [i for i, row in enumerate(rows[1:], 2) if len(row) <= at]
        if short:
            raise PamError(f"{path}: row {short[0]} has no {name}")
        return [row[at].strip() for row in rows[1:]]

    def numbers(name: str, default: str | None = None) -> Array:
        values = []
        for row, cell in enumerate(column(name, default), 2):
            values.append(_number(cell, f"{path}: row {row}, {name}"))
        return scales.get(name, 1.0) * np.array(values)

    count = len(rows) - 1
    if not count:
        raise PamError(f"{path}: has a header row but no points")
    pressure, place = numbers("pressure"), numbers(position[0])
    # A table in other units would give a wrong fit without an error.
    if 0.0 < (largest := float(np.max(np.abs(pressure)))) < _LEAST_PRESSURE:
        hint = conversion_hint(largest, "Pa gauge", *_USUAL_PRESSURES)
        raise PamError(f"{path}: largest pressure is {largest:g}; expected Pa gauge{hint}")
    if (longest := float(np.max(np.abs(place)))) > _LARGEST_LENGTH:
        hint = conversion_hint(longest, "m", 0.0, _LARGEST_LENGTH)
        raise PamError(f"{path}: largest {position[0]} is {longest:g}; expected m{hint}")
    force = numbers("force")
    if float(np.max(force)) <= 0.0 and (pushing := int(np.count_nonzero(force < 0.0))):
        raise PamError(
            f"{path}: force: {pushing} of {count} points are below 0 and none is above; the pull "
            "of a muscle is positive: reverse the sign of the load cell"
        )
    return Measurements(
        path.name,
        pressure,
        place,
        force,
        numbers("velocity", "0"),
        np.array(column("block", "1"), dtype=np.str_),
        np.arange(count, dtype=np.int64),
        np.array(column("branch", ""), dtype=np.str_),
        position[0] == "shortening",
    )


def load_staircase(
    path: Path, rows: list[list[str]], *, load_share: int, gravity: float
) -> Measurements:
    """Read the staircase of a platform on several muscles.

    The table has the weight; then cycle, direction (0 up, 1 down), step, mbar and mm per muscle.

    Every muscle gives one point. The weight is read as a mass [kg] that the muscles share evenly
    and carry along their axes; the displacement is read as shortening from a rest length that the
    table does not contain.

    Parameters
    ----------
    path : Path
        For messages.
    rows : list of list of str
        The table's cells.
    load_share : int
        Number of muscles that carry the weight.
    gravity : float
        Gravitational acceleration [m/s^2].

    Raises
    ------
    PamError
        For a table that is not of this kind, or a share or gravity not above 0.
    """
    if load_share < 1 or not (math.isfinite(gravity) and gravity > 0.0):
        raise PamError(f"load share {load_share} and gravity {gravity} m/s^2 must be above 0")
    head = {row[0]: row[1] for row in rows[:4] if len(row) > 1}
    for key in _STAIRCASE_HEADER:
        if key not in head:
            raise PamError(f"{path}: no line {key}, expected {', '.join(_STAIRCASE_HEADER)}")
    weight = _number(head["WEIGHT"], f"{path}: WEIGHT")
    start = next((i for i, row in enumerate(rows) if row and row[0] == "cycle"), None)
    if start is None:
        raise PamError(f"{path}: no header line that begins with cycle")
    header = rows[start]
    muscles = [i for i, name in enumerate(header) if name.startswith("d") and name[1:].isdigit()]
    pressure, shortening, rising, block, cluster = [], [], [], [], []
    stops: dict[tuple[str, str, str], int] = {}
    for line, row in enumerate(rows[start + 1 :], start + 2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) <= max(muscles, default=_FIRST_DISPLACEMENT):
            raise PamError(f"{path}: line {line} is short, expected {len(header)} columns")
        if row[1] not in ("0", "1"):
            found = shown(row[1])
            raise PamError(f"{path}: line {line}, dir = {found}, expected 0 (up) or 1 (down)")
        stop = stops.setdefault((row[0], row[1], row[2]), len(stops))
        for muscle in muscles:
            where = f"{path}: line {line}, {shown(header[muscle])}"
            pressure.append(100.0 * _number(row[3], f"{path}: line {line}, pressure"))
            shortening.append(1e-3 * _number(row[muscle], where))
            rising.append(row[1] == "0")
            block.append(f"cycle {row[0]}")
            cluster.append(stop)
    if not pressure:
        raise PamError(f"{path}: no points")
    up = np.array(rising)
    force = weight * gravity / load_share
    return Measurements(
        path.name,
        np.array(pressure),
        np.array(shortening),
        np.full(len(pressure), force),
        np.where(up, -NOMINAL_SPEED, NOMINAL_SPEED),
        np.array(block, dtype=np.str_),
        np.array(cluster, dtype=np.int64),
        np.where(up, "pressure rising", "pressure falling"),
        True,
        (
            f"WEIGHT {weight:g} is in kg; {load_share} muscles share it evenly along their axes: "
            f"{force:.1f} N each (a fitted diameter grows with the square root of this force)",
            "displacement is the shortening from the rest length, in mm, and cannot fall below 0 "
            "(the platform rests on its stop)",
            f"each step was reached at {1e3 * NOMINAL_SPEED:g} mm/s in the direction of its branch",
            "the table has no muscle geometry: rest length, braid angle and diameter are fitted",
        ),
    )


def _number(cell: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise PamError(f"{where} = {shown(cell)} is not a number") from None
    if not math.isfinite(value):
        raise PamError(f"{where} = {shown(cell)} is not finite")
    return value
