"""Cutting drawings of flat parts at real scale: SVG and DXF, cuts and engraved names on layers of their own."""

from __future__ import annotations

import io
from html import escape
from pathlib import Path

from mocca_robot.assembly import Assembly
from mocca_robot.fabrication.options import CutOptions
from mocca_robot.fabrication.sheet import Sheet, nested
from mocca_robot.files.output import write_atomic

CUT_COLOUR, ENGRAVE_COLOUR = "#ff0000", "#0000ff"
"""Red cuts, blue engraves: what most laser cutters' drivers expect."""


def write_cut_svg(assembly: Assembly, path: str | Path, options: CutOptions | None = None) -> Path:
    """Return `path` after writing every part of a flat assembly there, nested on a sheet, 1 unit = 1 mm.

    Each part is one path whose id is its name, so `read_svg` reads the drawing back. Raises InputError for
    solids and for parts that do not fit, EnvironmentNeeded when the file cannot be written.
    """
    options = options or CutOptions()
    return write_atomic(Path(path), svg_text(nested(assembly, options), options.labels))


def write_cut_dxf(assembly: Assembly, path: str | Path, options: CutOptions | None = None) -> Path:
    """Return `path` after writing the same sheet as DXF in millimetres, on the layers CUT and ENGRAVE."""
    options = options or CutOptions()
    return write_atomic(Path(path), dxf_text(nested(assembly, options), options.labels))


def svg_text(sheet: Sheet, labels: bool) -> str:
    """Return the sheet as an SVG document."""
    cuts, names = [], []
    for part in sheet.parts:
        rings = ["M " + " L ".join(f"{x:.6f} {sheet.height - y:.6f}" for x, y in ring) + " Z" for ring in part.rings]
        cuts.append(f'    <path id="{_attribute(part.name)}" d="{" ".join(rings)}"/>')
        x, y = part.label_at[0], sheet.height - part.label_at[1]
        names.append(
            f'    <text x="{x:.4f}" y="{y + 0.36 * part.label_height:.4f}" font-size="{part.label_height:.4f}">'
            f"{escape(part.name, quote=False)}</text>"
        )
    size = (
        f'width="{sheet.width:.6f}mm" height="{sheet.height:.6f}mm" viewBox="0 0 {sheet.width:.6f} {sheet.height:.6f}"'
    )
    engraving = [
        f'  <g class="ENGRAVE" fill="{ENGRAVE_COLOUR}" font-family="sans-serif" text-anchor="middle">',
        *names,
        "  </g>",
    ]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
        f'  <g class="CUT" fill="none" stroke="{CUT_COLOUR}" stroke-width="0.1">',
        *cuts,
        "  </g>",
        *(engraving if labels else []),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _attribute(text: str) -> str:
    return escape(text).translate({ord(space): f"&#{ord(space)};" for space in "\t\n\r"})


def dxf_text(sheet: Sheet, labels: bool) -> str:
    """Return the sheet as a DXF document (R2010, millimetres)."""
    import ezdxf

    # The same sheet has to give the same file: no dates, no random identifiers.
    dated, ezdxf.options.write_fixed_meta_data_for_testing = ezdxf.options.write_fixed_meta_data_for_testing, True
    try:
        return _dxf_text(sheet, labels)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = dated


def _dxf_text(sheet: Sheet, labels: bool) -> str:
    import ezdxf
    from ezdxf.enums import TextEntityAlignment

    document = ezdxf.new("R2010", units=ezdxf.units.MM)
    document.layers.add("CUT", color=1)
    document.layers.add("ENGRAVE", color=5)
    space = document.modelspace()
    for part in sheet.parts:
        for ring in part.rings:
            space.add_lwpolyline(ring.tolist(), close=True, dxfattribs={"layer": "CUT"})
        if labels:
            text = space.add_text(part.name, height=part.label_height, dxfattribs={"layer": "ENGRAVE"})
            text.set_placement(tuple(part.label_at.tolist()), align=TextEntityAlignment.MIDDLE_CENTER)
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()
