"""Every intermediate assembly of the sequence without friction: what MuJoCo says, beside what statics says."""

from __future__ import annotations

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import LoadCase
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.physics import StateVerdict, Verdict
from sim.disagreement import cause
from sim.scene import compile_scene
from sim.shapes.contact_model import ContactModel
from sim.stability import LIMITS, StabilityLimits, StabilityReport, free_scene, judged


def state_verdict(
    graph: PartsGraph,
    model: ContactModel,
    case: LoadCase,
    limits: StabilityLimits = LIMITS,
) -> StateVerdict:
    """Return both verdicts on one state of `mocca_robot.statics.loads.state_cases`."""
    assembly = graph.assembly
    scene = free_scene(assembly, model, present=case.present, held=case.held, gravity=case.gravity)
    statics = solve_case(graph, case)
    compiled = compile_scene(scene)
    holds = statics.result.status is Status.EQUILIBRIUM
    found = judged(compiled, limits, doubted=holds)
    doubt = holds and found.verdict is Verdict.FELL
    why = cause(compiled, found) if doubt else ""
    placed = assembly.parts[int(np.flatnonzero(case.present).max())].name
    times, poses, names = _recorded(assembly, found)
    return StateVerdict(
        placed=placed,
        verdict=found.verdict,
        statics=statics.result.status,
        friction=0.0,
        reason=found.reason,
        moved=found.moved,
        statics_moved=statics.moving,
        max_displacement=found.max_displacement,
        max_share=found.max_share,
        final_speed=found.final_speed,
        duration=found.duration,
        times=times,
        poses=poses,
        parts=names,
        cause=why,
    )


def _recorded(
    assembly: Assembly, found: StabilityReport, most: int = 60
) -> tuple[tuple[float, ...], tuple[tuple[tuple[float, ...], ...], ...], tuple[str, ...]]:
    if found.stands:
        return (), (), ()
    motion = found.motion
    chosen = np.unique(np.linspace(0, len(motion.times) - 1, min(most, len(motion.times))).round().astype(int))
    poses = tuple(tuple(tuple(map(float, pose)) for pose in motion.poses[k]) for k in chosen)
    return tuple(float(motion.times[k]) for k in chosen), poses, tuple(assembly.parts[p].name for p in motion.parts)
