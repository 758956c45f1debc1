"""The stand-alone program: well-formed, and every number of it one of the plan's or of its limits."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ur_cell import small_plan, suction_plan

from mocca_robot.cli.execute import export_urscript
from mocca_robot.errors import InputError
from mocca_robot.plan.plan import MoveKind, Plan, write_plan
from mocca_robot.plan.pose import pose_of, transform
from mocca_robot.plan.wiring import VacuumWiring
from mocca_robot.ur.urscript import urscript

PLAN = small_plan(2)
OPENS = re.compile(r"^(def|if|while|thread)\b.*:$")


def blocks(text: str) -> int:
    """Return the number of lines, having checked that blocks open, indent and end as URScript wants them."""
    depth = 0
    for line in text.splitlines():
        words = line.strip()
        if words == "end" or words.startswith(("elif ", "else")):
            depth -= 1
        assert line == "  " * depth + words, line
        if OPENS.match(words) or words.startswith(("elif ", "else")):
            depth += 1
        assert line.count('"') % 2 == 0
        assert line.count("(") == line.count(")") and line.count("[") == line.count("]"), line
    assert depth == 0
    return len(text.splitlines())


def lists(text: str, command: str) -> list[list[float]]:
    found = re.findall(rf"^\s+{command}\(\[([^\]]*)\]", text, re.M)
    return [[float(v) for v in f.split(",")] for f in found]


def test_program_is_well_formed() -> None:
    assert blocks(urscript(PLAN)) > 100
    assert blocks(urscript(replace(PLAN, gripper="none"))) > 100


def test_motions_go_where_the_plan_goes() -> None:
    text = urscript(PLAN)
    transits = [w.q for s in PLAN.steps for m in s.moves if m.kind is MoveKind.TRANSIT for w in m.path[1:]]
    assert [x for q in lists(text, "movej") for x in q] == pytest.approx([x for q in transits for x in q], abs=1e-6)
    straight = (MoveKind.APPROACH, MoveKind.PICK, MoveKind.LIFT, MoveKind.RETREAT)
    ends = [m.path[-1].q for s in PLAN.steps for m in s.moves if m.kind in straight]
    assert [x for q in lists(text, "movel") for x in q] == pytest.approx([x for q in ends for x in q], abs=1e-6)
    assert len(lists(text, "insert")) == len(PLAN.steps)


def test_speeds_and_accelerations_stay_below_the_caps() -> None:
    limits, text = PLAN.cell.limits, urscript(PLAN)
    for a, v in re.findall(r"movej\(.*a=([\d.]+), v=([\d.]+)", text):
        assert float(a) <= limits.joint_acceleration_rad_s2 + 1e-6 and float(v) <= limits.joint_speed_rad_s + 1e-6
    for a, v in re.findall(r"movel\(.*a=([\d.]+), v=([\d.]+)", text):
        assert float(a) <= limits.transfer_acceleration_m_s2 and float(v) <= limits.approach_speed_m_s


def test_blends_never_overlap() -> None:
    text = urscript(PLAN)
    radii = [float(r) for r in re.findall(r"movej\(.*r=([\d.]+)\)", text)]
    ends = 0
    for step in PLAN.steps:
        for move in step.moves:
            if move.kind is MoveKind.TRANSIT:
                ends += len(move.path) - 1
                assert radii[ends - 1] == 0.0
                for w in range(1, len(move.path) - 1):
                    r = radii[ends - len(move.path) + w]
                    following = radii[ends - len(move.path) + w + 1]
                    assert r + following <= math.dist(move.path[w].tcp[:3], move.path[w + 1].tcp[:3]) + 1e-6


def test_names_cannot_smuggle_code_into_the_program() -> None:
    step = replace(PLAN.steps[0], part='x")\nhalt #')
    cell = replace(PLAN.cell, name='a"\nset_tcp(p[0,0,0,0,0,0])')
    text = urscript(replace(PLAN, steps=(step, *PLAN.steps[1:]), cell=cell))
    blocks(text)
    assert len(re.findall(r"^\s+set_tcp", text, re.M)) == 1
    assert text.count("\n    halt") == urscript(PLAN).count("\n    halt")


def test_unsound_plan_is_not_exported(tmp_path: Path) -> None:
    move = PLAN.steps[0].moves[0]
    steps = (replace(PLAN.steps[0], moves=(replace(move, speed_m_s=1.0), *PLAN.steps[0].moves[1:])),)
    unsound: Plan = replace(PLAN, steps=steps)
    write_plan(unsound, tmp_path / "plan.json")
    with pytest.raises(InputError, match="speed_m_s is 1"):
        export_urscript(tmp_path / "plan.json", tmp_path / "build.script")
    assert not (tmp_path / "build.script").exists()


class Halted(Exception):
    """The program called `fail` or `halt`."""


class Interpreter:
    """URScript as this package writes it, run as Python: a simulated arm that goes where it is told, and its world.

    The programs indent as Python does, so that translating them takes little: blocks lose their `end`, `global`
    declarations are repeated in every function, threads run whenever the program waits.
    """

    STEP_S = 0.002

    def __init__(
        self,
        plan: Plan,
        *,
        jams: bool = False,
        missing: bool = False,
        knocked: float = 0.0,
        drops_after: int = 10**9,
        drift: tuple[float, float, float] = (0.0, 0.0, 0.0),
        acknowledges: bool = True,
    ) -> None:
        self.drift, self.acknowledges, self.unread = drift, acknowledges, 0
        self.plan, self.jams, self.missing, self.knocked = plan, jams, missing, knocked
        self.q = list(plan.first_waypoint.q)
        self.tcp = list(plan.first_waypoint.tcp)
        self.joints: list[list[float]] = []
        self.said: list[str] = []
        self.payloads: list[float] = []
        self.push: tuple[list[float], float] | None = None
        self.felt, self.gripper, self.stopped, self.threads = 0.0, 0, False, []
        self.output, self.switched, self.drops_after = False, [], drops_after
        self.ends = [m.path[-1] for st in plan.steps for m in st.moves if m.kind is MoveKind.INSERT]

    def translated(self, text: str) -> str:
        names = sorted(set(re.findall(r"global (\w+) =", text)))
        out = []
        for line in text.splitlines():
            bare = line.strip()
            indent = line[: len(line) - len(line.lstrip())]
            if bare == "end":
                continue
            if bare == "halt":
                bare = "halt()"
            bare = re.sub(r"^global (\w+) =", r"\1 =", bare)
            bare = re.sub(r"\bp\[", "[", bare)
            bare = re.sub(r"= run (\w+)\(\)", r"= run(\1)", bare)
            opens = re.match(r"(?:def|thread) (\w+)(\(.*\)):", bare)
            if opens:
                generator = bare.startswith("thread")
                out += [f"{indent}def {opens[1]}{opens[2]}:", f"{indent}  global {', '.join(names)}"]
                self.in_thread = generator
                continue
            if bare == "sync()" and getattr(self, "in_thread", False):
                bare, self.in_thread = "yield", False
            out.append(indent + bare)
        return "\n".join([*out, "mocca_build()"])

    def run(self) -> None:
        names = {n[3:]: getattr(self, n) for n in dir(self) if n.startswith("do_")}
        exec(compile(self.translated(urscript(self.plan)), "build.script", "exec"), names)

    def tick(self) -> None:
        for thread in self.threads:
            next(thread)

    def do_sync(self) -> None:
        if self.push is not None and not self.jams:
            axis, speed = self.push
            end = self.ends[0].tcp
            left = sum((e - t) * a for e, t, a in zip(end, self.tcp, axis))
            if left > 0:
                self.tcp = [t + a * speed * self.STEP_S for t, a in zip(self.tcp, axis)] + self.tcp[3:]
            self.felt = 2.0 if left > 0 else 9.0
            self.tcp = [t + s for t, s in zip(self.tcp, self.drift)] + self.tcp[3:]
        elif self.push is not None:
            self.felt = self.plan.cell.limits.push_force_n
        self.tick()

    def do_sleep(self, seconds: float) -> None:
        self.tick()

    def moved(self, q: list[float], seconds: int = 30) -> None:
        self.q = list(q)
        self.tcp = list(self.plan_pose(q))
        self.joints.append(list(q))
        self.felt = self.knocked
        for _ in range(seconds):
            self.tick()

    def plan_pose(self, q: list[float]) -> tuple[float, ...]:
        from mocca_robot.plan.arm_models import robot_model

        return robot_model(self.plan.robot).tcp_pose(q, self.plan.cell.tcp_offset)

    def do_movej(self, q: list[float], a: float, v: float, r: float) -> None:
        self.moved(q)

    def do_movel(self, q: list[float], a: float, v: float) -> None:
        self.moved(q)

    def do_force_mode(self, frame: list[float], free: list[int], wrench: list[float], kind: int, caps: object) -> None:
        assert (free, kind) == ([1, 1, 1, 0, 0, 0], 2) and 0 < wrench[2] <= self.plan.cell.limits.push_force_n
        from mocca_robot.plan.pose import rotation_matrix

        axis = rotation_matrix(frame[3:6])[:, 2]
        self.push = ([float(v) for v in axis], self.plan.cell.limits.insert_speed_m_s)

    def do_end_force_mode(self) -> None:
        assert self.push is not None
        self.push, self.felt = None, 0.0
        if not self.jams:
            self.ends.pop(0)

    def do_run(self, thread: object) -> None:
        self.threads.append(thread())  # type: ignore[operator]

    def do_popup(self, message: str, title: str = "", error: bool = False, blocking: bool = False) -> None:
        self.said.append(message)

    def do_halt(self) -> None:
        raise Halted(self.said[-1] if self.said else "")

    def do_textmsg(self, *words: object) -> None:
        self.said.append(" ".join(map(str, words)))

    def do_set_payload(self, mass: float, cog: list[float]) -> None:
        self.payloads.append(mass)

    def do_socket_read_byte_list(self, count: int, socket: str) -> list[int]:
        self.unread -= 1
        return [3, *b"ack"] if self.acknowledges else [0, 0, 0, 0]

    def do_get_tcp_force(self) -> list[float]:
        axis = self.push[0] if self.push is not None else [0.0, 0.0, 1.0]
        return [-self.felt * a for a in axis] + [0.0] * 3

    @staticmethod
    def do_pose_inv(pose: list[float]) -> list[float]:
        return list(pose_of(np.linalg.inv(transform(pose))))

    @staticmethod
    def do_pose_trans(a: list[float], b: list[float]) -> list[float]:
        return list(pose_of(transform(a) @ transform(b)))

    def do_socket_set_var(self, name: str, value: int, socket: str) -> None:
        self.unread += 1
        if name == "POS":
            held = round(255 * (1.0 - self.plan.steps[0].grasp.width_m / 0.085))
            self.stopped = value > held and not self.missing
            self.gripper = held if self.stopped else value

    def do_socket_get_var(self, name: str, socket: str) -> int:
        assert self.unread == 0, "an acknowledgement would be read as the answer"
        return self.gripper if name == "POS" else 2 if self.stopped else 3

    def do_set_standard_digital_out(self, number: int, on: bool) -> None:
        assert number == 3
        self.output = on
        self.switched.append((on, len(self.joints)))

    def do_get_standard_digital_out(self, number: int) -> bool:
        return self.output

    def do_get_configurable_digital_in(self, number: int) -> bool:
        assert number == 1
        return self.output and not self.missing and len(self.joints) - self.switched[-1][1] < self.drops_after

    do_socket_open = staticmethod(lambda *a: True)
    do_stopl = do_set_tcp = do_zero_ftsensor = staticmethod(lambda *a: None)
    do_norm, do_sqrt = staticmethod(abs), staticmethod(math.sqrt)
    do_force_mode_set_damping = do_force_mode_set_gain_scaling = staticmethod(lambda *a: None)
    do_get_steptime = staticmethod(lambda: Interpreter.STEP_S)

    def do_force(self) -> float:
        return self.felt

    def do_get_actual_tcp_pose(self) -> list[float]:
        return list(self.tcp)

    def do_get_actual_joint_positions(self) -> list[float]:
        return list(self.q)


def test_the_program_runs_by_itself_and_places_every_part() -> None:
    robot = Interpreter(PLAN)
    robot.run()
    assert robot.said[-1] == "2 parts are placed." and robot.ends == []
    last = PLAN.steps[-1].moves[-1].path[-1]
    assert robot.q == pytest.approx(last.q, abs=1e-6)
    tool, part = PLAN.cell.tool_mass_kg, PLAN.steps[0].grasp.mass_kg
    assert robot.payloads == pytest.approx([tool, *[tool + part, tool] * 2])


@pytest.mark.parametrize(
    ("world", "words"),
    [
        ({"jams": True}, "The insertion failed"),
        ({"drift": (3e-5, 0.0, 0.0)}, "The insertion failed"),
        ({"acknowledges": False}, "The gripper does not acknowledge"),
        ({"missing": True}, "Part p01 is not between the fingers"),
        ({"knocked": 25.0}, "force limit exceeded"),
    ],
)
def test_the_program_halts_with_its_reason(world: dict[str, object], words: str) -> None:
    robot = Interpreter(PLAN, **world)  # type: ignore[arg-type]
    with pytest.raises(Halted, match=words):
        robot.run()
    assert not any("placed" in w for w in robot.said)


@pytest.mark.parametrize(
    ("world", "words"),
    [
        ({"jams": True}, "The part jammed."),
        ({"drift": (3e-5, 0.0, 0.0)}, "The part went sideways."),
        ({"drift": (4e-6, 0.0, 0.0)}, "The part is in, but beside its place."),
        ({"drift": (0.0, 0.0, 3e-5)}, "The part is not where it was thought to be."),
        ({"drift": (0.0, 0.0, 1.8e-5)}, "The part jammed."),
    ],
)
def test_the_program_says_why_an_insertion_failed(world: dict[str, object], words: str) -> None:
    robot = Interpreter(PLAN, **world)  # type: ignore[arg-type]
    with pytest.raises(Halted):
        robot.run()
    assert robot.said[-2] == words


def test_the_program_does_not_start_from_elsewhere() -> None:
    robot = Interpreter(PLAN)
    robot.q[3] += 0.02
    with pytest.raises(Halted, match="does not stand at the first waypoint"):
        robot.run()
    assert robot.joints == []


def test_a_suction_cup_is_not_driven_by_guesswork() -> None:
    with pytest.raises(InputError, match="does not say how its suction cup is wired"):
        urscript(replace(PLAN, gripper="suction"))


def test_a_suction_cup_is_switched_at_pick_and_release_only() -> None:
    plan = suction_plan(2)
    robot = Interpreter(plan)
    robot.run()
    assert robot.said[-1] == "2 parts are placed." and robot.ends == []
    assert [on for on, _ in robot.switched] == [True, False] * 2
    assert robot.payloads[0] < robot.payloads[1] > robot.payloads[2]


@pytest.mark.parametrize(
    ("world", "words"), [({"missing": True}, "not on the cup: no vacuum"), ({"drops_after": 1}, "the part was lost")]
)
def test_a_halt_of_the_program_leaves_the_vacuum_on(world: dict[str, object], words: str) -> None:
    robot = Interpreter(suction_plan(1), **world)  # type: ignore[arg-type]
    with pytest.raises(Halted, match=words):
        robot.run()
    assert robot.output and [on for on, _ in robot.switched] == [True]


def test_a_program_does_not_start_with_the_vacuum_on() -> None:
    robot = Interpreter(suction_plan(1))
    robot.output = True
    with pytest.raises(Halted, match="The vacuum is on"):
        robot.run()
    assert robot.joints == [] and robot.output


def test_without_a_vacuum_switch_the_cup_is_given_its_time() -> None:
    plan = suction_plan(1)
    blind = replace(plan, cell=replace(plan.cell, vacuum=VacuumWiring("standard_3")))
    robot = Interpreter(blind)
    robot.run()
    assert [on for on, _ in robot.switched] == [True, False]
    assert "digital_in" not in urscript(blind)
