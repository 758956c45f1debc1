"""From contacts to a verdict on strength: every load case by the fast estimate, the worst ones by finite elements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.executors import mapped
from mocca_robot.strength.bedding import Bed
from mocca_robot.strength.cases import PartLoads, Question, answered, gripped, questions, untouched
from mocca_robot.strength.estimate import Cuts, estimated, pressing, thinnest
from mocca_robot.strength.options import MadeOf, StrengthOptions, made_of, other_weights
from mocca_robot.strength.uses import AssemblyStrength, JointStrength, Method, PartStrength, Use, worst_of

LOOKED_AT = 2
"""Load cases of every part that elements look at: the worst by the estimate."""
MANY = 40
"""Parts from which on load cases are shared out between processes."""
SHARES = 8
"""Into how many lots load cases are shared out."""

Progress = Callable[[str], None]


@dataclass(eq=False, kw_only=True)
class Judged:
    """What the estimate says about load cases; filled while they are gone through.

    Attributes:
        uses: by part index, the worst of every kind.
        joints: by pair of part indices, the worst bearing on either.
        worst: by part index the loads of its worst cases with their shares, the worst first.
        left_out: names of cases that are not in equilibrium.
        necks: by part index, width and place.
    """

    uses: dict[int, tuple[Use, ...]] = field(default_factory=dict)
    joints: dict[tuple[int, int], Use] = field(default_factory=dict)
    worst: dict[int, list[tuple[float, PartLoads]]] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    necks: dict[int, tuple[float, Array] | None] = field(default_factory=dict)

    def take(self, part: int, uses: Sequence[Use], worst: Sequence[tuple[float, PartLoads]]) -> None:
        """Add what is said about a part."""
        self.uses[part] = worst_of([*self.uses.get(part, ()), *uses])
        ranked = sorted([*self.worst.get(part, []), *worst], key=lambda entry: (-entry[0], entry[1].case))
        self.worst[part] = ranked[:LOOKED_AT]

    def take_joint(self, pair: tuple[int, int], use: Use) -> None:
        """Add what is said about a joint."""
        if pair not in self.joints or use.share > self.joints[pair].share:
            self.joints[pair] = use

    def join(self, other: Judged) -> None:
        """Add all that another one says."""
        for part, uses in other.uses.items():
            self.take(part, uses, other.worst[part])
        for pair, use in other.joints.items():
            self.take_joint(pair, use)
        self.left_out += other.left_out
        self.necks |= other.necks


@dataclass(frozen=True, eq=False, kw_only=True)
class ElementsSaid:
    """What finite elements say about a part: the worst uses, or why they say nothing.

    Attributes:
        uses: the worst of every kind.
        shade: (n, d + 1) places on the part's outside with the largest share used there, for pictures.
    """

    uses: tuple[Use, ...] = ()
    why: str = ""
    shade: Array | None = None


def assess(
    graph: PartsGraph,
    options: StrengthOptions,
    *,
    friction: float = 0.0,
    states: bool = True,
    elements: Callable[[PartTask], ElementsSaid] | None = None,
    executor: Executor | None = None,
    progress: Progress = lambda _: None,
    scale: float = 1.0,
) -> AssemblyStrength:
    """Return how much of its strength every part and joint of an assembly uses, in every load case.

    Args:
        graph: parts and contacts as they are built.
        friction: Coulomb coefficient on which the contact forces count.
        states: whether every state of the sequence that stands is looked at, too.
        elements: `part_elements.solve_part`, for the worst load cases of each part; None = the estimate alone.
        executor: where load cases and parts are worked on side by side; here when there is none.
        progress: told what is being done.
        scale: for an assembly so many times as large, under the same user loads.

    Raises InputError for parts whose material is unknown, and for a load case that is not in equilibrium.
    """
    made = made_of(graph.assembly, options)
    asked = questions(graph, options, states=states, scale=scale)
    progress(f"{len(asked)} load cases")
    one = partial(judged, graph, options, friction=friction)
    found = Judged()
    if executor is not None and len(graph.assembly.parts) >= MANY:
        for lot in mapped(executor, one, [asked[k::SHARES] for k in range(SHARES) if asked[k::SHARES]]):
            found.join(lot)
    else:
        found = one(asked)
    said: dict[int, ElementsSaid] = {}
    if elements is not None:
        progress(f"elements in {len(found.worst)} parts")
        parts = sorted(found.worst)
        tasks = [PartTask.of(graph.assembly, made[k], [x for _, x in found.worst[k]], options) for k in parts]
        said = dict(zip(parts, mapped(executor, elements, tasks)))
    return _verdict(graph.assembly, made, options, asked, found, said)


@dataclass(frozen=True, eq=False, kw_only=True)
class PartTask:
    """One part for the elements: what it is made of, and what acts on it in its worst cases."""

    assembly: Assembly
    part: int
    made: MadeOf
    loads: tuple[PartLoads, ...]
    element_size: float

    @classmethod
    def of(cls, assembly: Assembly, made: MadeOf, loads: Sequence[PartLoads], options: StrengthOptions) -> PartTask:
        """Return the task; of the assembly only the part goes with it."""
        part = loads[0].part
        alone = replace(
            assembly, parts=(replace(assembly.parts[part], fixed=False),), goals=(), actions=(), combinations=()
        )
        return cls(assembly=alone, part=part, made=made, loads=tuple(loads), element_size=options.elements)


def judged(graph: PartsGraph, options: StrengthOptions, asked: Sequence[Question], friction: float = 0.0) -> Judged:
    """Return what the estimate says about load cases, and about grips where a force is given."""
    parts = graph.assembly.parts
    made, bed, out = made_of(graph.assembly, options), Bed.of(graph), Judged()
    cuts = {part: Cuts.of(parts[part], untouched(bed, part)) for part in graph.free}
    out.necks |= {part: thinnest(c) for part, c in cuts.items()}

    def take(loads: PartLoads) -> None:
        uses = estimated(cuts[loads.part], made[loads.part], loads)
        out.take(loads.part, uses, [(max(u.share for u in uses), loads)])

    for question in asked:
        rows = answered(bed, graph, question, friction)
        if rows is None:
            out.left_out.append(question.case.name)
            continue
        for loads in rows:
            take(loads)
            for other in np.unique(loads.beside):
                beside = loads.among(loads.beside == other)
                for use in pressing(made[loads.part], beside)[:1]:
                    out.take_joint((min(loads.part, int(other)), max(loads.part, int(other))), use)
    if options.grip_force > 0.0 and asked:
        for part in graph.free:
            take(gripped(bed, graph, part, options.grip_force))
    return out


def _verdict(
    assembly: Assembly,
    made: Sequence[MadeOf],
    options: StrengthOptions,
    asked: Sequence[Question],
    found: Judged,
    said: dict[int, ElementsSaid],
) -> AssemblyStrength:
    names = assembly.sequence
    parts = []
    for part in sorted(found.uses):
        elements = said.get(part)
        by_elements = elements is not None and not elements.why
        uses = found.uses[part]
        if elements is not None and by_elements:
            # Bearing is a pressure between parts: no element knows it better than the contact itself.
            uses = worst_of([*elements.uses, *(u for u in uses if u.kind == "bearing")])
        method: Method = "elements" if by_elements else "estimate"
        parts.append(
            PartStrength(
                part=names[part],
                material=made[part].material.name,
                uses=uses,
                method=method,
                neck=found.necks.get(part),
                why="" if elements is None else elements.why,
            )
        )
    grips = [f"grip_{names[p]}" for p in sorted(found.uses)] if options.grip_force > 0.0 else []
    joints = [JointStrength(parts=(names[i], names[j]), use=u) for (i, j), u in sorted(found.joints.items())]
    return AssemblyStrength(
        safety=options.safety,
        parts=tuple(parts),
        joints=tuple(joints),
        cases=(*(q.case.name for q in asked if q.case.name not in found.left_out), *grips),
        left_out=tuple(n for q in asked if (n := q.case.name) in found.left_out),
        notes=(*other_weights(assembly, made), *dict.fromkeys(m.note for m in made if m.note)),
        shades={names[k]: e.shade for k, e in said.items() if e.shade is not None},
    )
