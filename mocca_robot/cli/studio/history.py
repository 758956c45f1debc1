"""What a window holds in hand: configurations one after the other, none of them ever changed, with undo and redo."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mocca_robot.config.schema import KEYS
from mocca_robot.errors import InputError, nearest
from mocca_robot.files.documents import parse_yaml
from mocca_robot.files.goals import goals_from_data

KEPT = 500
"""Steps that can be undone."""
PATHS = ("model",)
"""Keys whose value is a path: told from the studio's side only, never typed into the page."""
SECTIONS = ("joints", "simulate", "cut")


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """One configuration.

    Attributes:
        data: keys as one writes them in a file; never changed in place.
        folder: where its paths begin.
        label: what made it, for the undo button: 'alpha_deg: 8'.
        path: the key that was changed, '' for none.
    """

    data: Mapping[str, Any]
    folder: Path
    label: str = ""
    path: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class History:
    """Snapshots, and which of them is the present one."""

    snapshots: tuple[Snapshot, ...]
    place: int = 0

    @property
    def now(self) -> Snapshot:
        """Return the present snapshot."""
        return self.snapshots[self.place]

    @property
    def undoes(self) -> str | None:
        """Return what undo takes back; None where there is nothing."""
        return self.now.label if self.place > 0 else None

    @property
    def redoes(self) -> str | None:
        """Return what redo brings again; None where there is nothing."""
        return self.snapshots[self.place + 1].label if self.place + 1 < len(self.snapshots) else None

    def with_step(self, step: Snapshot, merge: bool = False) -> History:
        """Return the history with a new present; with `merge` it replaces one that changed the same key."""
        past = self.snapshots[: self.place + 1]
        if merge and len(past) > 1 and step.path and past[-1].path == step.path:
            past = past[:-1]
        past = (*past, step)[-KEPT:]
        return History(snapshots=past, place=len(past) - 1)

    def moved(self, by: int) -> History:
        """Return the history one step back (−1) or forth (1); at its ends the same."""
        return replace(self, place=min(max(self.place + by, 0), len(self.snapshots) - 1))


def changed(snapshot: Snapshot, path: Sequence[str], value: Any, unit_m: float) -> Snapshot:
    """Return a snapshot with one key set, or without it where `value` is None and None means nothing there.

    Args:
        path: the key and, before it, its section: ['joints', 'margin'], ['parts', NAME, 'density'].
        value: as a file would have it; a text is read as YAML.
        unit_m: metres per unit of lengths.

    Raises InputError, naming key, value and limits, for what that key alone can be refused for.
    """
    if isinstance(value, str):
        value = parse_yaml(value, f"'{'.'.join(path)}'") if value.strip() else None
    _require_valid(path, value, unit_m)
    data: dict[str, Any] = json.loads(json.dumps(snapshot.data))
    inside = data
    for name in path[:-1]:
        inside = inside.setdefault(name, {}) if isinstance(inside.get(name, {}), dict) else {}
    if value is None and path[-1] != "alpha_deg":
        inside.pop(path[-1], None)
        for depth in range(len(path) - 1, 0, -1):  # a section that is left empty goes
            outer: Any = data
            for name in path[: depth - 1]:
                outer = outer.get(name, {})
            if outer.get(path[depth - 1]) == {}:
                del outer[path[depth - 1]]
    else:
        inside[path[-1]] = value
    name = ".".join(path)
    return Snapshot(data=data, folder=snapshot.folder, label=f"{name}: {_short(value)}", path=name)


def _require_valid(path: Sequence[str], value: Any, unit_m: float) -> None:
    name = ".".join(path)
    if not path or path[0] in PATHS:
        raise InputError(f"'{name}' is not changed here; open another file instead.")
    spelt = f"parts.NAME.{path[2]}" if len(path) == 3 and path[0] == "parts" else name
    if path[0] == "generator" and len(path) == 2:
        return  # the generator knows its parameters
    known = {k.name: k for k in KEYS}
    if path[0] == "insertion" and len(path) == 2:
        return
    if spelt not in known:
        raise InputError(f"There is no key '{name}'; {nearest(name, known)}")
    if value is None:
        return
    if spelt == "goal":
        goals_from_data(value, "goal")
    else:
        known[spelt].value(value, name, unit_m)


def _short(value: Any) -> str:
    if value is None:
        return "default"
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else f"{text[:37]}…"


@dataclass(eq=False)
class Saved:
    """The file that a window was opened from or saved to, with its text as it was then."""

    path: Path | None = None
    text: str | None = None
    data: Mapping[str, Any] = field(default_factory=dict)
