"""One configuration → everything that the studio shows of it, told stage by stage: input, progress, result."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mocca_robot.cli import reasons, understood
from mocca_robot.cli.designing import require_friction
from mocca_robot.cli.studio import seen
from mocca_robot.config.config import Config, configured
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report import reserves, tilt_words
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import state_cases
from mocca_robot.statics.mobility import mobility
from mocca_robot.statics.tilt_reserve import tilt_reserve
from mocca_robot.verdicts.verification import Verification, verify

Tell = Callable[[str, Mapping[str, Any]], None]
"""Takes the name of a stage and its data. What it raises ends the computation."""


@dataclass(frozen=True, eq=False)
class Computed:
    """What further questions (tilt, letting go) are asked about: the input's graph, and the result's if any."""

    config: Config
    before: PartsGraph
    after: PartsGraph | None
    friction: float


def compute(data: Mapping[str, Any], source: Path, folder: Path, tell: Tell) -> Computed:
    """Return the graphs of the configuration `data`, after telling every stage.

    The stages are 'input' (parts, contacts, verdicts on them), 'progress' any number of times, and 'result'.
    Raises InputError for what cannot be used.
    """
    started = time.perf_counter()
    config = configured(data, source, folder)
    report = find_contacts(config.assembly)
    graph = PartsGraph.of(config.assembly, report.contacts, config.insertion)
    tell("input", {**_understood(config, graph, report), "seconds": time.perf_counter() - started})
    require_sound(config.assembly, report)
    require_friction(config)
    tell("progress", {"what": "judging the input", "worst": None, "seconds": 0.0})
    before = verify(config.assembly, directions=dict(config.insertion) or None)
    tell(
        "before",
        {
            "cases": seen.cases_data(before.graph, before.cases),
            "insertions": seen.insertions_data(before.graph, before.insertions, dict(config.insertion)),
            "findings": reasons.findings_data(reasons.statics_findings(config.assembly, before)),
        },
    )
    result, graph_after = _designed(config, report, before, tell)
    tell("result", {**result, "seconds": time.perf_counter() - started})
    return Computed(config, before.graph, graph_after, config.joints.friction)


def _understood(config: Config, graph: PartsGraph, report: ContactReport) -> dict[str, Any]:
    assembly = config.assembly
    misses = [
        f"'{m.parts[0]}' and '{m.parts[1]}' are {m.gap_m * 1e3:.3g} mm apart; close the gap if they should touch."
        for m in report.near_misses
    ]
    return {
        "assembly": seen.assembly_data(assembly, graph),
        "shapes": seen.shapes_data(assembly),
        "contacts": seen.contacts_data(report),
        "unit": config.unit,
        "unit_m": config.unit_m,
        "understood": understood.lines(config, graph),
        "notes": [*config.notes, *misses, *understood.suspicions(graph)],
        "values": {v.key: v.value for v in config.values},
        "origins": {v.key: v.origin for v in config.values},
    }


def _designed(
    config: Config, report: ContactReport, before: Verification, tell: Tell
) -> tuple[dict[str, Any], PartsGraph]:
    from planners.cone_joints.largest_tilt import design_as_asked

    assembly = config.assembly
    begun = time.perf_counter()

    def progress(what: str, worst: float) -> None:
        tell("progress", {"what": what, "worst": worst, "seconds": time.perf_counter() - begun})

    tell("progress", {"what": "looking for joints", "worst": None, "seconds": 0.0})
    designed = design_as_asked(
        assembly, config.joints, insertion=dict(config.insertion) or None, contacts=report, progress=progress
    )
    design = designed.design
    tell("progress", {"what": "judging the built parts", "worst": None, "seconds": time.perf_counter() - begun})
    mu = design.judged_friction
    after = verify(design.assembly, directions=seen.ways_of(design), friction=mu)
    states = tuple(solve_case(after.graph, case, mu) for case in state_cases(after.graph))
    found = [*reasons.design_findings(assembly, designed), *reasons.statics_findings(design.assembly, after)]
    found += reasons.overlap_findings(design.assembly, after)
    if after.insertions and not after.insertions[-1].assemblable and mobility(after.graph).locked:
        found.append(reasons.deadlock_finding(design.assembly))
    reserve = None
    if design.friction is None:
        tell("progress", {"what": "measuring the reserve", "worst": None, "seconds": time.perf_counter() - begun})
        reserve = tilt_reserve(after.graph, config.joints.tilt_margin_rad, config.simulate.azimuths)
        reserve = None if reserve is None else reserve.limited_by(designed.tight)
        if reserve is not None and reserve.missed and not found and config.given("joints.tilt_margin_deg"):
            found.append(reasons.reserve_finding(reserve, assembly.dimension))
    supports = reasons.supports(assembly, states)
    return {
        "shapes": seen.shapes_data(design.assembly),
        "joints": seen.joints_data(design.joints),
        "cases": seen.cases_data(after.graph, after.cases),
        "states": seen.cases_data(after.graph, states),
        "insertions": seen.insertions_data(after.graph, after.insertions, seen.ways_of(design)),
        "findings": reasons.findings_data(found),
        "notes": list(dict.fromkeys(design.notes)),
        "supports": [assembly.index(name) for name in supports],
        "reserve": None if reserve is None else _reserve(reserve, assembly.dimension),
        "loads": [reserves.factor_words(f) for f in after.load_factors],
        "positive": not found,
        "closing": None if found else tilt_words.positive_words(reserve, after.load_factors),
        "friction": None if design.friction is None else design.friction.words,
    }, after.graph


def _reserve(reserve: Any, dimension: int) -> dict[str, Any]:
    data = tilt_words.tilt_data(reserve) or {}
    return {**data, "words": tilt_words.tilt_words(reserve, dimension), "limit": tilt_words.limit_words(reserve)}
