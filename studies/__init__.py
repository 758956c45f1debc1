"""Parameter studies: many designs of one assembly, side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from studies.run import StudyResult, run_study
    from studies.study import Point, Study, read_study

__all__ = ["Point", "Study", "StudyResult", "read_study", "run_study"]

_HOME = {"StudyResult": "run", "run_study": "run", "Point": "study", "Study": "study", "read_study": "study"}


def __getattr__(name: str) -> Any:
    """Return a public name, importing its module on first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"studies.{_HOME[name]}"), name)
