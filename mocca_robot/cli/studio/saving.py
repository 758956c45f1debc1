"""A configuration → YAML as people keep it: what was not changed stays as it was written, comments and all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mocca_robot.cli.studio.history import Saved, Snapshot
from mocca_robot.cli.studio.opening import FILES
from mocca_robot.config.schema import KEYS
from mocca_robot.files.documents import yaml_key_lines, yaml_text
from mocca_robot.files.output import move_into_place, write_atomic

WIDE = 110


def as_yaml(data: Mapping[str, Any], earlier: str | None = None, was: Mapping[str, Any] | None = None) -> str:
    """Return `data` as the text of a configuration that `load` reads back to the same.

    Where it was read from a text `earlier`, which says `was`, keys with the same value keep their lines.
    """
    if earlier is None or was is None:
        return "".join(_block(key, data[key]) for key in _ordered(data))
    blocks = _blocks(earlier)
    written, out = set(), []
    for key, lines in blocks:
        if key is None:
            out.append(lines)
            continue
        comment = _comment_after(lines)
        if key in data:
            out.append(lines if data[key] == was.get(key) else _block(key, data[key]) + comment)
        else:
            out.append(comment)
        written.add(key)
    text = "".join(out)
    if text and not text.endswith("\n"):
        text += "\n"
    return text + "".join(_block(key, data[key]) for key in _ordered(data) if key not in written)


def _blocks(text: str) -> list[tuple[str | None, str]]:
    """Return a text cut at its top-level keys: (None, what stands before the first), then (key, its lines)."""
    lines = text.splitlines(keepends=True)
    starts = sorted((line, path[0]) for path, line in yaml_key_lines(text).items() if len(path) == 1)
    found: list[tuple[str | None, str]] = []
    first = starts[0][0] if starts else len(lines) + 1
    found.append((None, "".join(lines[: first - 1])))
    for k, (line, key) in enumerate(starts):
        end = starts[k + 1][0] - 1 if k + 1 < len(starts) else len(lines)
        found.append((key, "".join(lines[line - 1 : end])))
    return found


def _comment_after(lines: str) -> str:
    """Return the comments and empty lines at the end of a key's lines: they belong to what follows."""
    kept = lines.splitlines(keepends=True)
    count = 0
    while count < len(kept) - 1 and (not kept[-1 - count].strip() or kept[-1 - count].startswith("#")):
        count += 1
    return "".join(kept[len(kept) - count :])


def _block(key: str, value: Any) -> str:
    line = f"{yaml_text(key)}: {yaml_text(value)}\n"
    if len(line) <= WIDE or not value:
        return line
    if isinstance(value, Mapping):
        return f"{yaml_text(key)}:\n" + "".join(f"  {yaml_text(k)}: {yaml_text(v)}\n" for k, v in value.items())
    if isinstance(value, list):
        return f"{yaml_text(key)}:\n" + "".join(f"  - {yaml_text(v)}\n" for v in value)
    return line


def _ordered(data: Mapping[str, Any]) -> list[str]:
    order = {key.name: k for k, key in enumerate(KEYS)}
    return sorted(data, key=lambda name: order.get(name, len(order)))


def with_full_paths(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return `data` whose paths, which begin in `folder`, are full ones: it can be read from anywhere."""
    out = dict(data)
    if isinstance(out.get("model"), str):
        out["model"] = (folder / out["model"]).resolve().as_posix()
    generator = out.get("generator")
    if isinstance(generator, Mapping):
        full = {k: (folder / v).resolve().as_posix() for k, v in generator.items() if k in FILES and isinstance(v, str)}
        out["generator"] = {**generator, **full}
    return out


def with_model_beside(data: Mapping[str, Any], folder: Path, target: Path, passing: Path) -> dict[str, Any]:
    """Return `data` as it is saved to the file `target`: paths as seen from there.

    Files below `passing`, which will not stay, are copied beside it. Raises EnvironmentNeeded when they cannot be.
    """
    full = with_full_paths(data, folder)
    if "model" in full:
        full["model"] = _kept(Path(full["model"]), target, passing)
    if isinstance(full.get("generator"), Mapping):
        full["generator"] = {
            k: _kept(Path(v), target, passing) if k in FILES else v for k, v in full["generator"].items()
        }
    return full


def same(now: Snapshot, saved: Saved) -> bool:
    """Return whether a file holds what is in hand."""
    if saved.path is None:
        return False
    return with_full_paths(now.data, now.folder) == with_full_paths(saved.data, saved.path.parent)


def _kept(file: Path, target: Path, passing: Path) -> str:
    folder = target.resolve().parent
    if file.is_relative_to(passing.resolve()):
        beside = folder / f"{target.stem}_parts{file.suffix}"
        if file.is_dir():
            with move_into_place(beside) as temporary:
                for one in file.iterdir():
                    shutil.copy(one, temporary / one.name)
        else:
            write_atomic(beside, file.read_bytes())
        file = beside
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive
        return file.as_posix()
