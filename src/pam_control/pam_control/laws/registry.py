"""The control laws by name: those of this package, and those of other installed packages.

A package adds a law with an entry point in the group `pam_control.control_laws`; its value is a
subclass of `Law`. The parameters of the law are its declared fields: they become parameters of the
node, keys of its parameter file and rows of `pam control parameters`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import Final

from pam_control.declared import Declared, declarations
from pam_control.laws.gravity_compensation import GravityCompensation
from pam_control.laws.impedance import Impedance
from pam_control.laws.law import AnyLaw, Law
from pam_control.laws.position_stiffness import PositionStiffness
from pam_control.laws.pressure_difference_pid import PressureDifferencePid
from pam_control.laws.pressure_ratio_pid import PressureRatioPid
from pam_control.laws.torque import Torque
from pam_control.settings import ControlSettings
from pam_model.errors import PamError

GROUP: Final = "pam_control.control_laws"
OWN: Final[tuple[type[AnyLaw], ...]] = (
    PositionStiffness,
    PressureRatioPid,
    PressureDifferencePid,
    Impedance,
    Torque,
    GravityCompensation,
)


@cache
def laws() -> Mapping[str, type[AnyLaw]]:
    """All laws by name: those of this package first.

    Raises
    ------
    PamError
        If an installed law cannot be loaded, has a name that is in use, or declares a parameter in
        another way than the one of this name that is there already.
    """
    found: dict[str, type[AnyLaw]] = {law.name: law for law in OWN}
    known = {each.key: each for _, each in declarations(ControlSettings)}
    for law in OWN:
        known.update({each.key: each for _, each in declarations(law)})
    for entry in entry_points(group=GROUP):
        try:
            law = entry.load()
            is_law = isinstance(law, type) and issubclass(law, Law)
        except Exception as error:  # the import of another package may raise anything
            raise PamError(
                f"the control law {entry.name} ({entry.value}) cannot be loaded: {error}"
            ) from error
        if not is_law or law.name != entry.name:
            raise PamError(f"{entry.value}: is not a subclass of Law with the name {entry.name}")
        if law.name in found:
            raise PamError(f"two control laws are called {law.name}; one is {entry.value}")
        for _, each in declarations(law):
            if known.setdefault(each.key, each) != each:
                raise PamError(
                    f"the control law {law.name} declares {each.key}, which is another parameter"
                )
        found[law.name] = law
    return found


def users(parameter: Declared) -> tuple[str, ...]:
    """The laws that use a parameter; empty if all do."""
    return parameter.laws or tuple(
        name
        for name, law in laws().items()
        if any(each.key == parameter.key for _, each in declarations(law))
    )
