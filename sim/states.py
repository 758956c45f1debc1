"""Every intermediate assembly of the sequence: what physics says, beside what statics says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import BoolArray
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import Contact
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import LoadCase
from mocca_robot.statics.solution import Status
from sim.disagreement import cause
from sim.scene import compile_scene
from sim.shapes.contact_model import ContactModel
from sim.stability import LIMITS, StabilityLimits, StabilityReport, Verdict, free_scene, judged


@dataclass(frozen=True, kw_only=True)
class StateResult:
    """The assembly just after a part was placed.

    Attributes:
        placed: name of the part placed last.
        verdict: 'stands', 'fell' or 'failed', from physics.
        statics: 'equilibrium', 'not_in_equilibrium' or 'inaccurate'.
        reason: physics' evidence in words.
        moved: parts that moved; statics_moved those that statics' collapse motion moves.
        max_displacement, max_share: metres, and relative to the part's size.
        final_speed: m/s.
        duration: simulated seconds; steps taken.
        times, poses: the motion, sampled; poses[t][f] are the coordinates of part `parts[f]` (x, y, turn from its
            place in 2D; position and quaternion in 3D). Empty for a state that stands.
        parts: names of the parts in `poses`.
        cause: what experiments say where it falls in physics though statics holds it; else ''.
    """

    placed: str
    verdict: str
    statics: str
    reason: str
    moved: tuple[str, ...]
    statics_moved: tuple[str, ...]
    max_displacement: float
    max_share: float
    final_speed: float
    duration: float
    steps: int
    times: tuple[float, ...] = ()
    poses: tuple[tuple[tuple[float, ...], ...], ...] = ()
    parts: tuple[str, ...] = ()
    cause: str = ""

    @property
    def stands(self) -> bool:
        """Return whether it stands in physics."""
        return self.verdict == Verdict.STANDS

    @property
    def agrees(self) -> bool:
        """Return whether physics and statics both gave a verdict, and the same."""
        if self.verdict == Verdict.FAILED or self.statics == Status.INACCURATE:
            return False
        return self.stands == (self.statics == Status.EQUILIBRIUM)


def state_result(
    assembly: Assembly,
    model: ContactModel,
    contacts: Sequence[Contact],
    case: LoadCase,
    friction: float = 0.0,
    limits: StabilityLimits = LIMITS,
) -> StateResult:
    """Return both verdicts on one state of `mocca_robot.statics.loads.state_cases`."""
    scene = free_scene(assembly, model, present=case.present, held=case.held, gravity=case.gravity, friction=friction)
    statics = solve_case(assembly, contacts, case, friction)
    compiled = compile_scene(scene)
    holds = statics.result.status is Status.EQUILIBRIUM
    found = judged(compiled, limits, doubted=holds)
    doubt = holds and found.verdict is Verdict.FELL
    why = cause(assembly, _between(contacts, case.present), case, compiled, found) if doubt else ""
    placed = assembly.parts[int(np.flatnonzero(case.present).max())].name
    times, poses, names = _recorded(assembly, found)
    return StateResult(
        placed=placed,
        verdict=str(found.verdict),
        statics=str(statics.result.status),
        reason=found.reason,
        moved=found.moved,
        statics_moved=statics.moving,
        max_displacement=found.max_displacement,
        max_share=found.max_share,
        final_speed=found.final_speed,
        duration=found.duration,
        steps=found.steps,
        times=times,
        poses=poses,
        parts=names,
        cause=why,
    )


def _between(contacts: Sequence[Contact], present: BoolArray) -> list[Contact]:
    return [c for c in contacts if present[list(c.parts)].all()]


def _recorded(
    assembly: Assembly, found: StabilityReport, most: int = 60
) -> tuple[tuple[float, ...], tuple[tuple[tuple[float, ...], ...], ...], tuple[str, ...]]:
    if found.stands:
        return (), (), ()
    motion = found.motion
    chosen = np.unique(np.linspace(0, len(motion.times) - 1, min(most, len(motion.times))).round().astype(int))
    poses = tuple(tuple(tuple(map(float, pose)) for pose in motion.poses[k]) for k in chosen)
    return tuple(float(motion.times[k]) for k in chosen), poses, tuple(assembly.parts[p].name for p in motion.parts)
