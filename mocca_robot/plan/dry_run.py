"""A plan on paper: every waypoint with its speed, force limit and duration, and everything that forbids running it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mocca_robot.plan.gripper import undrivable
from mocca_robot.plan.plan import Move, Plan, Waypoint
from mocca_robot.plan.pose import Six, distance_m
from mocca_robot.plan.safety import PlanFinding, findings


@dataclass(frozen=True, kw_only=True)
class Row:
    """One waypoint as it would be commanded; `alternative` is None on the move's own path."""

    step: int
    part: str
    move: int
    kind: str
    alternative: int | None
    waypoint: int
    t_s: float
    q: Six
    tcp: Six
    speed_m_s: float
    force_limit_n: float
    gripper_m: float


@dataclass(frozen=True)
class DryRun:
    """What an execution would do, without doing it.

    Attributes:
        rows: every waypoint from the first step on, alternatives after the path that they replace.
        seconds: planned duration per step, alternatives and pauses not counted.
        findings: what forbids the execution; empty when the plan is sound.
    """

    plan: Plan
    first_step: int
    rows: tuple[Row, ...]
    seconds: tuple[float, ...]
    findings: tuple[PlanFinding, ...]

    def text(self) -> str:
        """Return the dry run as a table for a terminal."""
        plan = self.plan
        lines = [
            f"dry run: {plan.robot} with {plan.gripper} in cell '{plan.cell.name}', plan {plan.sha256[:12]}",
            f"{len(self.rows)} waypoints, {sum(self.seconds):.1f} s planned; nothing is sent to a robot",
        ]
        if (wiring := plan.cell.vacuum) is not None:
            switch = "no vacuum switch: grips are taken on trust" if wiring.input is None else f"switch {wiring.input}"
            lines.append(f"vacuum: output {wiring.output}, {switch}; at most {wiring.wait_s:g} s to come or go")
        limits = plan.cell.limits
        fast = f"free motion at up to {limits.transfer_speed_m_s:g} m/s, lifts {limits.lift_speed_m_s:g} m/s"
        lines.append(f"preset '{limits.preset}': {fast}")
        if limits.accepted:
            lines.append(f"contact counts from {limits.contact_force_n:g} N, accepted by the lab: {limits.accepted}")
        if words := undrivable(plan):
            lines.append(f"cannot be executed: {words}")
        if holding := [name for name in plan.supports if name not in plan.cradles]:
            lines.append(f"somebody or something has to hold, once placed: {', '.join(holding)}")
        if plan.cradles:
            lines.append(f"cradles have to stand ready, and were not checked for collisions: {', '.join(plan.cradles)}")
        place: tuple[int, int, int | None] | None = None
        for row in self.rows:
            if place != (row.step, row.move, row.alternative):
                place = (row.step, row.move, row.alternative)
                other = "" if row.alternative is None else f", alternative {row.alternative}"
                lines.append(
                    f"step {row.step} ({row.part}), move {row.move}: {row.kind}{other}; at most "
                    f"{row.force_limit_n:g} N, {_gripper(plan, row.gripper_m)}"
                )
            joints = " ".join(f"{v:8.4f}" for v in row.q)
            pose = " ".join(f"{v:8.4f}" for v in row.tcp)
            lines.append(
                f"  {row.waypoint:4d} t {row.t_s:7.3f} s  q {joints}  tcp {pose}  {1e3 * row.speed_m_s:6.1f} mm/s"
            )
        lines.extend(f"REFUSED {f}" for f in self.findings)
        if not self.findings:
            lines.append("every waypoint is within the limits of arm, cell and driver")
        elif len(self.findings) > 1:
            lines.append(f"{len(self.findings)} findings; begin with the first: others may follow from it")
            lines.append(f"first: {self.findings[0]}")
        return "\n".join(lines)

    def document(self) -> dict[str, Any]:
        """Return the dry run as JSON-ready values."""
        return {
            "plan_sha256": self.plan.sha256,
            "robot": self.plan.robot,
            "cell": self.plan.cell.name,
            "first_step": self.first_step,
            "seconds": list(self.seconds),
            "waypoints": [dict(vars(r)) for r in self.rows],
            "findings": [dict(vars(f)) for f in self.findings],
        }


def _gripper(plan: Plan, opening_m: float) -> str:
    if plan.gripper != "suction":
        return f"gripper {1e3 * opening_m:.1f} mm"
    return f"vacuum {'on' if opening_m < 0.5 * sum(plan.cell.gripper_stroke_m) else 'off'}"


def dry_run(plan: Plan, first_step: int = 0, last_step: int | None = None) -> DryRun:
    """Return every waypoint of `plan` from `first_step` on, to `last_step`, with the findings of the whole plan."""
    rows: list[Row] = []
    seconds = []
    for i in range(first_step, len(plan.steps) if last_step is None else last_step + 1):
        step = plan.steps[i]
        total = 0.0
        for k, move in enumerate(step.moves):
            total += move.path[-1].t - move.path[0].t
            rows.extend(_rows(i, step.part, k, move, None, move.path))
            for a, path in enumerate(move.alternatives):
                rows.extend(_rows(i, step.part, k, move, a, path))
        seconds.append(total)
    return DryRun(plan, first_step, tuple(rows), tuple(seconds), tuple(findings(plan)))


def _rows(
    step: int, part: str, move: int, what: Move, alternative: int | None, path: tuple[Waypoint, ...]
) -> list[Row]:
    out = []
    for w, point in enumerate(path):
        before = path[w - 1] if w else point
        duration = point.t - before.t
        speed = distance_m(point.tcp, before.tcp) / duration if duration > 0 else 0.0
        out.append(
            Row(
                step=step,
                part=part,
                move=move,
                kind=str(what.kind),
                alternative=alternative,
                waypoint=w,
                t_s=point.t,
                q=point.q,
                tcp=point.tcp,
                speed_m_s=speed,
                force_limit_n=what.force_limit_n,
                gripper_m=what.gripper_m,
            )
        )
    return out
