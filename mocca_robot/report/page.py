"""report.html: one file that opens anywhere, asks the network for nothing and prints."""

from __future__ import annotations

from pathlib import Path

from mocca_robot.files.output import write_atomic
from mocca_robot.report import joints_section, physics_sections, player, reserves, sections
from mocca_robot.report.data import ReportData
from mocca_robot.report.markup import asset, esc
from mocca_robot.report.pictures import PAGE_DEFS
from mocca_robot.report.strength import MILLIMETRES, strength_section
from mocca_robot.report.summary import summary

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
CHAPTERS = (
    ("pictures", "Input and result"),
    ("cases", "Load cases"),
    ("reserves", "How much it takes"),
    ("strength", "Strength"),
    ("sequence", "Assembly"),
    ("tilt", "Tilt"),
    ("insertion", "Insertion"),
    ("joints", "Joints"),
    ("graph", "Parts-graph"),
    ("parts", "Parts"),
    ("about", "How this was made"),
)


def write_report(path: Path, data: ReportData) -> Path:
    """Return `path` after writing the report there; folders are made, an older report is replaced whole."""
    return write_atomic(Path(path), report_page(data))


def report_page(data: ReportData) -> str:
    """Return the report as one HTML document, well-formed as XML, too. Same data, same text."""
    body = "\n".join(
        (
            sections.side_by_side(data),
            sections.load_cases(data),
            reserves.reserves(data),
            "" if data.strength is None else strength_section(data.design.assembly, data.strength, *MILLIMETRES),
            player.sequence(data),
            physics_sections.tilt(data),
            physics_sections.insertion(data),
            joints_section.joints(data),
            sections.parts_graph(data),
            sections.parts(data),
            sections.provenance(data),
        )
    )
    links = "".join(f'<a href="#{key}">{words}</a>' for key, words in CHAPTERS if f'id="{key}"' in body)
    scripts = ["page.js"] + (["viewer3d.js"] if data.design.assembly.dimension == 3 else [])
    header = f'<header class="top">{summary(data)}<nav aria-label="Sections">{links}</nav></header>'
    return document(data.design.assembly.name, header, body, scripts)


def document(title: str, header: str, body: str, scripts: list[str]) -> str:
    """Return a page around `header` and `body` (markup) with the package's style and `scripts` inside."""
    code = "".join(f"<script>//<![CDATA[\n{asset(name)}\n//]]></script>" for name in scripts)
    return (
        '<!DOCTYPE html>\n<html lang="en" xmlns="http://www.w3.org/1999/xhtml"><head><meta charset="utf-8"/>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}"/>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{esc(title)}</title><style>{asset('style.css')}{asset('drawing.css')}</style>"
        f"<noscript><style>.needs-script{{display:none}}</style></noscript></head>\n<body>{PAGE_DEFS}\n{header}\n"
        f"<main>\n{body}\n</main>\n<footer>Made by mocca-robot. This file is complete in itself: it asks the network "
        f"for nothing.</footer>\n{code}</body></html>\n"
    )
