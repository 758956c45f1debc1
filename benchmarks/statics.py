"""Statics: Eq. 7 on plain arrays by our interior point and by public solvers; tilt sweeps; friction."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.cases import KINDS, Case
from benchmarks.measurement import Measurement, ToolAnswer, side_by_side
from benchmarks.peers import available
from mocca_robot.arrays import Array
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.solution import EquilibriumResult, solve_system, verdict
from mocca_robot.statics.solver.interior_point import solve_interior_point
from mocca_robot.statics.solver.solvers import Solver, certificate
from mocca_robot.statics.solver.system import ContactSystem

CASES: tuple[tuple[str, int, int], ...] = (
    *(("stack", n, s) for n, s in ((10, 0), (10, 10), (100, 0), (100, 50), (1000, 0))),
    *(("arch", n, s) for n, s in ((10, 50), (27, 0), (150, 0), (150, 10), (150, 50), (500, 200), (1000, 0))),
    *(("wall", n, s) for n, s in ((20, 10), (150, 0), (150, 50), (150, 200), (1000, 0))),
    *(("dome", n, s) for n, s in ((24, 0), (140, 0), (140, 10), (140, 50), (140, 200), (1000, 0), (1000, 10))),
)
QUICK = {"stack-10-planar", "arch-150-50", "wall-150-planar", "dome-140-planar", "dome-140-10"}
LIMIT_S = 20.0
"""Time for one tool on one case; the QP solvers that take longer come back as 'timeout'."""
SWEEP_LIMIT_S = 60.0
"""The same for a sweep, so that a solver that takes two seconds is measured more than once."""
REPEATS = 25
"""Medians of nine turns still differ by a fifth where a turn takes ten milliseconds."""
DENSE_LIMIT = 60_000_000
"""Unknowns × rays beyond which a dense matrix would take half a gigabyte."""


def statics(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield one row per case and tool: Eq. 7 solved, with the verdict and the KKT residual."""
    compile_now()
    for case in _cases(quick, only):
        system, w = case.system, case.system.scaled(case.wrenches())
        c = np.zeros(len(case.pairs))
        _ = system.matrix  # made before anything is timed
        size = len(w) * len(c)

        def ours(system: ContactSystem = system, w: Array = w) -> ToolAnswer:
            fresh = system.holding(system.free)
            fresh.__dict__["matrix"] = system.matrix  # the others are handed B as well
            return ours_again(fresh, w)

        def ours_again(system: ContactSystem = system, w: Array = w) -> ToolAnswer:
            result = solve_system(system, w)
            return ToolAnswer(result.status.value, result.kkt)

        tools: dict[str, Callable[[], ToolAnswer]] = {"ours": ours, "ours, next load": ours_again}
        for name, solver in available().items():
            if name == "daqp" and size > DENSE_LIMIT:
                verdict = f"not tried: {8 * size / 1e9:.1f} GB dense"
                yield Measurement(
                    bench="statics",
                    case=case.name,
                    tool=name,
                    seconds=np.nan,
                    repeats=0,
                    verdict=verdict,
                    kkt=np.nan,
                    memory_mb=np.nan,
                )
                continue
            tools[name] = functools.partial(_solved, solver, system, w)
        yield from side_by_side("statics", case.name, tools, limit_s=LIMIT_S, repeats=REPEATS)


def tilt_sweep(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield one row per case and tool: 31 tilts from 0° to 15° of one structure, structure reused where possible."""
    compile_now()
    angles = np.deg2rad(np.linspace(0.0, 15.0, 31))
    for kind, blocks, samples in (("arch", 50, 0), ("arch", 50, 50), ("dome", 140, 10), ("dome", 140, 50)):
        case = KINDS[kind](blocks, samples)
        if (only and only not in case.name) or (quick and kind == "dome"):
            continue
        system = case.system
        loads = [system.scaled(case.wrenches(a)) for a in angles]
        c = np.zeros(len(case.pairs))

        def ours(system: ContactSystem = system, loads: list[Array] = loads, c: Array = c) -> ToolAnswer:
            motions, forces = solve_interior_point(system, np.array(loads), c)
            return _sweep(system, loads, list(zip(motions, forces, strict=True)))

        def theirs(
            solver: Solver, system: ContactSystem = system, loads: list[Array] = loads, c: Array = c
        ) -> ToolAnswer:
            return _sweep(system, loads, [solver(system.matrix, w, c) for w in loads])

        tools: dict[str, Callable[[], ToolAnswer]] = {"ours": ours}
        for tool, solver in available().items():
            if tool not in {"daqp", "highs"}:  # dense, and without Eq. 7's motion
                tools[tool] = functools.partial(theirs, solver)
        yield from side_by_side("tilt_sweep", case.name, tools, limit_s=SWEEP_LIMIT_S, threads=True)


def compile_now() -> None:
    """Compile our own solver, or load what was: that is done once, before tools are measured in their processes."""
    case = KINDS["arch"](10, 10)
    for friction in (0.0, 0.5):
        equilibrium(
            *(case.pairs, case.points, case.normals, case.wrenches(0.1)),
            fixed=~case.free,
            friction=friction,
            solver="interior_point",
        )


def _sweep(system: ContactSystem, loads: list[Array], solutions: list[tuple[Array, Array]]) -> ToolAnswer:
    outcomes = [_outcome(system, w, v, f) for w, (v, f) in zip(loads, solutions, strict=True)]
    standing = sum(o.verdict == "equilibrium" for o in outcomes)
    return ToolAnswer(f"{standing} of {len(loads)} stand", max(o.kkt for o in outcomes))


def friction(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield one row per case and tool: equilibrium with friction 0.55, planar contacts, upright and tilted 10°."""
    compile_now()
    for kind, blocks in (("arch", 27), ("wall", 150), ("dome", 72), ("dome", 140)):
        case = KINDS[kind](blocks, 0)
        if (only and only not in case.name) or (quick and blocks > 100):
            continue
        for tilt in (0.0, 10.0):
            wrenches = case.wrenches(np.deg2rad(tilt))
            tools: dict[str, Callable[[], ToolAnswer]] = {}
            for tool, solver in (("ours", "interior_point"), ("clarabel", "clarabel")):

                def run(solver: str = solver, case: Case = case, wrenches: Array = wrenches) -> ToolAnswer:
                    result = equilibrium(
                        case.pairs,
                        case.points,
                        case.normals,
                        wrenches,
                        fixed=~case.free,
                        friction=0.55,
                        about=case.centroids,
                        length=case.length,
                        solver=solver,
                    )
                    assert isinstance(result, EquilibriumResult)
                    return ToolAnswer(result.status.value, result.kkt)

                tools[tool] = run
            yield from side_by_side("friction", f"{case.name}-tilt{tilt:.0f}", tools, repeats=REPEATS)


def _cases(quick: bool, only: str | None) -> Iterator[Case]:
    for kind, blocks, samples in CASES:
        name = f"{kind}-{blocks}-{samples or 'planar'}"
        if (only and only not in name) or (quick and name not in QUICK):
            continue
        yield KINDS[kind](blocks, samples)


def _solved(solver: Solver, system: ContactSystem, w: Array) -> ToolAnswer:
    return _outcome(system, w, *solver(system.matrix, w, np.zeros(len(system.pairs))))


def _outcome(system: ContactSystem, w: Array, v: Array, f: Array) -> ToolAnswer:
    residual, kkt = certificate(system.matrix, w, np.zeros(len(f)), v, f)
    return ToolAnswer(verdict(residual, kkt).value, kkt)
