"""What share of their strength parts and joints use: in words, and as a section of the report."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.report import drawing3d, raster
from mocca_robot.report.case_words import case_words
from mocca_robot.report.drawing2d import View, path_of
from mocca_robot.report.markup import badge, esc, px, significant, table
from mocca_robot.report.pictures import shared_view
from mocca_robot.report.sections import section
from mocca_robot.strength.uses import AssemblyStrength, PartStrength, Use

SCALE = ((0.0, (226, 232, 240)), (0.5, (253, 224, 113)), (1.0, (220, 38, 38)), (2.0, (88, 12, 24)))
"""Share of what is allowed → colour: grey, yellow at half, red where the asked safety is used up, dark beyond."""
MILLIMETRES = ("mm", 1e-3)
"""The unit of places in reports, and how many metres it has."""
GROUND = "#c3c9d1"
ROWS = 40


def factor(value: float) -> str:
    """Return a safety factor in words."""
    return "any" if not np.isfinite(value) else significant(value, 3)


def use_words(use: Use, unit: str, unit_m: float) -> str:
    """Return where which strength is used, as a sentence's end (not escaped)."""
    place = ", ".join(f"{x / unit_m:.4g}" for x in use.place)
    return (
        f"{use.kind} {significant(use.stress / 1e6)} of {significant(use.strength / 1e6)} MPa at ({place}) {unit}, "
        f"{case_words(use.case)}"
    )


def strength_words(found: AssemblyStrength, unit: str, unit_m: float) -> str:
    """Return the verdict in a line (not escaped)."""
    weakest = found.weakest
    if weakest is None or weakest.worst is None:
        return "nothing acts on any part"
    verdict = "holds" if found.holds else "does not hold"
    by = "finite elements" if weakest.method == "elements" else "fast estimate"
    return (
        f"{verdict}: bears {factor(found.reached)} times its loads, {found.safety:g} asked ({by}); "
        f"weakest is '{weakest.part}' of {weakest.material}: {use_words(weakest.worst, unit, unit_m)}"
    )


def broken_words(part: PartStrength, safety: float, unit: str, unit_m: float) -> str:
    """Return which part bears too little, under which load, and by how much (not escaped)."""
    assert part.worst is not None
    return (
        f"'{part.part}' bears {factor(part.reached)} times its loads, not {safety:g}: "
        f"{use_words(part.worst, unit, unit_m)}."
    )


def colour(share: float) -> str:
    """Return the colour of a share of what is allowed, as #rrggbb."""
    at = [s for s, _ in SCALE]
    channels = [float(np.interp(share, at, [c[k] for _, c in SCALE])) for k in range(3)]
    return "#" + "".join(f"{round(c):02x}" for c in channels)


def picture(assembly: Assembly, found: AssemblyStrength, size_px: float = 640.0) -> str:
    """Return the parts coloured by the share that they use of what the asked safety allows, the worst place marked."""
    used = {p.part: found.safety / p.reached for p in found.parts}
    view = shared_view([assembly], size_px)
    fills = [GROUND if p.fixed else colour(used.get(p.name, 0.0)) for p in assembly.parts]
    layers = [_flat(assembly, fills, found, view) if assembly.dimension == 2 else _solid(assembly, fills, view)]
    weakest = found.weakest
    if weakest is not None and weakest.worst is not None:
        place = weakest.worst.place
        flat = place if assembly.dimension == 2 else place @ drawing3d.camera()[:2].T
        x, y = view(flat)[0]
        layers.append(f'<circle class="asked" style="stroke:#111" cx="{px(x)}" cy="{px(y)}" r="9"/>')
    return view.svg("\n".join(layers), f"{assembly.name}: how much of their strength parts use", "drawing")


def _flat(assembly: Assembly, fills: list[str], found: AssemblyStrength, view: View) -> str:
    drawn = []
    for part, fill in zip(assembly.parts, fills):
        assert isinstance(part.shape, Polygon)
        title = f"<title>{esc(part.name)}</title>"
        drawn.append(f'<path class="part" style="fill:{fill}" d="{path_of(part.shape, view)}">{title}</path>')
        shade = found.shades.get(part.name)
        if shade is not None:
            drawn.append(_shaded(shade, found.safety, view))
    return "\n".join(drawn)


def _shaded(shade: Array, safety: float, view: View) -> str:
    """Return small discs over a part, coloured by the share that is used there."""
    pixels = view(shade[:, :2])
    radius = px(max(1.2, 0.5 * float(np.sqrt(np.ptp(pixels, axis=0).prod() / len(pixels)))))
    return "".join(
        f'<circle cx="{px(x)}" cy="{px(y)}" r="{radius}" fill="{colour(safety * share)}"/>'
        for (x, y), share in zip(pixels, shade[:, 2])
    )


def _solid(assembly: Assembly, fills: list[str], view: View) -> str:
    scale = drawing3d.DENSITY * drawing3d.FINER
    meshes = drawing3d.exploded(assembly, 0.0)
    width, height = round(view.width * scale), round(view.height * scale)
    seen = raster.look(meshes, drawing3d.camera(), view.scale * scale, view.low, width, height)
    pixels = raster.painted(seen, fills, [p.fixed for p in assembly.parts], drawing3d.FINER)
    size = f'width="{px(pixels.shape[1] / drawing3d.DENSITY)}" height="{px(pixels.shape[0] / drawing3d.DENSITY)}"'
    return f'<image class="solids" x="0" y="0" {size} href="{raster.data_uri(pixels)}"/>'


def legend() -> str:
    """Return what the colours say."""
    marks = (0.0, 0.25, 0.5, 0.75, 1.0, 2.0)
    boxes = "".join(
        f'<span style="display:inline-block;width:1em;height:1em;background:{colour(m)};vertical-align:-.15em"></span> '
        f"{m:.0%}&#160; "
        for m in marks
    )
    return f'<p class="mute">Used of what the asked safety allows: {boxes}</p>'


def strength_section(assembly: Assembly, found: AssemblyStrength, unit: str, unit_m: float) -> str:
    """Return the section about strength: the verdict, the picture, a row per part, the worst joints."""
    ordered = sorted(found.parts, key=lambda p: p.reached)
    rows = []
    for part in ordered[:ROWS]:
        worst = part.worst
        neck = "–" if part.neck is None else f"{significant(part.neck[0] / unit_m)} {esc(unit)}"
        mark = badge("ok" if part.reached >= found.safety else "bad", factor(part.reached))
        by = part.method if not part.why else f"{part.method} ({part.why})"
        words = "nothing acts" if worst is None else use_words(worst, unit, unit_m)
        rows.append([f"<code>{esc(part.part)}</code>", esc(part.material), mark, esc(words), neck, esc(by)])
    head = ("Part", "Material", "Bears its loads", "Where it is used most", "Thinnest neck", "Found by")
    body = f"<p>{esc(strength_words(found, unit, unit_m))}.</p>"
    if found.largest_scale is not None:
        body += f"<p>It may be built up to {factor(found.largest_scale)} times as large in these materials.</p>"
    body += f'<div class="figures"><figure>{picture(assembly, found)}</figure></div>{legend()}'
    body += table(head, rows, caption=f"Strength of parts, the weakest first ({len(found.cases)} load cases)")
    joints = sorted(found.joints, key=lambda j: -j.use.share)[:10]
    if joints:
        cells = [[esc(" – ".join(j.parts)), f"{j.use.share:.2%}", esc(use_words(j.use, unit, unit_m))] for j in joints]
        body += table(("Joint", "Used", "Where"), cells, caption="Bearing in joints, the most used first", numeric=(1,))
    if found.left_out:
        names = ", ".join(case_words(n) for n in found.left_out[:6]) + (", …" if len(found.left_out) > 6 else "")
        body += f"<p>Not looked at, since not in equilibrium: {esc(names)}.</p>"
    if found.notes:
        body += f'<ul class="notes">{"".join(f"<li>{esc(n)}.</li>" for n in found.notes[:8])}</ul>'
    return section("strength", "Strength", body)
