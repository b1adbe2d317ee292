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
    """One row.

    Attributes
    ----------
    key : str
        Name for `pam model show`, for the picture and for links.
    family : str
        One of `FAMILIES`.
    title : str
        Heading for a reader.
    equations : str
        Equation numbers in the review; empty for length-force models, which register them.
    status : str
        derived, published, empirical or stand-in; empty for length-force models, as above.
    models : tuple of str
        Names of length-force models, as a rig file's `<muscle>.model` gives them.
    objects : tuple of str
        "module:name" of other classes and functions that implement the row.
    domain : str
        Where the model is valid.
    use, avoid : str
        What the model is suited for, and what it is not suited for.
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
