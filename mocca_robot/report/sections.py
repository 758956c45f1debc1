"""The report's sections from pictures to provenance; each returns markup, or nothing when it has nothing to say."""

from __future__ import annotations

from mocca_robot.report import pictures
from mocca_robot.report.builder_words import kilograms, way_words
from mocca_robot.report.case_words import case_words
from mocca_robot.report.data import ReportData
from mocca_robot.report.findings import decided
from mocca_robot.report.graph_drawing import graph_svg
from mocca_robot.report.markup import badge, degrees, esc, listed, significant, table
from mocca_robot.report.palette import fills, part_colours
from mocca_robot.report.pictures import Picture
from mocca_robot.statics.cases import CaseVerdict

VANISHING = 1e-15
"""E/|w|² below this is rounding, whatever its digits say."""

LAYERS = (("names", "names"), ("joints", "joints"), ("forces", "contact forces"), ("collapse", "collapse motion"))


APART = 0.6
"""How far the parts of a solid are moved from each other in the third picture, as a share of their distance."""


LEGEND = (
    "Orange arrows: loads, each ending where it acts, with its name and size; those on the ground press on nothing."
)


def section(identity: str, title: str, body: str) -> str:
    """Return a titled section that the navigation can point to."""
    return f'<section id="{identity}"><h2>{esc(title)}</h2>{body}</section>'


def side_by_side(data: ReportData) -> str:
    """Return input and result at one scale, and a third panel: the motion cones in 2D, the parts apart in 3D."""
    source, built = data.design.source, data.design.assembly
    flat = built.dimension == 2
    colours = part_colours(data.after.graph)
    view = pictures.shared_view([source, built])
    before = Picture(graph=data.before.graph, colours=colours, cases=data.before.cases)
    joints = data.design.joints if flat else ()
    after = Picture(graph=data.after.graph, colours=colours, cases=data.after.cases, joints=joints)
    panels = [
        _panel(pictures.draw(before, view, f"{source.name} as handed in"), "Input", data.before.cases, flat),
        _panel(pictures.draw(after, view, f"{built.name} with joints"), "Result", data.after.cases, flat),
    ]
    if flat and data.design.insertion:
        cones = Picture(graph=data.after.graph, colours=colours, insertions=data.design.insertion, names=False)
        words = (
            "<b>Ways in.</b> Pale wedge: every direction in which the part could leave what was placed before it "
            "(its motion cone). Blue wedge: the cone asked for. Arrow: how the part goes in."
        )
        drawn = pictures.draw(cones, view, f"Motion cones of {built.name}")
        panels.append(f"<figure>{drawn}<figcaption>{words}</figcaption></figure>")
    if not flat:
        wide = pictures.shared_view([built], apart=APART)
        opened = Picture(graph=data.after.graph, colours=colours, joints=data.design.joints, apart=APART)
        words = (
            f"<b>Taken apart.</b> Every part moved away from the middle, by {APART:.0%} of its distance. "
            "Yellow: the curved joints."
        )
        drawn = pictures.draw(opened, wide, f"{built.name}, taken apart")
        panels.append(f"<figure>{drawn}<figcaption>{words}</figcaption></figure>")
    loads = f"<p>{LEGEND}</p>" if source.actions else ""
    body = f'{_controls(data)}<div class="figures">{"".join(panels)}</div>{loads}'
    return section("pictures", "Input and result", body)


def _controls(data: ReportData) -> str:
    names = dict.fromkeys(c.case.name for c in (*data.after.cases, *data.before.cases))
    options = "".join(f'<option value="{esc(n)}">{esc(case_words(n))}</option>' for n in names)
    picker = f'<label>load case <select id="case">{options}</select></label>' if len(names) > 1 else ""
    shown = LAYERS if data.design.assembly.dimension == 2 else LAYERS[-1:]
    boxes = "".join(
        f'<label><input type="checkbox" class="toggle" data-layer="{key}" checked="checked"/>{words}</label>'
        for key, words in shown
    )
    return f'<div class="controls needs-script">{picker}{boxes}</div>'


def _panel(drawing: str, title: str, cases: tuple[CaseVerdict, ...], flat: bool) -> str:
    said = []
    for number, verdict in enumerate(cases):
        hidden = "" if number == 0 else ' style="display:none"'
        if verdict.result.stands:
            words = "Arrows: contact forces on the later part of each pair, length ∝ √force." if flat else ""
        else:
            words = f"Dashed: how it would start to move. Moving: {listed(verdict.moving, 6)}."
        name = f"{case_mark(verdict)} {esc(case_words(verdict.case.name))}"
        said.append(f'<span data-case="{esc(verdict.case.name)}"{hidden}>{name}. {words}</span>')
    return f"<figure>{drawing}<figcaption><b>{esc(title)}.</b> {''.join(said)}</figcaption></figure>"


def case_mark(verdict: CaseVerdict) -> str:
    """Return the badge of a load case's verdict."""
    stands = decided(verdict)
    if stands is None:
        return badge("warn", "inaccurate")
    if verdict.case.gravity is None:
        return badge("ok", "holds") if stands else badge("bad", "comes apart")
    if verdict.only_clamped:
        return badge("bad", "stands only clamped")
    return badge("ok", "stands") if stands else badge("bad", "falls")


def load_cases(data: ReportData) -> str:
    """Return every load case with E before and after, its verdicts, and who moves."""
    before = {c.case.name: c for c in data.before.cases}
    after = {c.case.name: c for c in data.after.cases}
    claimed = {c.name: c for c in data.design.load_cases}
    rows = []
    for name in dict.fromkeys([*after, *before, *claimed]):
        row = [esc(case_words(name))]
        for side, claim in ((before, "infeasibility_before"), (after, "infeasibility_after")):
            verdict = side.get(name)
            if verdict is not None:
                row += [_infeasibility(verdict.result.infeasibility), case_mark(verdict)]
            elif name in claimed:
                row += [
                    f"{significant(getattr(claimed[name], claim), 3)} (as designed)",
                    badge("none", "not re-checked"),
                ]
            else:
                row += ["–", badge("none", "–")]
        moving = after[name].moving if name in after else ()
        first = before[name].moving if name in before else ()
        who = f"result: {listed(moving)}" if moving else (f"input: {listed(first)}" if first else "nothing")
        rows.append([*row, who])
    head = ("Load case", "E before", "Input", "E after", "Result", "Who moves")
    words = (
        "<p>E is the part of the load that contact forces cannot balance, squared, relative to the load: 0 is "
        "equilibrium, ½ means that nothing is held. Both sides are computed from geometry alone.</p>"
    )
    return section("cases", "Load cases", words + table(head, rows, caption="Equilibrium by statics", numeric=(1, 3)))


def _infeasibility(value: float) -> str:
    return "&lt; 10⁻¹⁵" if 0.0 < value < VANISHING else significant(value, 3)


def parts_graph(data: ReportData) -> str:
    """Return the parts-graph in sequence order: who was placed before whom, and which joint is between them."""
    words = (
        "<p>Parts in the order in which they are placed. An arc leads from a part to a neighbour placed before it; "
        "its colour says which kind of joint is between them.</p>"
    )
    return section("graph", "Parts-graph", f'{words}<div class="graph">{graph_svg(data.graph)}</div>')


def parts(data: ReportData) -> str:
    """Return the parts' table: mass, centroid, way in and cone."""
    assembly = data.design.assembly
    colours, classes = part_colours(data.after.graph), fills()
    ways = {i.part: i for i in data.design.insertion}
    free = {i.part: i for i in data.after.insertions}
    rows = []
    for k, part in enumerate(assembly.parts):
        way, cone = ways.get(part.name), free.get(part.name)
        rows.append(
            [
                str(k + 1),
                f'<span class="swatch {classes[colours[k]]}"></span><code>{esc(part.name)}</code>',
                "fixed" if part.fixed else "free",
                kilograms(part.mass),
                ", ".join(significant(float(c) * 1e3, 4) for c in part.centroid),
                esc(way_words(way.direction)) if way else "–",
                f"±{degrees(cone.alpha_rad)}" if cone else "–",
            ]
        )
    head = ("", "Part", "Kind", "Mass", "Centroid (mm)", "Goes in along", "Free cone")
    return section("parts", "Parts in order of assembly", table(head, rows, caption="Parts", numeric=(0, 3, 4)))


def provenance(data: ReportData) -> str:
    """Return parameters, timings, versions, notes and warnings."""
    seconds = dict(data.design.seconds)
    versions = dict(data.versions)
    notes = [*data.warnings, *data.design.notes]
    if data.simulation is not None:
        seconds["simulation"] = float(data.simulation.seconds.get("total", 0.0))
        versions["simulated by"] = data.simulation.engine
        notes += data.simulation.notes
        if data.simulation.interrupted:
            notes.insert(0, "The simulation was interrupted; it holds what was finished by then.")
    body = ""
    if notes:
        body += f'<h3>Notes</h3><ul class="notes">{"".join(f"<li>{esc(n)}</li>" for n in notes)}</ul>'
    overlap = f"Largest overlap of two parts: {significant(data.after.part_overlap, 2)} of the smaller one."
    body += f"<p>{overlap} Contacts found in the result: {len(data.after.contacts)} facets.</p>"
    tables = (
        ("Parameters", ("Parameter", "Value"), {k: str(v) for k, v in data.parameters.items()}),
        ("Timings", ("Stage", "Seconds"), {k: significant(float(v), 3) for k, v in seconds.items()}),
        ("Versions", ("Program", "Version"), versions),
    )
    for caption, head, values in tables:
        if values:
            rows = [[esc(k), esc(v)] for k, v in values.items()]
            body += table(head, rows, caption=caption)
    return section("about", "How this was made", body)
