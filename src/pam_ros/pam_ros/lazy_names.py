"""Public names of a package that are imported when they are first used.

Importing a package then takes no time, and whoever uses one of its names waits for this one alone.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, places: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package, which also has a `__version__`.

    Parameters
    ----------
    package : str
        Its name.
    places : mapping of str to str
        For each module, below the package, the names in it with spaces between them.
    """
    homes = {name: module for module, names in places.items() for name in names.split()}

    def get(name: str) -> Any:
        if name == "__version__":
            from pam_ros.version import installed_version  # noqa: PLC0415  (slow to import)

            return installed_version(package)
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    def known() -> list[str]:
        return sorted({*vars(sys.modules[package]), *homes})

    return get, known
