"""The data type of one row of the catalogue."""

from __future__ import annotations

from dataclasses import dataclass

FAMILIES = (
    "contraction and extension",
    "bidirectional",
    "bending",
    "phenomenological",
    "empirical",
    "supply",
    "losses",
)


@dataclass(frozen=True, slots=True)
class CatalogueRow:
    """One row."""

    key: str  # name for `pam model show`, for the picture and for links
    family: str  # one of `FAMILIES`
    title: str  # heading for a reader
    # equation numbers in the review; empty for length-force models, which register them
    equations: str = ""
    # derived, published, empirical or stand-in; empty for length-force models, as above
    status: str = ""
    # names of length-force models, as a rig file's `<muscle>.model` gives them
    models: tuple[str, ...] = ()
    # "module:name" of other classes and functions that implement the row
    objects: tuple[str, ...] = ()
    domain: str = ""  # where the model is valid
    # use, avoid: what the model is suited for, and what it is not suited for
    use: str = ""
    avoid: str = ""
