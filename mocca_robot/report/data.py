"""All that a report shows, gathered before a line of it is written."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata

from mocca_robot.design import Design
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import CaseVerdict, critical_tilt, solve_case
from mocca_robot.statics.loads import state_cases, tilt_azimuths
from mocca_robot.statics.tilt_reserve import TiltReserve
from mocca_robot.strength.uses import AssemblyStrength
from mocca_robot.verdicts.physics import Simulation
from mocca_robot.verdicts.verification import Verification, verify

ENGINES = ("mocca-robot", "numpy", "scipy", "shapely", "mujoco", "clarabel", "piqp", "daqp", "osqp")


@dataclass(frozen=True)
class Tilt:
    """Critical tilt towards one azimuth by statics, radians; `before_rad` is that of the input."""

    azimuth_rad: float
    after_rad: float
    before_rad: float | None = None
    friction: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class ReportData:
    """What a report is made from.

    Attributes:
        design: the input, the result, its joints and insertion directions.
        before, after: verdicts on the input and on the result, each from its own geometry.
        states: the result's intermediate assemblies, one per free part in assembly order.
        tilts: critical tilts by statics.
        simulation: what physics says; None when nothing was simulated.
        parameters: what the run was asked for.
        versions: of the programs that computed it.
        negative: every negative verdict as a sentence, with its evidence; they stand at the top.
        warnings: what a reader should know besides `design.notes`.
        reserve: the smallest reserve against tilting beside what was asked for; None when it was not looked for.
        strength: what share of their strength parts use; None when it was not asked.
    """

    design: Design
    before: Verification
    after: Verification
    states: tuple[CaseVerdict, ...]
    tilts: tuple[Tilt, ...] = ()
    simulation: Simulation | None = None
    parameters: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    negative: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    reserve: TiltReserve | None = None
    strength: AssemblyStrength | None = None

    @property
    def graph(self) -> PartsGraph:
        """Return the parts-graph of the input with the joints that replace its contacts."""
        ways = {i.part: i.direction for i in self.design.insertion}
        if not self.design.joints:
            return PartsGraph.of(self.design.source, self.before.contacts, ways)
        return PartsGraph.joined(self.design.source, self.design.joints, ways)


def collect(
    design: Design,
    *,
    before: Verification | None = None,
    after: Verification | None = None,
    states: Sequence[CaseVerdict] | None = None,
    tilts: Sequence[Tilt] | None = None,
    azimuths: int = 8,
    simulation: Simulation | None = None,
    parameters: Mapping[str, object] | None = None,
    versions: Mapping[str, str] | None = None,
    negative: Sequence[str] = (),
    warnings: Sequence[str] = (),
    friction: float = 0.0,
    reserve: TiltReserve | None = None,
    strength: AssemblyStrength | None = None,
) -> ReportData:
    """Return the report data of `design`, computing by statics whatever is not handed in.

    `tilts=()` leaves the critical tilts out; by default they are found towards `azimuths` directions (two in 2D).
    """
    directions = {i.part: i.direction for i in design.insertion}
    before = before or verify(design.source, friction=friction)
    after = after or verify(design.assembly, friction=friction, directions=directions)
    if states is None:
        states = [solve_case(after.graph, case, friction) for case in state_cases(after.graph)]
    if tilts is None:
        tilts = statics_tilts(before.graph, after.graph, azimuths, friction)
    return ReportData(
        design=design,
        before=before,
        after=after,
        states=tuple(states),
        tilts=tuple(tilts),
        simulation=simulation,
        parameters=dict(parameters or {}),
        versions=dict(versions) if versions is not None else installed_versions(),
        negative=tuple(negative),
        warnings=tuple(warnings),
        reserve=reserve,
        strength=strength,
    )


def statics_tilts(before: PartsGraph, after: PartsGraph, azimuths: int = 8, friction: float = 0.0) -> tuple[Tilt, ...]:
    """Return the critical tilt of the input and of the result towards each azimuth."""
    return tuple(
        Tilt(
            float(azimuth),
            critical_tilt(after, float(azimuth), friction),
            critical_tilt(before, float(azimuth), friction),
            friction,
        )
        for azimuth in tilt_azimuths(after.assembly.dimension, azimuths)
    )


def installed_versions(names: Sequence[str] = ENGINES) -> dict[str, str]:
    """Return the installed version of each distribution in `names` that is present, and Python's."""
    found = {"python": platform.python_version()}
    for name in names:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
