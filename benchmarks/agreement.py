"""Statics against physics: the same verdict wherever the critical tilt is not close, on random and designed assemblies.

Each row tells what an assembly does just below and just above its critical tilt by statics: without friction in MuJoCo,
where a row that disagrees is experimented on for its cause (see `sim.disagreement`); with friction in the engine of
`sim.coulomb`, on the ground that tilts on.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from benchmarks.measurement import Measurement
from benchmarks.random_assemblies import KINDS, LOCKED_KINDS, SOLID_KINDS, random_assembly, random_solid
from mocca_robot.assembly import Assembly
from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.executors import completed, executor
from mocca_robot.statics.cases import case_at, critical_tilt, solve_case
from mocca_robot.statics.loads import tilted_gravity
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.agreement import agree
from mocca_robot.verdicts.physics import Verdict
from planners.cone_joints.designer import design
from sim.coulomb.judge import Rubbing, rubbing
from sim.coulomb.settle import SettlingOutcome
from sim.coulomb.tilting import tilt_bracket
from sim.disagreement import cause
from sim.scene import with_gravity
from sim.shapes.contact_model import contact_model, telling_rays
from sim.stability import judged
from sim.tilt import TILT_AGREEMENT_RAD, azimuths, detailed_scene, tilt_scene

FLAT_KINDS = (*KINDS, *LOCKED_KINDS)
PLAIN_FRICTIONS = (0.0, 0.4, 0.25, 0.6)
"""Of kinds that mostly fall upright without friction, by seed."""
LOCKED_FRICTIONS = (0.0, 0.0, 0.4)
"""Of kinds that hold by their shape, by seed."""
CONFIGS = Path(__file__).parents[1] / "configs"
CONFIG_FRICTIONS = (0.0, 0.3)


@dataclass(frozen=True)
class Probe:
    """Both verdicts at one tilt (radians) towards the case's azimuth; `reason` is physics' evidence."""

    tilt_rad: float
    statics: Status
    physics: Verdict
    reason: str

    @property
    def agrees(self) -> bool:
        """Return whether both decide, and alike."""
        return agree(self.physics, self.statics) is True


@dataclass(frozen=True)
class Comparison:
    """One assembly's probes on either side of its critical tilt by statics (radians).

    Attributes:
        critical_rad: by statics, towards the case's azimuth.
        friction: Coulomb coefficient.
        probes: one on either side; none when too close to falling upright already.
        cause: what experiments say where the engines disagree, else ''.
    """

    critical_rad: float
    friction: float
    probes: tuple[Probe, ...]
    cause: str = ""

    @property
    def verdict(self) -> str:
        """Return 'agree', 'near' (nothing to compare) or 'DISAGREE'."""
        if not self.probes:
            return "near"
        return "agree" if all(p.agrees for p in self.probes) else "DISAGREE"

    def words(self) -> str:
        """Return the verdict with its evidence."""
        sides = ", ".join(
            f"at {np.rad2deg(p.tilt_rad):.2f}° {p.statics}/{p.physics}" + ("" if p.agrees else f" ({p.reason})")
            for p in self.probes
        )
        why = f"; cause: {self.cause}" if self.cause else ""
        return f"{self.verdict}: critical tilt {np.rad2deg(self.critical_rad):.2f}°, µ {self.friction:g}; {sides}{why}"


def agreement(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield a row per assembly as they are finished, one a core at a time, then the sums.

    36 flat and 9 solid random ones when `quick`, else 150 and 96. `agreement_configs` has the designed ones.
    """
    flat, solid = (36, 8) if quick else (150, 96)
    cases = [(FLAT_KINDS[k % len(FLAT_KINDS)], k // len(FLAT_KINDS)) for k in range(flat)]
    cases += [(SOLID_KINDS[k % len(SOLID_KINDS)], k // len(SOLID_KINDS)) for k in range(solid)]
    named = ((f"{kind}-{seed}", partial(random_case, kind, seed)) for kind, seed in cases)
    yield from rows("agreement", named, only)


def agreement_configs(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield a row per configuration, friction and azimuth, of the built design; flat ones only when `quick`."""
    yield from rows("agreement_configs", _config_cases(quick, only), only)


class Told(Protocol):
    """What was compared, in words."""

    def words(self) -> str:
        """Return 'agree', 'near' (nothing to compare) or 'DISAGREE', with the evidence."""
        ...


def rows(
    bench: str, cases: Iterable[tuple[str, Callable[[], Told | str]]], only: str | None, of: str = ""
) -> Iterator[Measurement]:
    """Yield a row per named case, one a core at a time, then the sums; `of` says what of."""
    sums: dict[str, int] = {}
    total = 0.0
    wanted = ((name, find) for name, find in cases if not only or only in name)
    with executor() as processes:
        for _, row in completed(processes, _row, ((bench, *case) for case in wanted), 2 * (os.cpu_count() or 1)):
            if isinstance(row, Exception):
                raise row
            verdict = row.verdict.partition(":")[0]
            sums[verdict] = sums.get(verdict, 0) + 1
            total += row.seconds
            yield row
    if sums:
        told = ", ".join(f"{count} {verdict}" for verdict, count in sorted(sums.items()))
        yield Measurement(
            bench=bench,
            case=f"all {of}".strip(),
            tool="statics|physics",
            seconds=total,
            repeats=1,
            verdict=told,
            kkt=float("nan"),
            memory_mb=float("nan"),
        )


def _row(case: tuple[str, str, Callable[[], Told | str]]) -> Measurement:
    bench, name, find = case
    started = time.process_time()
    found = find()
    seconds = time.process_time() - started
    words = f"unusable: {found}" if isinstance(found, str) else found.words()
    return Measurement(
        bench=bench,
        case=name,
        tool="statics|physics",
        seconds=seconds,
        repeats=1,
        verdict=words,
        kkt=float("nan"),
        memory_mb=float("nan"),
    )


def random_probe(kind: str, seed: int) -> tuple[Assembly, float]:
    """Return a random assembly and the azimuth (radians) towards which it is tilted."""
    rng = np.random.default_rng((seed, len(kind)))
    assembly = random_solid(kind, seed) if kind in SOLID_KINDS else random_assembly(kind, seed)
    return assembly, float(rng.choice([0.0, np.pi]) if assembly.dimension == 2 else rng.uniform(0.0, 2.0 * np.pi))


def friction_of(kind: str, seed: int) -> float:
    """Return the Coulomb coefficient with which a random assembly is compared."""
    frictions = LOCKED_FRICTIONS if kind in (*LOCKED_KINDS, "peaks") else PLAIN_FRICTIONS
    return frictions[seed % len(frictions)]


def random_case(kind: str, seed: int) -> Comparison | str:
    """Return the comparison on a random assembly, or why it is none: its friction and azimuth come from the seed."""
    assembly, azimuth = random_probe(kind, seed)
    try:
        return compared(assembly, friction_of(kind, seed), azimuth)
    except InputError as error:
        return str(error)


def built_configs(quick: bool, only: str | None) -> Iterator[tuple[str, Assembly]]:
    """Yield name and built assembly of every configuration that is asked for; flat ones only where `quick`."""
    for path in sorted(CONFIGS.glob("*.yaml")):
        if only and only not in path.stem and not only.startswith(f"{path.stem} "):
            continue
        config = load(path)
        if quick and config.assembly.dimension == 3:
            continue
        built = design(config.assembly, config.joints, insertion=dict(config.insertion) or None).design.assembly
        yield path.stem, built


def _config_cases(quick: bool, only: str | None) -> Iterator[tuple[str, Callable[[], Comparison | str]]]:
    for stem, built in built_configs(quick, only):
        for friction in CONFIG_FRICTIONS:
            for azimuth in azimuths(built, 8):
                name = f"{stem} µ {friction:g} {np.rad2deg(azimuth):.0f}°"
                yield name, partial(compared, built, friction, float(azimuth))


def compared(assembly: Assembly, friction: float, azimuth_rad: float) -> Comparison:
    """Return both verdicts just below and just above the critical tilt by statics, as far off as must agree.

    An assembly that falls upright is probed there, if it also falls by statics when tilted a little either way.
    """
    report = find_contacts(assembly)
    require_sound(assembly, report)
    graph = PartsGraph.of(assembly, report.contacts)
    limit = TILT_AGREEMENT_RAD[assembly.dimension]
    critical = critical_tilt(graph, azimuth_rad, friction)

    def statics(angle: float, azimuth: float = azimuth_rad) -> Status:
        return solve_case(graph, case_at(assembly, angle, azimuth), friction).result.status

    if critical > 0.0:
        angles = [a for a in (critical - limit, critical + limit) if 0.0 <= a < np.pi / 2]
    else:
        around = [azimuth_rad + k * np.pi / 4 for k in range(0, 8, 4 if assembly.dimension == 2 else 1)]
        angles = [] if Status.EQUILIBRIUM in {statics(limit, a) for a in around} else [0.0]
    if friction > 0.0:
        expectations = [(a, statics(a)) for a in angles]
        return Comparison(critical, friction, _rubbed(rubbing(graph, friction), azimuth_rad, critical, expectations))
    rays = telling_rays(assembly, report.contacts)
    if rays is None:
        compiled = tilt_scene(assembly, contact_model(assembly, report.contacts))
    else:
        compiled = detailed_scene(graph, rays, azimuth_rad, critical)
    probes = []
    why = ""
    for angle in angles:
        tilted = with_gravity(compiled, tilted_gravity(assembly.gravity, angle, azimuth_rad))
        expected = statics(angle)
        run = judged(tilted, doubted=expected == Status.EQUILIBRIUM)
        probes.append(Probe(angle, expected, run.verdict, run.reason))
        if not probes[-1].agrees:
            why = cause(tilted, run)
    return Comparison(critical, friction, tuple(probes), why)


def _rubbed(
    rubs: Rubbing, azimuth_rad: float, critical_rad: float, angles: Sequence[tuple[float, Status]]
) -> tuple[Probe, ...]:
    """Return the probes with friction from where the ground that tilts on makes it fall; angles go with statics."""
    if not angles:
        return ()
    found = tilt_bracket(rubs, azimuth_rad, critical_rad)
    stood = -1.0 if found.stood is None else found.stood.place
    told = f"critical tilt {np.rad2deg(found.critical_rad):.2f}°"

    def physics(angle: float) -> Verdict:
        if angle <= stood:
            return Verdict.STANDS
        fell = found.fell
        decided = fell is not None and fell.standing.settled.outcome is SettlingOutcome.FALLS
        return Verdict.FELL if fell is not None and decided and angle >= fell.place else Verdict.FAILED

    return tuple(Probe(a, expected, physics(a), told) for a, expected in angles)
