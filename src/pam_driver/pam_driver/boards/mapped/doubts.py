"""What is odd about a measurement that can be used: its range and its labels in the DBC file.

Ranges and labels in DBC files are often placeholders, so they are reported before the driver takes
a reading for a defective sensor.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from cantools.database.can import Signal

from pam_driver.boards.mapped.device import MappedInput
from pam_driver.boards.samples import PRESSURE_INPUT
from pam_model.rig.keys import Section
from pam_ros.foreign_text import shown

# Of its span, what a good sensor may show beyond what it measures: offset, noise, the weather.
_MARGIN: Final = 0.01
_COARSE: Final = 1.0 / 128.0
"""Of its span, a step above which a sensor has fewer than 7 bits."""


class Needed(NamedTuple):
    """The values that a signal must be able to show, the span of its sensor, and the unit."""

    low: float
    high: float
    span: float
    unit: str


def doubt_range(
    where: Section, entry: MappedInput, signal: str, place: str, needed: Needed
) -> None:
    """Doubt a range that ends closer to the lowest pressure than a good sensor is exact.

    Parameters
    ----------
    where : Section
        The keys of the signal.
    entry : MappedInput
        How it is read.
    signal, place : str
        Its name, and the file and line that describe it.
    needed : Needed
        What it must be able to show.
    """
    layout = entry.signal.layout
    low, low_of_bits = (
        min(end * entry.gain + entry.bias for end in ends)
        for ends in ((layout.raw_low, layout.raw_high), (layout.bits_low, layout.bits_high))
    )
    lowest = needed.low - _MARGIN * needed.span
    if entry.what == PRESSURE_INPUT and low > max(lowest, low_of_bits):
        where.doubt(
            "signal",
            f" = {signal}: its range in {place} begins at {low:.6g} {needed.unit}, and the sensor "
            f"of an empty muscle may show {lowest:.6g}: such a reading counts as no measurement",
        )


def doubt_numbers(
    where: Section, entry: MappedInput, signal: Signal, place: str, needed: Needed
) -> None:
    """Doubt a range whose ends are exchanged, labels that no raw value has, and a coarse step.

    Parameters
    ----------
    where : Section
        The keys of the signal.
    entry : MappedInput
        How it is read.
    signal : Signal
        As the DBC file describes it.
    place : str
        The file and line that describe it.
    needed : Needed
        What it must be able to show.
    """
    layout = entry.signal.layout
    low, high = signal.minimum, signal.maximum
    if low is not None and high is not None and low > high:
        where.doubt(
            "signal",
            f" = {signal.name}: the ends of its range in {place}, {float(low):g} and "
            f"{float(high):g}, are exchanged",
        )
    for raw, name in layout.labels.items():
        if not layout.float_format and not layout.bits_low <= raw <= layout.bits_high:
            where.doubt(
                "signal",
                f" = {signal.name}: its label {shown(name)} in {place} is at raw {raw}, which its "
                f"{layout.length} bits never show",
            )
    if not layout.float_format and abs(entry.gain) > _COARSE * needed.span:
        where.doubt(
            "signal",
            f" = {signal.name}: one step of its raw value is {abs(entry.gain):.6g} {needed.unit} "
            f"by its factor in {place}, more than 1/{1.0 / _COARSE:.0f} of what is measured",
        )


def doubt_labels(where: Section, entry: MappedInput, needed: Needed) -> None:
    """Doubt a label at a value that is reached: it would count as a defective sensor.

    Parameters
    ----------
    where : Section
        The keys of the signal.
    entry : MappedInput
        How it is read.
    needed : Needed
        What it must be able to show.
    """
    layout, margin = entry.signal.layout, _MARGIN * needed.span
    for raw in entry.invalid.keys() & layout.labels.keys():
        value = raw * entry.gain + entry.bias
        if needed.low - margin <= value <= needed.high + margin:
            where.doubt(
                "valid",
                f": {layout.name} has the label {shown(layout.labels[raw])} at raw {raw}, which is "
                f"{value:.6g} {needed.unit}: it counts as no measurement unless valid lists the "
                "label",
            )
