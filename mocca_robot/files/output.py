"""Writing files so that nothing is lost: into a folder known to be writable, complete or not at all."""

from __future__ import annotations

import json
import os
import re
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mocca_robot.errors import EnvironmentNeeded

_RESERVED = {"con", "prn", "aux", "nul", *(f"com{k}" for k in range(10)), *(f"lpt{k}" for k in range(10))}


def make_folder(path: str | Path) -> Path:
    """Create the folder `path` if it is missing and return it, known to take files. Call it before the work starts.

    Raises EnvironmentNeeded when it cannot be created or written, or when its disk is full.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".probe-") as probe:
            probe.write(b"\0" * 4096)
            probe.flush()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise EnvironmentNeeded(
            f"Nothing can be written to the folder '{folder}': {reason}. Name another one (-o DIR) or free it."
        ) from None
    return folder


def prepare_file(asked: str | None, default: Path) -> Path:
    """Create the folder of a file to write, and return the file: `asked` (in it, where it is a folder) or `default`.

    Call it before the work starts: it raises EnvironmentNeeded when the folder takes no files.
    """
    target = default if asked is None else Path(asked)
    if asked is not None and (target.is_dir() or asked.endswith(("/", os.sep))):
        target /= default.name
    make_folder(target.parent)
    return target


def write_atomic(path: Path, content: str | bytes) -> Path:
    """Return `path` after replacing it by `content` in one step: readers see the old file or the new one.

    Text is written as UTF-8. Raises EnvironmentNeeded when the disk is full or the folder read-only; the old
    file is still there then.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    temporary = ""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}-")
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except OSError as error:
        if temporary and os.path.exists(temporary):
            os.unlink(temporary)
        raise EnvironmentNeeded(
            f"'{path}' cannot be written: {error.strerror or error}. Free space or name another folder."
        ) from None
    return path


@contextmanager
def move_into_place(folder: Path) -> Iterator[Path]:
    """Yield an empty folder whose files move into `folder` when the block ends well; after an error they vanish.

    Raises EnvironmentNeeded when they cannot be written.
    """
    make_folder(folder)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".writing-") as temporary:
        try:
            yield Path(temporary)
            for file in sorted(Path(temporary).iterdir()):
                os.replace(file, folder / file.name)
        except OSError as error:
            raise EnvironmentNeeded(
                f"'{folder}' cannot be written: {error.strerror or error}. Free space or name another folder."
            ) from None


def write_json(path: Path, data: Any) -> Path:
    """Return `path` after writing `data` as JSON with every bit of its numbers; one record a line."""
    return write_atomic(path, json_text(data) + "\n")


def json_text(data: Any, depth: int = 0) -> str:
    """Return JSON that a person can read: mappings and lists of mappings indented, everything else on one line."""
    if isinstance(data, dict) and depth < 2:
        inner = [f"{'  ' * (depth + 1)}{_plain(k)}: {json_text(v, depth + 1)}" for k, v in data.items()]
        return "{\n" + ",\n".join(inner) + "\n" + "  " * depth + "}" if inner else "{}"
    if isinstance(data, list) and data and all(isinstance(v, dict) for v in data):
        inner = [f"{'  ' * (depth + 1)}{_plain(v)}" for v in data]
        return "[\n" + ",\n".join(inner) + "\n" + "  " * depth + "]"
    return _plain(data)


def _plain(data: Any) -> str:
    return json.dumps(data, ensure_ascii=False, allow_nan=False)


def safe_file_names(names: Iterable[str]) -> dict[str, str]:
    """Return a file stem per name: ASCII letters, digits, '-', '_' and inner dots; distinct whatever the case.

    A part may be called '../../etc/passwd' or 'NUL'; its file is not.
    """
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        stem = re.sub(r"[^A-Za-z0-9._-]+", "_", name)[:60].strip(".") or "part"
        if stem.lower().split(".")[0] in _RESERVED or stem.startswith("-"):
            stem = f"part_{stem}"
        candidate, count = stem, 1
        while candidate.lower() in taken:
            count += 1
            candidate = f"{stem}_{count}"
        taken.add(candidate.lower())
        found[name] = candidate
    return found


def _umask() -> int:
    current = os.umask(0o022)
    os.umask(current)
    return current
