"""docs/benchmarks.md from the rows that were kept: tables, ratios and figures, with date, machine and versions."""

from __future__ import annotations

import math
import re
import statistics
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from benchmarks.design_baseline import PAPER_MINUTES
from benchmarks.measurement import Measurement
from benchmarks.store import FOLDER, Run, path_of, read
from mocca_robot.report.charts import Axis, Series, chart, fitted_exponent
from mocca_robot.report.figures import stand_alone

DOCS = Path(__file__).parents[1] / "docs"
FIGURES = "figures/bench"
INTRODUCTION = """<!-- Written by `python -m benchmarks page` from what `make bench` kept; edit benchmarks/page.py. -->
# Benchmarks

Every number here was measured by the project's benchmarks on the machine that its chapter names; rows of a chapter
may come from runs at different times, with whatever else the machine had to do. Yours will differ: `make bench`
writes this page for your computer. Seconds are the median of a process's CPU time unless a line says otherwise: that
is disturbed less than the clock by what ran beside. `kkt` is the relative residual of the optimality conditions,
computed in the same way for every solver. Time limits are by the clock. Each chapter names the load at its end: where
that is above the number of cores, others used the machine as well, and all times are longer than they would be on a
quiet one. Cases that have not been measured are missing, chapters without any are named at the end.
[Performance](performance.md) says how to run one of them.
"""
CONFIGS_TEXT = """The article's times are those of its Table 1 (Knitro, 64 cores, wall clock); ours are CPU seconds
of all threads together, for the design alone: contacts are found before."""
TOOLS_TEXT = """Milliseconds; in brackets the kkt residual where it is above 1e-8, or what went wrong. The last
column is the fastest *other* tool with a residual up to 1e-6, over the best of ours."""
BASELINE_TEXT = """Leaning walls without α, as in Fig. 17. *direct, differences* is direct search over all joint
parameters with finite differences, as in the article; *direct search* has our gradient and our statics. ✗: the
result does not hold, or the time limit came first."""
CONTACTS_TEXT = """Walls of boxes in running bond, whose contacts can be counted by hand, and domes. Rows that end in
*contacts* are detection alone; the others add the verdict under gravity with friction 0.6. COMPAS gets at most 10
neighbours per block and tolerances of 1 cm: narrower ones make it find fewer."""
PHYSICS_TEXT = """MuJoCo releases Python's lock, so steps scale over threads as far as there are cores; every step of an
insertion is looked at by Python, so insertions run in processes. Rates are by the clock."""
GROWTH_TEXT = """*flat wall*: a leaning wall as high as wide, without α. *long wall*: solid bricks in five courses
that lean by 10°, α 5°. *dome*: running bond, α 2°. *load cases*: a dome of 50 parts that has to stand tilted by 5°
towards more and more sides. Each with the default reserve of 1°, contacts included; CPU seconds are of all threads
together. Memory starts at about 100 MB for Python and its libraries, which flattens its exponent."""
PROFILE_TEXT = """Own time of each room of the programme, time in libraries counted for the room that calls them:
contacts, design and verification of three configurations on one thread, under a profiler (which slows small
functions down)."""
SAMPLES_TEXT = """The published samples of compas_cra 0.8, each with the friction, supports and tolerances of its
script, turned as there. Ours decides on the contacts that compas_cra finds; times are CPU seconds of the verdict alone.
*no answer*: its solver ends without a solution, which its users read as unstable. Verdicts that contradict what closed
forms or the friction engine say are marked WRONG."""
AGREEMENT_TEXT = """Assemblies judged by statics and by physics (MuJoCo without friction, the friction engine with
it) just below and just above their critical tilt. *near*: too close to falling upright to tell. Of them all:"""

LOADS_TEXT = """How many times one load, of a random kind, place and direction, stands beside gravity: by statics, and
in MuJoCo, without friction. They agree where they are less than 2 % apart; where statics says that any amount stands,
MuJoCo has to hold ten times the structure's own weight. *near*: the load meets nothing that can move. Of the random
assemblies and configurations that were measured:"""

INSERTIONS_TEXT = """Every part driven home by a compliant hand along directions that cover its cone: with an exact grip
at three clearances, with the grip off by 0.5 mm or 1°, and with the earlier parts left free. *Allowed* is 5 % of the
part's weight plus the hand's stiffness times its error. Outside means 3° outside the realised motion cone: nothing may
pass. Seconds are by the clock."""

PLANS_TEXT = """Every part of a design planned for a UR arm: grasp, transit, insertion, retreat, on one core. What is
out of reach is named."""
BUILDS_TEXT = """Designed, planned, rehearsed in MuJoCo with arm, hand and parts, and executed through the real
`ur-rtde` client on the fake controller in another process, which runs four times as fast as a robot would. Seconds are
by the clock."""


def write_page(docs: Path = DOCS, folder: Path = FOLDER) -> Path:
    """Return docs/benchmarks.md after writing it and its figures.

    Chapters of benchmarks without rows here stay as they were, measured elsewhere or earlier; those that the page never
    had are named at its end.
    """
    path = docs / "benchmarks.md"
    before = chapters_of(path.read_text(encoding="utf-8")) if path.exists() else {}
    chapters, missing = [], []
    for bench, (title, text) in CHAPTERS.items():
        run = read(path_of(bench, False, folder))
        if run is not None and run.rows:
            chapters.append(f"## {title}\n\n{_about(run)}\n\n{text(run, docs)}")
        elif title in before:
            chapters.append(f"## {title}\n\n{before[title]}")
        else:
            missing.append((title, f"`python -m benchmarks {bench} --keep`"))
    if missing:
        chapters.append(f"## Not measured for this page\n\n{_table(('chapter', 'what measures it'), missing)}")
    page = INTRODUCTION + "\n" + "\n\n".join(chapters) + "\n"
    path.write_text(page, encoding="utf-8")
    return path


def chapters_of(page: str) -> dict[str, str]:
    """Return the text of every chapter of a page by its title."""
    parts = re.split(r"^## (.*)$", page, flags=re.MULTILINE)
    return {title: text.strip() for title, text in zip(parts[1::2], parts[2::2])}


def _about(run: Run) -> str:
    about = run.about
    versions = ", ".join(f"{k} {v}" for k, v in about.items() if k not in ("date", "machine", "system", "load"))
    return f"*{about['date']}; {about['machine']}; load at the end {about['load']}; {about['system']}; {versions}.*"


def _configs(run: Run, docs: Path) -> str:
    """The 14 configurations against the paper's table."""
    ours = {r.case: r for r in run.rows if r.tool == "ours"}
    rows = []
    for case in PAPER_MINUTES:
        row = ours.get(case)
        if row is None:
            continue
        paper = 60.0 * PAPER_MINUTES[case]
        rows.append(
            (case, _seconds(paper), _seconds(row.seconds), f"{paper / row.seconds:.0f}×", row.verdict.split(";")[0])
        )
    total, published = sum(r.seconds for r in ours.values()), sum(60.0 * PAPER_MINUTES[c] for c in ours)
    rows.append(("**together**", _seconds(published), _seconds(total), f"**{published / total:.0f}×**", ""))
    head = ("configuration", "article, 64 cores", "ours", "ratio", "verdict")
    return f"{CONFIGS_TEXT}\n\n{_table(head, rows)}"


def _statics(run: Run, docs: Path) -> str:
    """A table of tools over cases, and what the fastest other takes in multiples of ours."""
    return _tools_table(run, lambda tool: tool.startswith("ours"))


def _tools_table(run: Run, is_ours: Callable[[str], bool]) -> str:
    tools = list(dict.fromkeys(r.tool for r in run.rows))
    cases = list(dict.fromkeys(r.case for r in run.rows))
    rows = []
    for case in cases:
        mine = {r.tool: r for r in run.rows if r.case == case}
        cells = [_cell(mine.get(tool)) for tool in tools]
        good = [r.seconds for t, r in mine.items() if not is_ours(t) and _usable(r)]
        own = [r.seconds for t, r in mine.items() if is_ours(t) and _usable(r)]
        ratio = f"{min(good) / min(own):.1f}×" if good and own else "–"
        rows.append((case, *cells, ratio))
    return f"{TOOLS_TEXT}\n\n{_table(('case', *tools, 'ratio'), rows)}"


def _usable(row: Measurement) -> bool:
    failed = row.verdict.startswith(("failed", "timeout"))
    return math.isfinite(row.seconds) and not failed and not row.kkt > 1e-6


def _cell(row: Measurement | None) -> str:
    if row is None:
        return "–"
    if row.verdict.startswith(("failed", "timeout")) or not math.isfinite(row.seconds):
        return row.verdict.split(":")[0]
    shown = f"{row.seconds * 1e3:.3g}"
    return f"{shown} ({row.kkt:.0e})" if row.kkt > 1e-8 else shown


def _baseline(run: Run, docs: Path) -> str:
    rows = []
    sizes = sorted({_size(r) for r in run.rows})
    tools = list(dict.fromkeys(r.tool for r in run.rows))
    for size in sizes:
        mine = {r.tool: r for r in run.rows if _size(r) == size}
        cells = [
            f"{_limit(mine[t])}{'' if mine[t].verdict.startswith('holds') else ' ✗'}" if t in mine else "–"
            for t in tools
        ]
        rows.append((f"{size:g}", *cells))
    figure = _figure(run.rows, "baseline", "Design time over the number of parts", "parts", docs)
    return f"{BASELINE_TEXT}\n\n{_table(('parts', *tools), rows)}\n\n{figure}"


def _limit(row: Measurement) -> str:
    return f"> {row.seconds:.0f} s" if row.verdict == "timeout" else _seconds(row.seconds)


def _contacts(run: Run, docs: Path) -> str:
    rows = [
        (r.case, r.tool, "–" if not math.isfinite(r.seconds) else _limit(r), r.verdict, _memory(r)) for r in run.rows
    ]
    return f"{CONTACTS_TEXT}\n\n{_table(('case', 'tool', 'seconds', 'found', 'memory'), rows)}"


def _physics(run: Run, docs: Path) -> str:
    rows = []
    for r in run.rows:
        (what, _, threads), (rate, _, size) = r.case.rpartition("-"), r.verdict.partition("; ")
        rows.append((what, threads, rate.split(",")[0], size or "–", f"{r.memory_mb:.0f} MB"))
    return f"{PHYSICS_TEXT}\n\n{_table(('what', 'threads or processes', 'rate', 'model', 'memory'), rows)}"


def _growth(run: Run, docs: Path) -> str:
    structures = [r for r in run.rows if not r.case.startswith("load cases")]
    cases = [r for r in run.rows if r.case.startswith("load cases")]
    fits = []
    for name in dict.fromkeys(r.case.rpartition("-")[0] for r in run.rows):
        mine = [r for r in run.rows if r.case.rpartition("-")[0] == name and r.verdict != "timeout"]
        if len(mine) < 3:
            continue
        size = [_parts(r) for r in mine] if name != "load cases" else [_size(r) for r in mine]
        row = [name, f"{min(size):.0f} – {max(size):.0f}"]
        row.append(f"{fitted_exponent(size, [r.seconds for r in mine])[0]:.2f}")
        row.append(f"{fitted_exponent(size, [r.memory_mb for r in mine])[0]:.2f}")
        joints = [float(m[1]) if (m := re.search(r"(\d+) joints", r.verdict)) else math.nan for r in mine]
        row.append(f"{fitted_exponent(joints, [r.seconds for r in mine])[0]:.2f}" if name != "load cases" else "–")
        fits.append(row)
    rows = [(r.case, _limit(r), _memory(r), r.verdict) for r in run.rows]
    figures = [_figure(structures, "growth-time", "Design time over the number of parts", "parts", docs, parts=True)]
    memory = "Peak memory over the number of parts"
    figures.append(_figure(structures, "growth-memory", memory, "parts", docs, parts=True, memory=True))
    if cases:
        figures.append(_figure(cases, "growth-cases", "Design time over the number of tilts", "tilts asked for", docs))
    head = ("structure", "sizes", "exponent of time", "of memory", "of time over joints")
    shown = [_table(head, fits), *figures, _table(("case", "CPU", "memory", "what came out"), rows)]
    return "\n\n".join([GROWTH_TEXT, *shown])


def _profile(run: Run, docs: Path) -> str:
    rows = [(r.case, r.tool, _seconds(r.seconds), r.verdict.split(" of ")[0]) for r in run.rows]
    return f"{PROFILE_TEXT}\n\n{_table(('configuration', 'room', 'seconds', 'share'), rows)}"


def _agreement(run: Run, docs: Path, text: str = AGREEMENT_TEXT) -> str:
    found = Counter(r.verdict.partition(":")[0] for r in run.rows if not f"{r.case} ".startswith("all "))
    words = ", ".join(f"{count} {verdict}" for verdict, count in sorted(found.items()))
    apart = sorted((r.case, r.verdict.partition(": ")[2]) for r in run.rows if r.verdict.startswith("DISAGREE"))
    listed = _table(("disagrees", "both verdicts, and the cause"), apart) if apart else ""
    measured = dict.fromkeys(r.case.partition(" µ")[0] for r in run.rows if " µ" in r.case)
    loaded = (r.case for r in run.rows if text is LOADS_TEXT and not r.case.startswith("all "))
    measured |= dict.fromkeys(case.partition(" ")[0] for case in loaded if " " in case)
    which = f" Measured: {', '.join(measured)}." if measured else ""
    return f"{text} {words}.{which}\n\n{listed}".rstrip()


def _samples(run: Run, docs: Path) -> str:
    """Both verdicts on every sample, with their times, and in how many both are right."""
    rows, ratios = [], []
    for case in dict.fromkeys(r.case for r in run.rows):
        mine = {r.tool: r for r in run.rows if r.case == case}
        ours, theirs = mine.get("ours"), mine.get("compas_cra")
        if ours is None or theirs is None:
            continue
        ratios.append(theirs.seconds / ours.seconds)
        said = re.sub(r" \(.*\)", "", theirs.verdict)
        rows.append((case, said, _seconds(theirs.seconds), ours.verdict, _seconds(ours.seconds), f"{ratios[-1]:.0f}×"))
    if not rows:
        return f"{SAMPLES_TEXT}\n\nNot tried here: run `make compas` first."
    wrong = sum("WRONG" in r.verdict for r in run.rows)
    summary = (
        f"{len(rows)} samples, {wrong} wrong verdicts; ours takes {min(ratios):.0f} to {max(ratios):.0f} times less, "
        f"{statistics.median(ratios):.0f} in the median."
    )
    head = ("sample", "compas_cra", "seconds", "ours", "seconds", "ratio")
    return f"{SAMPLES_TEXT}\n\n{summary}\n\n{_table(head, rows)}"


def _insertions(run: Run, docs: Path) -> str:
    rows = [(r.case, _seconds(r.seconds), r.verdict) for r in run.rows]
    return f"{INSERTIONS_TEXT}\n\n{_table(('configuration', 'seconds', 'what came out'), rows)}"


def _plans(run: Run, docs: Path) -> str:
    rows = [(r.case, r.tool, _seconds(r.seconds), r.verdict) for r in run.rows]
    return f"{PLANS_TEXT}\n\n{_table(('configuration', 'what', 'CPU', 'what came out'), rows)}"


def _builds(run: Run, docs: Path) -> str:
    rows = [(r.case, r.tool, _seconds(r.seconds), r.verdict) for r in run.rows]
    return f"{BUILDS_TEXT}\n\n{_table(('configuration', 'what', 'seconds', 'what came out'), rows)}"


CHAPTERS: dict[str, tuple[str, Callable[[Run, Path], str]]] = {
    "configs": ("All configurations, beside the article's table", _configs),
    "baseline": ("Other ways to design (Fig. 17)", _baseline),
    "growth": ("Growth", _growth),
    "statics": ("Statics: E of one load case", _statics),
    "tilt_sweep": ("Statics: 31 tilts from 0° to 15°, by the clock", _statics),
    "friction": ("Statics with friction", _statics),
    "samples": ("Statics with friction: the samples of compas_cra", _samples),
    "states": ("Verdicts while building, with friction", _statics),
    "contacts": ("Contacts", _contacts),
    "physics": ("Physics", _physics),
    "agreement": ("Statics against physics: random assemblies", _agreement),
    "agreement_configs": ("Statics against physics: the configurations", _agreement),
    "agreement_loads": ("Statics against physics: how much of a load stands", partial(_agreement, text=LOADS_TEXT)),
    "insertions": ("Insertions of the configurations", _insertions),
    "plans": ("Plans for a robot", _plans),
    "builds": ("Whole builds by a robot", _builds),
    "profile": ("Where the time goes", _profile),
}


def _figure(
    rows: Sequence[Measurement],
    name: str,
    title: str,
    across: str,
    docs: Path,
    *,
    parts: bool = False,
    memory: bool = False,
) -> str:
    """Return the markdown of a log-log figure after writing it; lines are tools, or structures with their exponent."""
    groups: dict[str, list[Measurement]] = {}
    for row in rows:
        groups.setdefault(row.case.rpartition("-")[0] if parts else row.tool, []).append(row)
    series = []
    for label, mine in groups.items():
        x = [_parts(r) if parts else _size(r) for r in mine]
        y = [r.memory_mb if memory else r.seconds for r in mine]
        hollow = tuple(not r.verdict.startswith("holds") for r in mine)
        try:
            shown = f"{label}: n^{fitted_exponent(x, y)[0]:.2f}" if parts else label
        except ValueError:
            shown = label
        series.append(Series(shown, tuple(x), tuple(y), hollow))
    up = Axis("MB" if memory else "CPU seconds", log=True)
    path = docs / FIGURES / f"{name}.svg"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(stand_alone(chart(title, series, Axis(across, log=True), up)), encoding="utf-8")
    return f"![{title}]({FIGURES}/{name}.svg)"


def _size(row: Measurement) -> float:
    return float(row.case.rpartition("-")[2])


def _parts(row: Measurement) -> float:
    found = re.search(r"(\d+) parts", row.verdict)
    return float(found[1]) if found else _size(row)


def _seconds(value: float) -> str:
    if not math.isfinite(value):
        return "–"
    return f"{value * 1e3:.0f} ms" if value < 1 else f"{value:.1f} s" if value < 100 else f"{value:.0f} s"


def _memory(row: Measurement) -> str:
    return f"{row.memory_mb:.0f} MB" if math.isfinite(row.memory_mb) else "–"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(cell.replace("|", "·").replace("\n", " ") for cell in row) + " |" for row in rows]
    return "\n".join(lines)
