"""Opening what somebody names or drops: a configuration, or any model, which gets one that can be worked on."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from mocca_robot.assembly import on_the_ground
from mocca_robot.cli.studio.corners import drag
from mocca_robot.cli.studio.history import Saved, Snapshot
from mocca_robot.config.config import configured
from mocca_robot.config.model import read_model
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.assembly_json import assembly_to_data
from mocca_robot.files.documents import MAX_YAML_BYTES, existing_path, parse_yaml, read_text
from mocca_robot.files.output import safe_file_names, write_atomic
from mocca_robot.files.versions import CONFIG

LARGEST_DROP = 64 * 1024 * 1024
"""Bytes that are taken in one drop; larger models are opened from the command line."""
MOST_FILES = 500
CONFIGURATIONS = (".yaml", ".yml")
FILES = ("surface", "lines")
"""Parameters of generators that name files."""
OFFERED = (*CONFIGURATIONS, ".svg", ".dxf", ".3mf", ".glb")
"""Endings of files that are offered to be opened; .json and single meshes are more often parts of something."""


def open_path(path: Path, units: str | None = None) -> tuple[Snapshot, Saved]:
    """Return what a file or folder holds, ready to be worked on. Raises InputError as `config.load` does."""
    if path.suffix.lower() in CONFIGURATIONS:
        text = read_text(path, MAX_YAML_BYTES)
        content = parse_yaml(text, f"'{path}'")
        data, _ = CONFIG.current(fields.mapping(content, f"'{path}'"), f"'{path}'")
        return Snapshot(data=data, folder=path.parent.resolve()), Saved(path.resolve(), text, data)
    existing_path(path)
    return Snapshot(data=_starting(path.resolve(), units), folder=path.parent.resolve()), Saved()


def _starting(path: Path, units: str | None) -> dict[str, Any]:
    """Return a configuration for a model: what it leaves open is set so that one can begin, and can be changed."""
    model = read_model(path, units, None)
    data: dict[str, Any] = {"name": safe_file_names([path.stem])[path.stem], "model": path.name}
    if units is not None:
        data["units"] = units
    parts = model.assembly.parts
    fixed = [p.name for p in parts if p.fixed]
    if "fixed" not in model.given:
        fixed = on_the_ground(parts)
        data["fixed"] = fixed
    if "sequence" not in model.given:
        # From the ground up, which is how most things are built.
        free = [p for p in parts if p.name not in fixed]
        free.sort(key=lambda p: (round(float(p.centroid[-1]) / model.assembly.size, 3), float(p.centroid[0])))
        data["sequence"] = [p.name for p in free]
    return data


def unpack(files: Sequence[tuple[str, bytes]], folder: Path) -> Path:
    """Return the path to open after writing dropped files into `folder`, keeping the folders they came in.

    One file is that file; several are a configuration with what it needs, or a folder of meshes. Raises InputError
    for names that lead out of the folder, and for too many or too large files.
    """
    if not files:
        raise InputError("Nothing was dropped; drop a configuration, a drawing or meshes.")
    if len(files) > MOST_FILES:
        raise InputError(f"{len(files)} files were dropped; at most {MOST_FILES} are taken.")
    if sum(len(content) for _, content in files) > LARGEST_DROP:
        raise InputError(
            f"More than {LARGEST_DROP // 2**20} MB were dropped; open large models with `mocca-robot studio FILE`."
        )
    written = []
    for name, content in files:
        place = PurePosixPath(name.replace("\\", "/"))
        bad = place.is_absolute() or ".." in place.parts or not place.parts or ":" in name or not name.isprintable()
        if bad or len(place.parts) > 8 or len(name) > 240:
            raise InputError(f"A file called '{name[:80]}' is not taken; give it a plain name.")
        target = folder.joinpath(*place.parts)
        written.append(write_atomic(target, content))
    configurations = [f for f in written if f.suffix.lower() in CONFIGURATIONS]
    if len(configurations) == 1:
        _require_dropped(configurations[0], folder)
        return configurations[0]
    if len(configurations) > 1:
        named = ", ".join(f.name for f in configurations[:4])
        raise InputError(f"Several configurations were dropped ({named}); drop one, with the files that it needs.")
    if len(written) == 1:
        return written[0]
    parents = {f.parent for f in written}
    if len(parents) > 1:
        raise InputError("The files lie in several folders; drop one folder of meshes, or one configuration.")
    return parents.pop()


def _require_dropped(configuration: Path, folder: Path) -> None:
    """Raise InputError where a dropped configuration needs a file that was not dropped with it."""
    data = open_path(configuration)[0].data
    generator = data.get("generator")
    named = [data.get("model"), *((generator.get(k) for k in FILES) if isinstance(generator, Mapping) else ())]
    for name in named:
        if not isinstance(name, str):
            continue
        file = (configuration.parent / name).resolve()
        if not file.is_relative_to(folder.resolve()) or not file.exists():
            raise InputError(
                f"'{configuration.name}' needs '{name}', which was not dropped with it; drop both (keep their "
                "folders), or start with `mocca-robot studio FILE`."
            )


def with_corner_moved(
    snapshot: Snapshot, source: Path, keep_in: Path, corner: Sequence[float], to: Sequence[float]
) -> Snapshot:
    """Return a snapshot whose parts have the corner at `corner` (2,), metres, at `to`.

    The parts become an assembly file in `keep_in`, named by what it holds. Raises InputError as `corners.drag`.
    """
    config = configured(snapshot.data, source, snapshot.folder)
    changed = drag(config.assembly, np.asarray(corner, dtype=np.float64), np.asarray(to, dtype=np.float64))
    unit_m = config.unit_m
    content = assembly_to_data(changed)
    content["units"] = config.unit
    for part in content["parts"]:
        part["polygon"] = _in_unit(part["polygon"], unit_m)
        part["holes"] = [_in_unit(ring, unit_m) for ring in part.get("holes", [])]
        part["thickness"] /= unit_m
    for key in ("loads", "combinations"):
        content.pop(key, None)
    text = json.dumps(content, ensure_ascii=False, indent=1)
    file = f"{config.assembly.name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.json"
    write_atomic(keep_in / file, text)
    data = {k: v for k, v in snapshot.data.items() if k not in ("model", "generator", "scale", "up")}
    data = {**data, "name": config.assembly.name, "model": str(keep_in / file), "units": config.unit}
    if config.assembly.actions and "loads" not in data:
        raise InputError("The loads stand in the model's own file; write them into the configuration first.")
    return Snapshot(data=data, folder=snapshot.folder, label="corner moved")


def _in_unit(ring: Sequence[Sequence[float]], unit_m: float) -> list[list[float]]:
    return [[float(f"{v / unit_m:.12g}") for v in point] for point in ring]


def beside(folder: Path) -> list[dict[str, str]]:
    """Return what can be opened in `folder` and one level below, newest first: path and what it is."""
    found: list[tuple[float, Path]] = []
    for pattern in ("*", "*/*"):
        for path in folder.glob(pattern):
            hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
            if not hidden and path.suffix.lower() in OFFERED and path.is_file() and _holds_parts(path):
                found.append((path.stat().st_mtime, path))
            if len(found) >= 2000:
                break
    found.sort(key=lambda item: -item[0])
    return [{"path": str(p), "name": p.relative_to(folder).as_posix()} for _, p in found[:200]]


def _holds_parts(path: Path) -> bool:
    """Return whether a YAML file looks like a configuration; other files do."""
    if path.suffix.lower() not in CONFIGURATIONS:
        return True
    with path.open("rb") as stream:
        return re.search(rb"^(model|generator)\s*:", stream.read(65536), re.MULTILINE) is not None


def as_mapping(content: object) -> Mapping[str, Any]:
    """Return the body of a request. Raises InputError when it is no mapping."""
    return fields.mapping(content, "the request")
