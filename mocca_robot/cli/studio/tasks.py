"""What the page can ask for: one small function per request, from a window's session and plain data to plain data."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mocca_robot.cli.studio.session import Session
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.documents import yaml_text
from mocca_robot.files.output import make_folder, safe_file_names, write_atomic

Asked = Mapping[str, Any]


def _open(session: Session, asked: Asked) -> None:
    session.open(
        session.start / fields.text(asked.get("path"), "path"), asked.get("units") or None, bool(asked.get("example"))
    )


def _change(session: Session, asked: Asked) -> None:
    path = [str(p) for p in asked.get("path", [])]
    session.change(path, asked.get("value"), bool(asked.get("merge")))


def _corner(session: Session, asked: Asked) -> None:
    session.move_corner(_point(asked.get("corner"), "corner"), _point(asked.get("to"), "to"))


def _point(value: Any, where: str) -> list[float]:
    return [float(v) for v in fields.vector(value, where, (2,))]


def _undo(session: Session, asked: Asked) -> None:
    session.travel(-1)


def _redo(session: Session, asked: Asked) -> None:
    session.travel(1)


def _ask(session: Session, asked: Asked) -> None:
    kind = fields.choice(asked.get("do"), ("tilt", "let_go"), "do")
    which = fields.choice(asked.get("which", "result"), ("input", "result"), "which")
    session.ask(
        {
            "do": kind,
            "which": which,
            "angle_deg": fields.number(asked.get("angle_deg", 0.0), "angle_deg", 0.0, 90.0),
            "azimuth_deg": fields.number(asked.get("azimuth_deg", 0.0), "azimuth_deg", -360.0, 360.0),
            "question": fields.integer(asked.get("question", 0), "question", 0, 2**31),
        }
    )


def _save(session: Session, asked: Asked) -> dict[str, Any]:
    given = os.path.expanduser(fields.text(asked.get("path"), "path").strip())
    target = session.start / (given if given.lower().endswith((".yaml", ".yml")) else f"{given}.yaml")
    make_folder(target.parent)
    return {"path": str(session.save(target, bool(asked.get("overwrite"))))}


def _job(session: Session, asked: Asked) -> dict[str, Any]:
    kind = fields.choice(asked.get("kind"), tuple(JOBS), "kind")
    name = safe_file_names([session.source.stem])[session.source.stem]
    text = session.text()
    number = len(session.jobs.listed()) + 1
    folder = make_folder(session.start / "out" / name)
    file = write_atomic(session.folder / f"job-{number}" / f"{name}.yaml", text)
    title, command, results = JOBS[kind](file, folder, asked)
    return {"job": session.jobs.start(title, command, results).data()}


def _run(file: Path, folder: Path, asked: Asked) -> tuple[str, list[str], Path]:
    return "Full simulation", ["run", str(file), "-o", str(folder)], folder


def _design(file: Path, folder: Path, asked: Asked) -> tuple[str, list[str], Path]:
    return "Design files and report", ["design", str(file), "-o", str(folder)], folder


def _export(file: Path, folder: Path, asked: Asked) -> tuple[str, list[str], Path]:
    form = fields.choice(
        asked.get("format"), ("stl", "3mf", "obj", "glb", "mjcf", "urdf", "svg", "dxf", "figures"), "format"
    )
    design = folder / "design.json"
    if not design.is_file():
        raise InputError("There is no design.json yet; make the design files first.")
    target = folder / (form if form in FOLDERS else f"{folder.name}.{form}")
    return f"Export as {form}", ["export", str(design), "--format", form, "-o", str(target)], folder


FOLDERS = ("stl", "obj", "3mf", "mjcf", "urdf", "figures")


def _study(file: Path, folder: Path, asked: Asked) -> tuple[str, list[str], Path]:
    key = fields.text(asked.get("key"), "key")
    values = asked.get("values")
    if not isinstance(values, list) or not 1 <= len(values) <= 100:
        raise InputError("A study needs a list of values, at most 100.")
    content = f"base: {yaml_text(file.name)}\nvary: {yaml_text({key: values})}\nstages: [design]\n"
    study = write_atomic(file.parent / f"{file.stem}-study.yaml", content)
    results = make_folder(folder / "study")
    return f"Study of {key}", ["study", str(study), "-o", str(results)], results


def _cancel(session: Session, asked: Asked) -> None:
    session.jobs.cancel(fields.integer(asked.get("job"), "job", 1, 10**6))


JOBS: dict[str, Callable[[Path, Path, Asked], tuple[str, list[str], Path]]] = {
    "run": _run,
    "design": _design,
    "export": _export,
    "study": _study,
}

ANSWERS: dict[str, Callable[[Session, dict[str, Any]], dict[str, Any] | None]] = {
    "open": _open,
    "change": _change,
    "corner": _corner,
    "undo": _undo,
    "redo": _redo,
    "ask": _ask,
    "save": _save,
    "job": _job,
    "cancel": _cancel,
}
"""By the last part of the address."""
