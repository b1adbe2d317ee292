"""What a row of the catalogue says."""

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
    """One row.

    Attributes
    ----------
    key : str
        Name for `show`, for the picture and for links.
    family : str
        One of `FAMILIES`.
    title : str
        What a person calls it.
    equations : str
        Numbers in the review; for length-force models the register has them.
    status : str
        derived, published, empirical or stand-in; likewise.
    models : tuple of str
        Names of length-force models, as a rig file's `<muscle>.model` gives them.
    objects : tuple of str
        "module:name" of whatever else implements the row.
    domain : str
        Where it holds.
    use, avoid : str
        When to use it and when not.
    """

    key: str
    family: str
    title: str
    equations: str = ""
    status: str = ""
    models: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    domain: str = ""
    use: str = ""
    avoid: str = ""
