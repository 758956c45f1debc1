"""The stages that `design`, `simulate` and `run` share: read → contacts → design → write → verify → physics → report.

Every verdict comes from the written files: what is judged is what a user holds in hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mocca_robot.assembly import Assembly
from mocca_robot.cli import reasons
from mocca_robot.cli.console import Console, Pace
from mocca_robot.cli.reasons import NegativeVerdict
from mocca_robot.config.config import Config
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.design import Design, Insertion
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import StoredDesign, read_design, write_design
from mocca_robot.files.stored_joints import joints_of
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import CaseVerdict, solve_case
from mocca_robot.statics.loads import state_cases
from mocca_robot.statics.mobility import mobility
from mocca_robot.statics.tilt_reserve import TiltReserve, tilt_reserve
from mocca_robot.strength.uses import AssemblyStrength
from mocca_robot.verdicts.agreement import Remark, remarks
from mocca_robot.verdicts.physics import Simulation
from mocca_robot.verdicts.simulation_json import write_simulation
from mocca_robot.verdicts.verification import Verification, verify

if TYPE_CHECKING:
    from planners.cone_joints.outcome import Designed
    from sim.questions import Questions


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignOutcome:
    """A design with its verdicts; `design` holds the geometry as it was read back from the files.

    Attributes:
        design: source, built parts, joints, insertion directions.
        before, after: verdicts on source and built parts.
        states: every intermediate assembly by statics.
        findings: negative verdicts so far.
        files: what was written, by kind.
        simulation: what physics says; None before physics was asked.
        reserve: the smallest reserve against tilting; None before it was looked for, or where nothing has to stand.
        dry_reserve: the same without friction, where the design counts on some.
        strength: what share of their strength parts use; None where it was not asked.
    """

    design: Design
    before: Verification
    after: Verification
    states: tuple[CaseVerdict, ...]
    findings: tuple[NegativeVerdict, ...] = ()
    files: dict[str, Path] = field(default_factory=dict)
    simulation: Simulation | None = None
    reserve: TiltReserve | None = None
    dry_reserve: TiltReserve | None = None
    strength: AssemblyStrength | None = None

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Return what physics holds against the result, and where it contradicts statics or geometry."""
        if self.simulation is None:
            return ()
        insertions = self.after.insertions
        return remarks(self.design.assembly, self.simulation, insertions=insertions, states=self.states)


def read_contacts(assembly: Assembly, console: Console) -> ContactReport:
    """Return the contacts; InputError when parts overlap, float free, or none is fixed."""
    with console.stage("contacts"):
        report = find_contacts(assembly)
        require_sound(assembly, report)
    return report


def write_files(
    result: Designed, config: Config, folder: Path, console: Console
) -> tuple[dict[str, Path], list[NegativeVerdict]]:
    """Return the files of a design, and what could not be drawn for cutting."""
    problems: list[NegativeVerdict] = []
    with console.stage("write"):
        files = {"design": write_design(result.design, folder)}
        if config.assembly.dimension == 2:
            from mocca_robot.fabrication.cut import write_cut_dxf, write_cut_svg

            try:
                files["cut_svg"] = write_cut_svg(result.design.assembly, folder / "cut.svg", config.cut)
                files["cut_dxf"] = write_cut_dxf(result.design.assembly, folder / "cut.dxf", config.cut)
            except InputError as error:
                problems.append(NegativeVerdict("not_written", f"There is no cutting drawing: {error}"))
    return files, problems


def verify_files(
    folder: Path, result: Designed, files: dict[str, Path], problems: Sequence[NegativeVerdict], console: Console
) -> DesignOutcome:
    """Return the verdicts on what lies in `folder`, read back from the files alone, after those of the design."""
    with console.stage("verify"):
        stored = read_design(folder)
        design = replace(result.design, assembly=stored.assembly, insertion=stored.insertion)
        outcome = _judge(design)
    findings = [*reasons.design_findings(result.design.source, result), *outcome.findings]
    if not result.achieved and not findings:
        # The files are the judge; that the designer wanted more is worth knowing all the same.
        note = "The written parts pass, but with less than the designer's own reserve (joints.inset)."
        outcome = replace(outcome, design=replace(outcome.design, notes=(*outcome.design.notes, note)))
    return replace(outcome, findings=(*findings, *problems), files=files)


def find_reserve(
    outcome: DesignOutcome, config: Config, console: Console, designed: Designed | None = None
) -> DesignOutcome:
    """Return the outcome with its smallest reserve against tilting, and what limits it as far as a design tells.

    A design that misses it is a negative verdict where somebody wrote down how large it has to be; the default is a
    wish.
    """
    friction = outcome.design.judged_friction
    asked = config.joints.tilt_margin_rad, config.simulate.azimuths
    with console.stage("reserve"):
        found = tilt_reserve(outcome.after.graph, *asked, friction=friction)
        dry = tilt_reserve(outcome.after.graph, *asked) if friction > 0.0 else None
    if found is None:
        return outcome
    outcome = replace(outcome, dry_reserve=dry)
    findings = outcome.findings
    if designed is None:
        return replace(outcome, reserve=found)
    found = found.limited_by(designed.tight)
    if found.missed and not findings and config.given("joints.tilt_margin_deg"):
        findings = (reasons.reserve_finding(found, outcome.design.assembly.dimension),)
    return replace(outcome, reserve=found, findings=findings)


def judge_stored(path: Path, console: Console) -> DesignOutcome:
    """Return the verdicts on a stored design; a note says why its joints cannot be shown, where they cannot."""
    with console.stage("verify"):
        stored = read_design(path)
        outcome = _judge(_design_of(stored))
        try:
            design = replace(outcome.design, joints=joints_of(stored, outcome.before.contacts))
        except InputError as error:
            design = replace(outcome.design, notes=(*outcome.design.notes, f"No joints are shown: {error}"))
    return replace(outcome, design=design)


def judge_as_is(config: Config, contacts: ContactReport, console: Console) -> DesignOutcome:
    """Return the verdicts on an assembly without design; its joints are its contacts."""
    joints = PartsGraph.of(config.assembly, contacts.contacts).joints
    ways = tuple(Insertion(part, way, 0.0) for part, way in config.insertion.items())
    with console.stage("verify"):
        return _judge(
            Design(
                source=config.assembly,
                assembly=config.assembly,
                joints=joints,
                insertion=ways,
                load_cases=(),
                seconds={},
                notes=config.notes,
            )
        )


def _design_of(stored: StoredDesign) -> Design:
    source = stored.source or stored.assembly
    return Design(
        source=source,
        assembly=stored.assembly,
        joints=(),
        insertion=stored.insertion,
        load_cases=stored.load_cases,
        seconds=dict(stored.seconds),
        notes=stored.notes,
        friction=stored.friction,
    )


def _judge(design: Design) -> DesignOutcome:
    directions = {i.part: i.direction for i in design.insertion}
    mu = design.judged_friction
    after = verify(design.assembly, directions=directions, friction=mu)
    before = after if design.source is design.assembly else verify(design.source, friction=mu)
    states = tuple(solve_case(after.graph, case, mu) for case in state_cases(after.graph))
    findings = reasons.statics_findings(design.assembly, after)
    if design.source is not design.assembly:
        findings += reasons.overlap_findings(design.assembly, after)
    # Whatever can be inserted last can also leave: only then is the question open.
    if after.insertions and not after.insertions[-1].assemblable and mobility(after.graph).locked:
        findings.append(reasons.deadlock_finding(design.assembly))
    return DesignOutcome(design=design, before=before, after=after, states=states, findings=tuple(findings))


def simulate_design(
    outcome: DesignOutcome, questions: Questions, folder: Path, console: Console
) -> tuple[DesignOutcome, bool]:
    """Return the outcome with physics' verdicts, written to simulation.json, and whether Ctrl-C cut it short.

    Finished trials are kept in trials.jsonl, so that the same command goes on where it was interrupted.
    """
    from mocca_robot.runtime.executors import executor
    from sim.simulate import simulate
    from sim.trial_store import TrialStore

    assembly = outcome.design.assembly
    ways = {i.part: i.direction for i in outcome.design.insertion}
    with console.stage("simulate") as show:
        store = TrialStore(folder / "trials.jsonl")

        pace = Pace()

        def tell(what: str, done: int, total: int) -> None:
            show(f"{done} of {total}: {what}{pace.left(done, total)}")

        with executor(questions.threads) as processes:
            found = simulate(assembly, ways, questions, tell, store, processes=processes)
        path = write_simulation(found, folder / "simulation.json", assembly)
    outcome = replace(outcome, simulation=found, files={**outcome.files, "simulation": path})
    findings = (*outcome.findings, *reasons.physics_findings(outcome.remarks))
    return replace(outcome, findings=findings), found.interrupted


def write_pages(outcome: DesignOutcome, config: Config, folder: Path, console: Console) -> DesignOutcome:
    """Return the outcome with its report written."""
    from mocca_robot.report.data import collect
    from mocca_robot.report.page import write_report

    with console.stage("report"):
        data = collect(
            outcome.design,
            before=outcome.before,
            after=outcome.after,
            states=outcome.states,
            azimuths=config.simulate.azimuths,
            simulation=outcome.simulation,
            parameters=parameters(config),
            negative=[f.text for f in outcome.findings],
            warnings=config.notes,
            friction=outcome.design.judged_friction,
            reserve=outcome.reserve,
            strength=outcome.strength,
        )
        path = write_report(folder / "report.html", data)
    return replace(outcome, files={**outcome.files, "report": path})


def parameters(config: Config) -> dict[str, object]:
    """Return every key that somebody set, as it was written, and the input's path."""
    given = {v.key: v.value for v in config.values if v.origin in ("argument", "configuration") and v.value is not None}
    return {"input": str(config.source), **given}
