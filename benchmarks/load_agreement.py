"""Load factors by statics against physics: random loads on random assemblies, and on designs of the configurations.

Each row has one load of a random kind, place and direction, without friction; physics is MuJoCo. Where statics says
that any amount stands, physics has to hold ten times the structure's own weight.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks.agreement import built_configs, rows
from benchmarks.measurement import Measurement
from benchmarks.random_assemblies import random_assembly, random_solid
from mocca_robot.actions import Action, AddedMass, BodyAcceleration, LineForce, PointForce, Pressure, Wind
from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.load_factor import asked_combinations, load_factors
from mocca_robot.verdicts.agreement import LOAD_AGREEMENT
from mocca_robot.verdicts.physics import LoadVerdict
from sim.loads import load_verdict
from sim.shapes.contact_model import contact_model, telling_rays

RANDOM_KINDS = ("notched", "ridged", "peaks", "solid_notched")
"""Kinds that stand without friction."""
LOADS = ("force", "line", "mass", "pressure", "wind", "acceleration")
LOADS_PER_CONFIG = 3


@dataclass(frozen=True)
class LoadComparison:
    """How much of one load stands by statics and in physics; None, and `what` says why, when nothing is compared."""

    found: LoadVerdict | None
    what: str

    def words(self) -> str:
        """Return the verdict with its figures."""
        if self.found is None:
            return self.what
        found = self.found
        same = found.apart <= LOAD_AGREEMENT and not found.failed
        physics = f"over {found.tried:.4g}" if np.isinf(found.factor) else f"{found.factor:.4g} ± {found.within:.2g}"
        words = f"{'agree' if same else 'DISAGREE'}: {self.what}, λ {found.statics:.4g} by statics, {physics} in MuJoCo"
        words += f", {found.apart:.2%} apart" if found.apart else ""
        words += f", {len(found.failed)} runs without verdict" if found.failed else ""
        return words + (f"; cause: {found.cause}" if found.cause else "")


def agreement_loads(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield a row per assembly and load: 100 random ones and all configurations; 24 and the flat ones when `quick`."""
    count = 24 if quick else 100
    kinds = [(RANDOM_KINDS[k % len(RANDOM_KINDS)], k // len(RANDOM_KINDS)) for k in range(count)]
    named = ((f"{kind}-{seed}", partial(random_case, kind, seed)) for kind, seed in kinds)
    yield from rows("agreement_loads", named, only, "random")
    yield from rows("agreement_loads", _config_cases(quick, only), only, "configurations")


def random_case(kind: str, seed: int) -> LoadComparison | str:
    """Return the comparison on a random assembly under a random load, or why it is none."""
    flat = kind in ("notched", "ridged")
    assembly = random_assembly(kind, seed) if flat else random_solid(kind, seed)
    try:
        return compared(assembly, LOADS[seed % len(LOADS)], seed)
    except InputError as error:
        return str(error)


def _config_cases(quick: bool, only: str | None) -> Iterator[tuple[str, Callable[[], LoadComparison | str]]]:
    for stem, built in built_configs(quick, only):
        for k in range(LOADS_PER_CONFIG):
            kind = LOADS[(2 * k + len(stem)) % len(LOADS)]
            yield f"{stem} {kind}", partial(compared, built, kind, k)


def compared(assembly: Assembly, kind: str, seed: int) -> LoadComparison:
    """Return how much of a random load of a kind stands by statics and in physics."""
    report = find_contacts(assembly)
    require_sound(assembly, report)
    action = random_load(assembly, kind, np.random.default_rng((seed, len(assembly.parts))))
    graph = PartsGraph.of(replace(assembly, actions=(action,), combinations=()), report.contacts)
    (combination,), (expected,) = asked_combinations(graph.assembly), load_factors(graph)
    if expected.steps == 0:
        return LoadComparison(None, f"near: {kind} meets nothing that can move")
    if expected.factor is None:
        return LoadComparison(None, f"undecided: {kind}, statics gave no verdict")
    rays = telling_rays(graph.assembly, report.contacts)
    touching = contact_model(graph.assembly, report.contacts) if rays is None else rays
    return LoadComparison(load_verdict(graph, touching, combination, expected), kind)


def random_load(assembly: Assembly, kind: str, rng: np.random.Generator) -> Action:
    """Return a load of a kind, as heavy as a tenth of the structure, at random on a random part that can move."""
    d = assembly.dimension
    free = [p for p in assembly.parts if not p.fixed]
    part = free[int(rng.integers(len(free)))]
    weight = 0.1 * sum(p.mass for p in free) * float(np.linalg.norm(assembly.gravity))
    way = rng.normal(size=d)
    way /= np.linalg.norm(way)
    area = assembly.size if d == 2 else assembly.size**2
    corners = part.shape.exterior if isinstance(part.shape, Polygon) else part.shape.vertices

    def place() -> Array:
        """Return a place on the line from the centre of mass towards a corner."""
        return np.asarray(part.centroid + rng.uniform(0.2, 0.9) * (corners[rng.integers(len(corners))] - part.centroid))

    if kind == "force":
        return PointForce(name=kind, part=part.name, force=weight * way, at=place())
    if kind == "line":
        start, end = part.centroid, place()
        return LineForce(
            name=kind, part=part.name, start=start, end=end, force=weight * way / np.linalg.norm(end - start)
        )
    if kind == "mass":
        return AddedMass(
            name=kind, part=part.name, mass_kg=weight / float(np.linalg.norm(assembly.gravity)), at=place()
        )
    if kind == "pressure":
        return Pressure(name=kind, pressure_pa=weight / area, facing=way)
    if kind == "wind":
        return Wind(name=kind, pressure_pa=weight / area, towards=way)
    return BodyAcceleration(name=kind, acceleration=way)
