"""Plans: what is read is what was written, every altered figure changes the hash, and everything unsafe is refused."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ur_cell import small_plan

from mocca_robot.errors import InputError
from mocca_robot.plan.dry_run import dry_run
from mocca_robot.plan.limits import COUNTS, HARD_CAPS, NUMBERS, RAISABLE, MotionLimits
from mocca_robot.plan.plan import document, write_plan
from mocca_robot.plan.reader import file_sha256, plan_from_document, read_plan
from mocca_robot.plan.safety import findings, require_sound

PLAN = small_plan(2)
DOCUMENT = document(PLAN)
Edit = Callable[[dict[str, Any]], None]


def edited(edit: Edit) -> dict[str, Any]:
    out = copy.deepcopy(DOCUMENT)
    edit(out)
    return out


def point(raw: dict[str, Any], step: int, move: int, waypoint: int) -> dict[str, Any]:
    found: dict[str, Any] = raw["steps"][step]["moves"][move]["path"][waypoint]
    return found


def test_plan_survives_its_file(tmp_path: Path) -> None:
    write_plan(PLAN, tmp_path / "plan.json")
    again = read_plan(tmp_path / "plan.json")
    assert again.sha256 == PLAN.sha256
    assert document(again) == DOCUMENT


def test_what_only_the_planner_understands_is_kept_and_hashed() -> None:
    def edit(raw: dict[str, Any]) -> None:
        raw["cell"]["tray"] = {"columns": 3}
        raw["steps"][0]["grasp"]["face"] = 4

    raw = edited(edit)
    plan = plan_from_document(raw)
    assert document(plan) == raw
    assert plan.sha256 != PLAN.sha256


def test_sound_plan_has_no_findings_and_its_dry_run_shows_every_waypoint() -> None:
    result = dry_run(PLAN)
    paths = [p for s in PLAN.steps for m in s.moves for p in (m.path, *m.alternatives)]
    assert result.findings == ()
    assert len(result.rows) == sum(len(p) for p in paths)
    assert all(math.isfinite(v) for r in result.rows for v in (*r.q, *r.tcp, r.speed_m_s))
    assert max(r.speed_m_s for r in result.rows) <= MotionLimits().transfer_speed_m_s
    lines = result.text().splitlines()
    assert sum(" tcp " in line for line in lines) == len(result.rows)
    assert json.loads(json.dumps(result.document()))["findings"] == []


@pytest.mark.parametrize("value", [1e-9, -1e-9])
@pytest.mark.parametrize("where", ["q", "tcp", "t", "speed", "gripper", "force", "mass", "limits"])
def test_any_altered_figure_changes_the_hash(where: str, value: float) -> None:
    def edit(raw: dict[str, Any]) -> None:
        move = raw["steps"][1]["moves"][2]
        if where in ("q", "tcp"):
            move["path"][3][where][4] += value
        elif where == "t":
            move["path"][3]["t"] += value
        elif where == "mass":
            raw["steps"][0]["grasp"]["mass_kg"] += value
        elif where == "limits":
            raw["cell"]["limits"]["push_force_n"] = 9.0 + value
        else:
            key = {"speed": "speed_m_s", "gripper": "gripper_m", "force": "force_limit_n"}[where]
            move[key] += value

    assert plan_from_document(edited(edit)).sha256 != PLAN.sha256


UNREADABLE: dict[str, tuple[Edit, str]] = {
    "nan": (lambda r: point(r, 1, 2, 3)["tcp"].__setitem__(0, math.nan), r"step 1 \(p02\), move 2.*waypoint 3.*nan"),
    "infinite": (lambda r: point(r, 0, 0, 1)["q"].__setitem__(5, math.inf), r"step 0 .*move 0.*waypoint 1: q.*inf"),
    "five": (lambda r: point(r, 0, 1, 2)["tcp"].pop(), r"step 0 .*waypoint 2: tcp has 5 numbers; 6 are needed"),
    "text": (lambda r: point(r, 0, 1, 2).update(q="home"), r"waypoint 2: q has 'home'"),
    "kind": (lambda r: r["steps"][0]["moves"][0].update(kind="transitt"), "did you mean 'transit'"),
    "gripper": (
        lambda r: r.update(gripper="2f140"),
        "unknown gripper .2f140.; known: 2f85, digital, hande, none, rg2, rg6, suction",
    ),
    "version": (lambda r: r.update(version=2), "version 2 of mocca-robot/plan.*up to version 1.*Upgrade"),
    "no version": (lambda r: r.pop("version"), 'no "version".*plan again'),
    "format": (lambda r: r.update(format="mocca-robot/design"), 'it must be "mocca-robot/plan"'),
    "units": (lambda r: r.update(units="mm"), "'mm'; plans are in metres"),
    "empty": (lambda r: r.update(steps=[]), "no steps"),
    "no path": (lambda r: r["steps"][0]["moves"][0].update(path=[]), r"move 0 \(transit\): the path is empty"),
    "no mass": (lambda r: r["steps"][0]["grasp"].pop("mass_kg"), r"step 0 \(p01\): grasp: mass_kg.*missing"),
    "raised cap": (lambda r: r["cell"]["limits"].update(transfer_speed_m_s=1.0), "only lower"),
    "unknown cap": (lambda r: r["cell"]["limits"].update(push_force=1.0), "did you mean 'push_force_n'"),
    "no pick": (lambda r: r["steps"][0]["moves"].pop(2), r"step 0 \(p01\), move 2 \(lift\): the hand is empty"),
    "boolean": (lambda r: r["steps"][0]["moves"][0].update(speed_m_s=True), "speed_m_s holds True"),
}


@pytest.mark.parametrize("case", sorted(UNREADABLE))
def test_malformed_plan_is_refused_naming_the_place(case: str, tmp_path: Path) -> None:
    edit, words = UNREADABLE[case]
    (tmp_path / "plan.json").write_text(json.dumps(edited(edit)))
    with pytest.raises(InputError, match=words):
        read_plan(tmp_path / "plan.json")


def scale_pose(raw: dict[str, Any]) -> None:
    tcp = point(raw, 0, 1, 2)["tcp"]
    tcp[:3] = [1000 * v for v in tcp[:3]]


def swap_times(raw: dict[str, Any]) -> None:
    a, b = point(raw, 0, 0, 4), point(raw, 0, 0, 5)
    a["t"], b["t"] = b["t"], a["t"]


def hurry(raw: dict[str, Any]) -> None:
    for w in raw["steps"][0]["moves"][0]["path"]:
        w["t"] /= 3


def jerk(raw: dict[str, Any]) -> None:
    path = raw["steps"][0]["moves"][0]["path"]
    for k, w in enumerate(path):
        w["t"] = path[-1]["t"] * k / (len(path) - 1)
    path[1]["t"] = 0.02 * path[2]["t"]


UNSAFE: dict[str, tuple[Edit, str]] = {
    "millimetres": (scale_pose, r"step 0 \(p01\), move 1 \(approach\), waypoint 2.*divide by 1000"),
    "out of reach": (lambda r: point(r, 0, 0, 3)["tcp"].__setitem__(0, 1.4), r"waypoint 3.*reach 0\.85 m \(ur5e\)"),
    "pose without joints": (lambda r: point(r, 0, 0, 3)["tcp"].__setitem__(2, 0.3), "different places"),
    "joint beyond its limit": (lambda r: point(r, 0, 0, 3)["q"].__setitem__(5, 7.0), r"joint 5 is 7 rad.*6\.283"),
    "other arm": (lambda r: r.update(robot="ur10e"), "check robot model"),
    "time": (swap_times, r"move 0 \(transit\), waypoint 5: t is .* s, limit above"),
    "tool too fast": (hurry, r"speed of the tool is .* m/s, limit 0\.1 m/s"),
    "too sudden": (jerk, r"acceleration of the tool is .* m/s², limit 0\.5 m/s²"),
    "speed above cap": (lambda r: r["steps"][0]["moves"][1].update(speed_m_s=0.05), r"speed_m_s is 0\.05.*0\.02"),
    "force above cap": (lambda r: r["steps"][0]["moves"][1].update(force_limit_n=30.0), r"is 30, limit 0 to 25 N"),
    "gripper too narrow": (lambda r: r["steps"][0]["grasp"].update(width_m=0.1), r"100\.0 mm, limit 0 to 85 mm"),
    "opening too wide": (lambda r: r["steps"][0]["moves"][0].update(gripper_m=0.09), r"gripper_m is 0\.09"),
    "payload": (lambda r: r["steps"][1]["grasp"].update(mass_kg=4.5), r"step 1.*5\.4 kg, limit 0 to 5 kg \(ur5e\)"),
    "workspace": (
        lambda r: r["cell"].update(workspace_m=[[-0.8, -0.15, 0.0], [0.8, 0.8, 0.9]]),
        r"tcp y is -0\.1.*workspace",
    ),
    "missing move": (
        lambda r: r["steps"][0]["moves"].pop(1),
        r"move 1 \(pick\), waypoint 0: distance from the end of the move before is",
    ),
    "branch jump": (lambda r: point(r, 0, 0, 6)["q"].__setitem__(5, 3.0), r"waypoint 6: jump of joint 5 is .*0\.2 rad"),
    "cone": (
        lambda r: r["steps"][0]["insertion"].update(direction=[math.sin(0.3), 0.0, -math.cos(0.3)]),
        r"angle to the insertion direction is 17\.19°, limit 10\.00°",
    ),
    "alternative outside cone": (
        lambda r: r["steps"][0]["insertion"].update(alpha_deg=3.0),
        r"alternative 0: angle .* is 5\.73°, limit 3\.00°",
    ),
}


@pytest.mark.parametrize("case", sorted(UNSAFE))
def test_unsafe_plan_is_refused_with_place_value_limit_and_remedy(case: str) -> None:
    edit, words = UNSAFE[case]
    with pytest.raises(InputError, match=words) as refusal:
        require_sound(plan_from_document(edited(edit)))
    assert str(refusal.value).startswith("The plan is refused")


def test_plan_made_in_memory_with_nan_or_five_numbers_is_refused_too() -> None:
    move = PLAN.steps[0].moves[0]
    for bad in (replace(move.path[1], t=math.nan), replace(move.path[1], tcp=move.path[1].tcp[:5])):  # type: ignore[arg-type]
        moves = (replace(move, path=(move.path[0], bad, *move.path[2:])), *PLAN.steps[0].moves[1:])
        plan = replace(PLAN, steps=(replace(PLAN.steps[0], moves=moves),))
        assert any("waypoint 1" in str(f) for f in findings(plan))


def test_altered_design_is_refused(tmp_path: Path) -> None:
    design = tmp_path / "design.json"
    design.write_text("{}")
    plan = replace(PLAN, design_sha256=file_sha256(design), design="design.json")
    write_plan(plan, tmp_path / "plan.json")
    assert read_plan(tmp_path / "plan.json").sha256 == plan.sha256
    design.write_text('{"altered": true}')
    with pytest.raises(InputError, match=r"the design was altered since"):
        read_plan(tmp_path / "plan.json")
    with pytest.raises(InputError, match="does not exist"):
        read_plan(tmp_path / "plan.json", tmp_path / "elsewhere.json")


@pytest.mark.parametrize("name", sorted(NUMBERS))
def test_configuration_lowers_every_cap_and_raises_none(name: str) -> None:
    cap = getattr(HARD_CAPS, name)
    safer, riskier = (2 * cap, 0.5 * cap) if name == "watchdog_hz" else (0.9 * cap, 1.01 * cap + 1e-9)
    assert getattr(MotionLimits().lowered({name: safer}), name) == (int(safer) if name in COUNTS else safer)
    for bad in (riskier, math.nan, math.inf, -cap, "1", None, True):
        with pytest.raises(InputError, match=f"'{name}'"):
            MotionLimits().lowered({name: bad})


def test_lowered_cap_is_obeyed_by_the_checks() -> None:
    slow = replace(PLAN, cell=replace(PLAN.cell, limits=MotionLimits().lowered({"transfer_speed_m_s": 0.05})))
    assert any("0 to 0.05 m/s" in str(f) for f in findings(slow))


def test_contact_is_raised_only_by_somebody_who_says_so_and_the_dry_run_repeats_it() -> None:
    def raised(**limits: object) -> dict[str, Any]:
        return edited(lambda r: r["cell"]["limits"].update(limits))

    with pytest.raises(InputError, match=r"accepts up to 20: add 'accepted: WHO, WHY' beside it"):
        plan_from_document(raised(contact_force_n=9.0))
    plan = plan_from_document(raised(contact_force_n=9.0, accepted="R. Roe: the table shakes"))
    assert plan.cell.limits.contact_force_n == 9.0 and document(plan)["cell"]["limits"]["contact_force_n"] == 9.0
    assert plan_from_document(document(plan)) == plan
    assert "contact counts from 9 N, accepted by the lab: R. Roe: the table shakes" in dry_run(plan).text()
    for bad in ({"contact_force_n": 1.1 * RAISABLE["contact_force_n"]}, {"push_force_n": 11.0}):
        with pytest.raises(InputError, match="only lower"):
            plan_from_document(raised(**bad, accepted="R. Roe"))
    with pytest.raises(InputError, match="write who accepts"):
        plan_from_document(raised(contact_force_n=9.0, accepted=" "))


def test_a_larger_arm_has_a_coarser_sensor_and_nobody_has_to_accept_that() -> None:
    raw = edited(lambda r: (r.update(robot="ur10e"), r["cell"]["limits"].update(contact_force_n=8.0)))
    assert plan_from_document(raw).cell.limits.contact_force_n == 8.0
    raw["cell"]["limits"].clear()
    assert plan_from_document(raw).cell.limits.contact_force_n == 5.0  # a plan from before says nothing and keeps 5
