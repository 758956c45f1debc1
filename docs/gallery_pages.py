"""The gallery's pages, from what `python docs/gallery.py` measured: docs/gallery/figures.json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

GALLERY = Path(__file__).resolve().parent / "gallery"
NOTICE = "<!-- Written by docs/generate.py from gallery/figures.json, which docs/gallery.py measures. -->\n"
FEATURES = {
    "equilibrium": "stands under gravity",
    "support_free": "stands after every part that is placed",
    "lateral": "stands on ground that tilts",
    "interlocking": "locks with one key",
}
ABOUT: dict[str, tuple[str, str, str, float]] = {
    "m": ("Letter M", "equilibrium", "Its two arms slide down the slanted shoulders until cone joints hold them.", 1.0),
    "horse": ("Horse", "equilibrium", "Neck and head slide off their slanted seats until cone joints hold them.", 9.82),
    "pavilion": ("Pavilion", "equilibrium", "Rods that meet in small contacts at their ends.", 2.19),
    "lilium_tower": (
        "Lilium tower",
        "equilibrium",
        "A three-lobed shell that closes with an inverted bump, which has to be held up.",
        203.78,
    ),
    "scarecrow": (
        "Scarecrow",
        "equilibrium",
        "Its head pushes the arms off; its cones of ±25° are wide.",
        0.08,
    ),
    "sphere": ("Sphere", "interlocking", "A ball in six pieces: with the key held, no piece can move.", 2.98),
    "stack": ("Stack", "equilibrium", "A cairn on slanted beds; assemblability is not asked for.", 0.04),
    "tree": ("Fir", "equilibrium", "The trunk sheds its branches to either side until cone joints hold them.", 0.37),
    "leaning_tower_10": ("Leaning tower, 10°", "equilibrium", "Running bond on a foot that leans by 10°.", 0.23),
    "leaning_tower_20": ("Leaning tower, 20°", "equilibrium", "Running bond on a foot that leans by 20°.", 0.45),
    "leaning_tower_30": ("Leaning tower, 30°", "equilibrium", "Running bond on a foot that leans by 30°.", 0.38),
    "leaning_tower_support_free": (
        "Leaning tower without supports",
        "support_free",
        "It leans by 12° and stands after every stone that is laid.",
        0.68,
    ),
    "deer": ("Stag", "support_free", "Body, neck and antlers stand after every part that is placed.", 0.70),
    "igloo": ("Igloo", "lateral", "Running bond that stands however the ground tilts, up to 35°.", 61.11),
}
"""Title, feature, one sentence, and minutes that the article reports on 64 cores."""


def pages() -> dict[str, str]:
    """Return the text of every page by its name below docs/."""
    store = GALLERY / "figures.json"
    known = json.loads(store.read_text(encoding="utf-8"))
    found = {f"gallery/{name}.md": page(figures) for name, figures in known.items()}
    return {"gallery/index.md": index(known), **found}


def index(known: dict[str, dict[str, Any]]) -> str:
    """Return the overview: a card for each configuration, and a table of all."""
    lines = [
        "---\nhide: [toc]\n---\n\n# Gallery",
        NOTICE,
        "The fourteen structures of the article, modelled anew, each designed, verified from its written files and let "
        "go in MuJoCo by the commands that you type. Every page has a film and the figures, and most have a report to "
        "play with. "
        "[Comparisons](#comparisons) show the same parts with other joints.",
        "",
        '<div class="grid cards gallery" markdown>',
        "",
    ]
    for name, f in known.items():
        title, feature, words, _ = ABOUT[name]
        lines += [
            f"- [![{title}: input and result]({name}/design.svg)]({name}.md)",
            "",
            f"    **[{title}]({name}.md)** · {f['parts']} parts, {FEATURES[feature]}",
            "",
            f"    {words}",
            "",
        ]
    lines += ["</div>", "", "## All figures", ""]
    lines += [
        "| | parts | contacts | curved | α asked | tightest | E before | critical tilt | design | article |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for name, f in known.items():
        alpha = "–" if f["alpha_deg"] is None else f"{f['alpha_deg']:g}°"
        tilt = "–" if ABOUT[name][1] == "interlocking" else f"{f['tilt_deg']['after']:.1f}°"
        lines.append(
            f"| [{ABOUT[name][0]}]({name}.md) | {f['parts']} | {f['contacts']} | {f['curved']} | {alpha} | "
            f"{f['tightest']['deg']:.1f}° | {f['e_before']:.2g} | {tilt} | {seconds(f['seconds']['total'])} | "
            f"{minutes(ABOUT[name][3])} |"
        )
    lines += [
        "",
        "*Curved*: joints that are not flat; the rest of the contacts stay as they are. *Tightest*: the narrowest cone "
        "of directions along which a part can really go in. *E before*: the share of the load that flat contacts leave "
        "unbalanced; after the design it is 0 everywhere. *Critical tilt*: how far the ground can lean before "
        "something moves, without friction, by statics. *Design*: seconds on a small machine with two cores that did "
        "other work at the same time; *article*: as reported there, on 64 cores.",
        "",
        "## Comparisons",
        "",
    ]
    for name, figure in (("scarecrow", "15"), ("sphere", "16")):
        if name in known:
            lines += [f"**{ABOUT[name][0]}** (Fig. {figure} of the article; [the page]({name}.md#other-joints)).", ""]
            lines += compared(known[name])
    lines += ["`mocca-robot compare` makes such a page for any assembly. `make gallery` runs all of this again.", ""]
    return "\n".join(lines)


def page(f: dict[str, Any]) -> str:
    """Return the page of one configuration."""
    name = f["name"]
    title, feature, words, article = ABOUT[name]
    film = "film.svg" if f["dimension"] == 2 else "film.webp"
    lines = [
        f"# {title}",
        "",
        NOTICE,
        f"{words} Asked for: **{FEATURES[feature]}**"
        + (f", and every part goes in from anywhere within ±{f['alpha_deg']:g}°." if f["alpha_deg"] else "."),
        "",
        f"![{title}, put together part by part{' and let go' if f['dimension'] == 2 else ''}]({name}/{film})"
        "{ .film }",
        "",
    ]
    if f["dimension"] == 2:
        lines += ["How it falls with flat contacts is MuJoCo's run, slowed down.", ""]
    lines += [f"![{title}: input and result]({name}/design.svg)", "", *table(f, article), ""]
    if f["report"]:
        lines += [f"[Open the report]({name}/report.html){{ .md-button }}", ""]
    else:
        lines += ["The report of this one is too large for these pages; `mocca-robot run` writes it.", ""]
    if "compared" in f:
        lines += ["## Other joints", "", "The same parts, joined in other ways:", "", *compared(f)]
        lines += [f"[Open the comparison]({name}/comparison.html){{ .md-button }}", ""]
    lines += ["## Make it", "", "<!-- not run: takes minutes; `make gallery` runs it -->", "```sh"]
    lines += [f"mocca-robot run configs/{name}.yaml"]
    lines += [f"mocca-robot compare configs/{name}.yaml"] if "compared" in f else []
    return "\n".join([*lines, "```", ""])


def table(f: dict[str, Any], article: float) -> list[str]:
    """Return the figures of one configuration as a table."""
    cases = "load case" if f["cases"] == 1 else "load cases"
    after = "< 1e-15" if f["e_after"] < 1e-15 else f"{f['e_after']:.1e}"
    rows = [
        ("parts", f"{f['parts']}, of which {f['fixed']} stand on the ground"),
        ("joints", f"{f['contacts']} contacts, {f['curved']} of them curved"),
        ("equilibrium", f"E {f['e_before']:.2g} before, {after} after ({f['cases']} {cases})"),
        ("insertion", f"tightest is `{f['tightest']['part']}`, ±{f['tightest']['deg']:.1f}°"),
    ]
    physics = f["physics"]
    if f["name"] != "sphere":
        measured = "" if physics["tilt_deg"] is None else f"; MuJoCo {physics['tilt_deg']:.1f}°"
        tilt = f["tilt_deg"]
        rows.append(("critical tilt", f"{tilt['before']:.1f}° before, {tilt['after']:.1f}° after by statics{measured}"))
    inside, outside = physics["inside"], physics["outside"]
    rows.append(
        (
            "MuJoCo",
            f"{physics['agree']} of {physics['states']} states as statics says; {inside[0]} of {inside[1]} "
            f"insertions inside the cones succeed, {outside[0]} of {outside[1]} outside ({physics['engine']})",
        )
    )
    rows.append(("design", f"{seconds(f['seconds']['total'])}; the article's {minutes(article)} on 64 cores"))
    return ["| | |", "|---|---|", *(f"| {key} | {value} |" for key, value in rows)]


def compared(f: dict[str, Any]) -> list[str]:
    """Return the table of other joints for the same parts."""
    lines = ["| joints | statics | MuJoCo | critical tilt | goes in | narrowest cone | deadlocked |"]
    lines += ["|---|---|---|---|---|--:|---|"]
    for v in f["compared"]:
        tilt = "–" if v["tilt_deg"] is None else f"{v['tilt_deg']:.1f}°"
        way = "as asked" if v["as_asked"] else "one way only" if v["goes_in"] else "**no**"
        narrow = "none" if v["narrowest_deg"] < -1e-6 else f"±{abs(v['narrowest_deg']):.1f}°"
        stands = ["**falls**" if not v[k] else "stands" for k in ("stands", "physics_stands")]
        locked = "**yes**" if v["deadlocked"] else "no"
        lines.append(f"| {v['name']} | {stands[0]} | {stands[1]} | {tilt} | {way} | {narrow} | {locked} |")
    return [*lines, ""]


def seconds(value: float) -> str:
    """Return seconds with two digits, whole ones from ten on."""
    return f"{value:.0f} s" if value >= 10 else f"{value:.2g} s"


def minutes(value: float) -> str:
    """Return minutes, in seconds where they are few."""
    return f"{value * 60:.0f} s" if value < 1 else f"{value:.0f} min"
