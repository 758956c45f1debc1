"""What a script or a notebook holds, looked at: a fragment for a notebook, a page in the browser, a picture in a file.

A fragment is complete in itself and asks the network for nothing; it follows the light or dark theme of the notebook.
"""

from __future__ import annotations

import re
import sys
import tempfile
import webbrowser
from functools import cache
from pathlib import Path

from mocca_robot.design import Design
from mocca_robot.errors import InputError
from mocca_robot.files.output import write_atomic
from mocca_robot.report import figures
from mocca_robot.report.data import collect
from mocca_robot.report.display_contents import contents, drawing, title
from mocca_robot.report.markup import asset, esc
from mocca_robot.report.page import POLICY, report_page
from mocca_robot.report.pictures import PAGE_DEFS

NOTEBOOK_TYPES = (
    ("mocca_robot.assembly", "Assembly"),
    ("mocca_robot.design", "Design"),
    ("mocca_robot.files.design_json", "StoredDesign"),
    ("mocca_robot.motion.parts_graph", "PartsGraph"),
    ("mocca_robot.statics.cases", "CaseVerdict"),
    ("mocca_robot.strength.uses", "AssemblyStrength"),
    ("mocca_robot.verdicts.physics", "Simulation"),
    ("mocca_robot.verdicts.verification", "Verification"),
    ("planners.cone_joints.outcome", "Designed"),
)
"""What notebooks show, by module and name: nothing is imported for it."""

LIGHT_PAGES = '[data-jp-theme-light="true"],[data-md-color-scheme="default"],.vscode-light'
DARK_PAGES = '[data-jp-theme-light="false"],[data-md-color-scheme="slate"],.vscode-dark'
"""Notebooks and documentation that say their theme themselves: JupyterLab, MkDocs Material, VS Code."""


def markup(what: object) -> str:
    """Return `what` as a fragment of HTML: picture, verdict, table. Raises InputError for what cannot be shown."""
    return f'<div class="mocca-robot"><style>{_style()}</style>{PAGE_DEFS}{contents(what)}</div>'


def show(what: object) -> Path | None:
    """Return the page that was opened in the browser: a design's report, or picture, verdict and table of others.

    In a notebook it is shown in place, and None comes back. The page lies in a temporary folder: `write_report` keeps
    one. Raises InputError for what cannot be shown.
    """
    shell = sys.modules.get("IPython")
    if shell is not None and hasattr(shell.get_ipython(), "kernel"):
        shell.display.publish_display_data({"text/html": markup(what), "text/plain": repr(what)})
        return None
    path = write_report(what, Path(tempfile.mkdtemp(prefix="mocca-robot-")) / "page.html")
    webbrowser.open(path.as_uri())
    return path


def write_report(what: object, path: str | Path) -> Path:
    """Return `path` after writing one self-contained HTML page there: of a design the report, with what statics says.

    Of everything else that can be shown it is picture, verdict and table. Raises InputError for what cannot be shown
    and for endings other than .html.
    """
    target = Path(path).resolve()
    if target.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"'{path}' ends in '{target.suffix}'; a report is an .html.")
    design = what if isinstance(what, Design) else getattr(what, "design", None)
    if isinstance(design, Design):
        return write_atomic(target, report_page(collect(design, friction=design.judged_friction)))
    fragment = markup(what)
    head = (
        f'<meta charset="utf-8"/><meta http-equiv="Content-Security-Policy" content="{POLICY}"/>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{esc(title(what))}</title><style>:root{{color-scheme:light dark}}</style>"
    )
    return write_atomic(target, f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>{fragment}</body></html>\n')


def plot(what: object, path: str | Path) -> Path:
    """Return `path` after drawing `what` there, .svg or .png (needs `mocca-robot[manual]`).

    Parts with joints; a verification with contact forces where it stands and the collapse motion where not. Raises
    InputError for what has no picture and for other endings.
    """
    drawn = drawing(what)
    if drawn is None:
        raise InputError(f"A value of type {type(what).__name__} has no picture; plot its assembly, design or graph.")
    return figures.write_picture(figures.stand_alone(drawn), path)


@cache
def _style() -> str:
    """Return the style of drawings and tables, for the fragment alone, in the theme of the page around it."""
    roots = re.findall(r":root\{([^}]*)\}", asset("style.css"))
    light, dark = (re.sub("color-scheme:[^;]*;", "", r) for r in roots[:2])
    themed = [
        f".mocca-robot{{{light}}}@media (prefers-color-scheme:dark){{.mocca-robot{{{dark}}}}}",
        f":is({LIGHT_PAGES}) .mocca-robot{{{light}}}:is({DARK_PAGES}) .mocca-robot{{{dark}}}",
    ]
    rules = asset("drawing.css") + asset("display.css")
    return "".join(themed) + re.sub(r"([^{}]+)\{([^}]*)\}", _inside, rules)


def _inside(rule: re.Match[str]) -> str:
    selectors = ",".join(f".mocca-robot {s.strip()}" for s in rule[1].split(","))
    return f"{selectors}{{{rule[2]}}}"
