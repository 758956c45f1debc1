"""The configurations that come with mocca-robot: which there are, and copies of them with the files they need."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mocca_robot.errors import InputError, nearest
from mocca_robot.files.documents import parse_yaml, read_text
from mocca_robot.files.output import make_folder, write_atomic


@dataclass(frozen=True)
class Example:
    """One configuration: its name, what it shows in a sentence, its file, and the files it refers to."""

    name: str
    about: str
    path: Path
    needs: tuple[Path, ...]


def examples_folder() -> Path:
    """Return where the configurations lie: inside the installed package, or `configs/` of a checkout."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "examples", package.parent / "configs"):
        if (folder / "models").is_dir():
            return folder
    raise InputError(f"The examples are missing beside '{package}'; install mocca-robot again.")


def examples() -> tuple[Example, ...]:
    """Return the configurations by name, then robot cells (`cells/…`) and studies (`studies/…`)."""
    folder = examples_folder()
    files = [f for inside in (".", "cells", "studies") for f in sorted((folder / inside).glob("*.yaml"))]
    return tuple(_example(f, folder) for f in files)


def _example(path: Path, folder: Path) -> Example:
    text = read_text(path)
    about = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        if not line.startswith("#   "):  # an indented command
            about.append(line.lstrip("# ").rstrip())
    data = parse_yaml(text, f"'{path}'") or {}
    generator = data.get("generator") or {}
    named = [data.get("model"), *(generator.get(k) for k in ("surface", "lines"))]
    needs = [path.parent / str(n) for n in named if n]
    if data.get("base"):
        base = _example((path.parent / str(data["base"])).resolve(), folder)
        needs += [base.path, *base.needs]
    return Example(path.relative_to(folder).with_suffix("").as_posix(), " ".join(about), path, tuple(needs))


def copy_examples(names: list[str], target: Path) -> list[Path]:
    """Return the files written below `target` for the examples called `names`, folders kept.

    Raises InputError for unknown names and, before anything is written, when a file is there already with another
    content.
    """
    known = {e.name: e for e in examples()}
    for name in names:
        if name not in known:
            raise InputError(f"There is no example '{name}'; {nearest(name, known)}")
    folder = examples_folder()
    wanted = list(dict.fromkeys(f for n in names for f in (known[n].path, *known[n].needs)))
    content = {target / f.relative_to(folder): f.read_bytes() for f in wanted}
    for file, data in content.items():
        if file.exists() and (not file.is_file() or file.read_bytes() != data):
            raise InputError(f"'{file}' is there already and differs; name another folder (-o DIR) or move it away.")
    make_folder(target)
    return [write_atomic(file, data) for file, data in content.items()]
