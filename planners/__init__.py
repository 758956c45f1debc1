"""What to decide: joints for an assembly (`design`), and later how to build it with a robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planners.cone_joints.designer import Designed, design

__all__ = ["Designed", "design"]


def __getattr__(name: str) -> Any:
    """Return a public name, importing the designer on first use (PEP 562)."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from planners.cone_joints import designer

    return getattr(designer, name)
