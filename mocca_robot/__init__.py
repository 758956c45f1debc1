"""Cone joints for structures that stand without glue, screws or friction.

In three lines: ``load`` a configuration, ``planners.design`` joints for it, ``sim.simulate`` the result. Names are
imported when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mocca_robot.assembly import Assembly, Equilibrium, Interlocking, Lateral, Mesh, Part, Polygon, SupportFree
    from mocca_robot.contacts import find_contacts
    from mocca_robot.design import Design
    from mocca_robot.errors import EnvironmentNeeded, InputError, MoccaError
    from mocca_robot.files.config import Config, load
    from mocca_robot.files.design_json import read_design, write_design
    from mocca_robot.verify import critical_tilt

_HOMES = {
    "mocca_robot.assembly": (
        *("Assembly", "Equilibrium", "Interlocking", "Lateral", "Mesh", "Part", "Polygon", "SupportFree"),
    ),
    "mocca_robot.contacts": ("find_contacts",),
    "mocca_robot.design": ("Design",),
    "mocca_robot.errors": ("EnvironmentNeeded", "InputError", "MoccaError"),
    "mocca_robot.files.config": ("Config", "load"),
    "mocca_robot.files.design_json": ("read_design", "write_design"),
    "mocca_robot.verify": ("critical_tilt",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Assembly",
    "Config",
    "Design",
    "EnvironmentNeeded",
    "Equilibrium",
    "InputError",
    "Interlocking",
    "Lateral",
    "Mesh",
    "MoccaError",
    "Part",
    "Polygon",
    "SupportFree",
    "critical_tilt",
    "find_contacts",
    "load",
    "read_design",
    "write_design",
]


def __getattr__(name: str) -> Any:
    """Return a public name, importing its module on first use (PEP 562)."""
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME_OF})
