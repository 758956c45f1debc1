"""PDF pages and PNG pictures through typst, which draws SVG and needs nothing of the system."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from mocca_robot.errors import EnvironmentNeeded
from mocca_robot.files.output import write_atomic

INSTALL = "needs typst: `pip install mocca-robot[manual]`."
WIDTH_PX = 1200.0


def write_png(svg: str, path: Path) -> Path:
    """Return `path` after drawing a stand-alone SVG there, about `WIDTH_PX` pixels wide, on white.

    Raises EnvironmentNeeded when typst is not installed.
    """
    source = '#set page(width: auto, height: auto, margin: 0pt)\n#image("picture.svg", width: 300pt)\n'
    return _write(source, {"picture.svg": svg}, {}, path, "png", "A PNG picture", WIDTH_PX / 300.0 * 72.0)


def write_pdf(template: str, data: Mapping[str, Any], pictures: Mapping[str, str], path: Path) -> Path:
    """Return `path` after setting a template of this package with `data` (plain values) and `pictures` (name → SVG).

    Raises EnvironmentNeeded when typst is not installed.
    """
    source = (resources.files("mocca_robot.report") / "assets" / template).read_text(encoding="utf-8")
    return _write(source, pictures, {"data": json.dumps(data, ensure_ascii=False)}, path, "pdf", "A PDF")


def _write(
    source: str,
    pictures: Mapping[str, str],
    inputs: dict[str, str],
    path: Path,
    kind: Literal["pdf", "png"],
    what: str,
    ppi: float = 144.0,
) -> Path:
    try:
        import typst
    except ImportError:
        raise EnvironmentNeeded(f"{what} {INSTALL}") from None
    with tempfile.TemporaryDirectory() as folder:
        for name, svg in pictures.items():
            Path(folder, name).write_text(svg, encoding="utf-8")
        page = Path(folder, "page.typ")
        page.write_text(source, encoding="utf-8")
        return write_atomic(path, typst.compile(str(page), format=kind, ppi=ppi, sys_inputs=inputs))
