"""Statics against MuJoCo on seeded random assemblies: the same verdict wherever the critical tilt is not close.

Known to disagree: frictionless stacks with tongues, where MuJoCo falls earlier. The cause is not established. Statics
holds them with forces of many times the weight between their short walls; MuJoCo's contacts give a little under such
forces, and parts may move farther than counts as rest.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.measurement import Measurement
from benchmarks.random_assemblies import KINDS, SOLID_KINDS, random_assembly, random_solid
from mocca_robot.assembly import Assembly
from mocca_robot.contacts import find_contacts, require_sound
from mocca_robot.errors import InputError
from mocca_robot.loads import tilted_gravity
from mocca_robot.verify import case_at, critical_tilt, solve_case
from sim.contact_model import contact_model
from sim.scene import with_gravity
from sim.simulation import TILT_AGREEMENT_RAD
from sim.stability import Verdict, judged
from sim.tilt import tilt_scene

FLAT_KINDS = (*KINDS, "notched")
FRICTIONS = (0.0, 0.4)


@dataclass(frozen=True)
class Probe:
    """Both verdicts at one tilt (radians) towards the case's azimuth; `reason` is MuJoCo's evidence."""

    tilt_rad: float
    statics: str
    physics: str
    reason: str

    @property
    def agrees(self) -> bool:
        """Return whether both decide, and alike."""
        return (self.statics, self.physics) in (("equilibrium", "stands"), ("not_in_equilibrium", "fell"))


@dataclass(frozen=True)
class Comparison:
    """One assembly's probes on either side of its critical tilt by statics (radians)."""

    critical_rad: float
    friction: float
    probes: tuple[Probe, ...]

    @property
    def verdict(self) -> str:
        """Return 'agree', 'bounded' (friction holds less in physics than statics allows), 'near' or 'DISAGREE'."""
        wrong = [p for p in self.probes if not p.agrees]
        if not self.probes:
            return "near"
        if not wrong:
            return "agree"
        early = all(p.statics == "equilibrium" and p.physics == Verdict.FELL for p in wrong)
        return "bounded" if self.friction > 0.0 and early else "DISAGREE"

    def words(self) -> str:
        """Return the verdict with its evidence."""
        sides = ", ".join(
            f"at {np.rad2deg(p.tilt_rad):.2f}° {p.statics}/{p.physics}" + ("" if p.agrees else f" ({p.reason})")
            for p in self.probes
        )
        return f"{self.verdict}: critical tilt {np.rad2deg(self.critical_rad):.2f}°, µ {self.friction:g}; {sides}"


def agreement(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield a row per assembly: 30 flat and 6 solid ones when `quick`, else 140 and 60; then the table's sums."""
    flat, solid = (30, 6) if quick else (140, 60)
    cases = [(FLAT_KINDS[k % len(FLAT_KINDS)], k // len(FLAT_KINDS)) for k in range(flat)]
    cases += [(SOLID_KINDS[k % len(SOLID_KINDS)], k // len(SOLID_KINDS)) for k in range(solid)]
    sums: dict[str, int] = {}
    total = 0.0
    for kind, seed in cases:
        name = f"{kind}-{seed}"
        if only and only not in name:
            continue
        started = time.process_time()
        found = random_case(kind, seed)
        seconds = time.process_time() - started
        verdict = "unusable" if isinstance(found, str) else found.verdict
        sums[verdict] = sums.get(verdict, 0) + 1
        total += seconds
        words = f"unusable: {found}" if isinstance(found, str) else found.words()
        yield Measurement("agreement", name, "statics|mujoco", seconds, 1, words, float("nan"), float("nan"))
    if sums:
        told = ", ".join(f"{count} {verdict}" for verdict, count in sorted(sums.items()))
        yield Measurement("agreement", "all", "statics|mujoco", total, 1, told, float("nan"), float("nan"))


def random_case(kind: str, seed: int) -> Comparison | str:
    """Return the comparison on a random assembly, or why it is none: its friction and azimuth come from the seed."""
    rng = np.random.default_rng((seed, len(kind)))
    assembly = random_solid(kind, seed) if kind in SOLID_KINDS else random_assembly(kind, seed)
    azimuth = float(rng.choice([0.0, np.pi]) if assembly.dimension == 2 else rng.uniform(0.0, 2.0 * np.pi))
    try:
        return compared(assembly, FRICTIONS[seed % 2], azimuth)
    except InputError as error:
        return str(error)


def compared(assembly: Assembly, friction: float, azimuth_rad: float) -> Comparison:
    """Return both verdicts just below and just above the critical tilt by statics, as far off as must agree.

    An assembly that falls upright is probed there, if it also falls by statics when tilted a little either way.
    """
    report = find_contacts(assembly)
    require_sound(assembly, report)
    limit = TILT_AGREEMENT_RAD[assembly.dimension]
    critical = critical_tilt(assembly, report.contacts, azimuth_rad, friction)

    def statics(angle: float, azimuth: float = azimuth_rad) -> str:
        return str(solve_case(assembly, report.contacts, case_at(assembly, angle, azimuth), friction).result.status)

    if critical > 0.0:
        angles = [a for a in (critical - limit, critical + limit) if 0.0 <= a < np.pi / 2]
    else:
        around = [azimuth_rad + k * np.pi / 4 for k in range(0, 8, 4 if assembly.dimension == 2 else 1)]
        angles = [] if "equilibrium" in {statics(limit, a) for a in around} else [0.0]
    compiled = tilt_scene(assembly, contact_model(assembly, report.contacts, friction), friction)
    probes = []
    for angle in angles:
        run = judged(with_gravity(compiled, tilted_gravity(assembly.gravity, angle, azimuth_rad)))
        probes.append(Probe(angle, statics(angle), str(run.verdict), run.reason))
    return Comparison(critical, friction, tuple(probes))
