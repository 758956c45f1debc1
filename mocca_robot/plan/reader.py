"""Reading `plan.json`: a well-formed plan, or an error that names step, move, waypoint and key."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from mocca_robot.errors import InputError, nearest
from mocca_robot.files.documents import read_text
from mocca_robot.files.versions import PLAN
from mocca_robot.plan.arm_models import robot_model
from mocca_robot.plan.gripper import FINGERS
from mocca_robot.plan.hand import disorder
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Cell, Grasp, Move, MoveKind, Plan, Step, Waypoint
from mocca_robot.plan.pose import Three, six, three
from mocca_robot.plan.wiring import DEFAULT_WAIT_S, SIGNALS, WAIT_S, FingerWiring, VacuumWiring

GRIPPERS = (*FINGERS, "digital", "suction", "none")


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes: how a plan names the design it was made for."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_plan(path: Path | str, design: Path | str | None = None) -> Plan:
    """Return the plan in `path`, well-formed but not yet judged (`safety.findings` does that).

    With `design`, or when the plan names one that lies beside it, the design's bytes must still have the hash that
    the plan was made for. InputError names the key, step, move and waypoint of whatever cannot be read.
    """
    path = Path(path)
    try:
        raw = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"{path} is not JSON (line {error.lineno}: {error.msg}). Plan again.") from error
    except (ValueError, RecursionError) as error:  # integers of thousands of digits, endless nesting
        raise InputError(f"{path} cannot be a plan: {error}. Plan again.") from error
    plan = plan_from_document(raw, str(path))
    beside = path.parent / plan.design if plan.design else None
    source = Path(design) if design is not None else (beside if beside is not None and beside.is_file() else None)
    if source is not None:
        if not source.is_file():
            raise InputError(f"The design {source} does not exist. Give the design.json that {path} was planned from.")
        found = file_sha256(source)
        if found != plan.design_sha256:
            raise InputError(
                f"{path} was planned for a design with SHA-256 {plan.design_sha256[:12]}…, but {source} has "
                f"{found[:12]}…: the design was altered since. Plan again from the present design."
            )
    return plan


def plan_from_document(raw: object, source: str = "plan") -> Plan:
    """Return the plan in parsed JSON; InputError names the key and where it stands."""
    top, _ = PLAN.current(_mapping(raw, source), source)
    if top.get("units", "m") != "m":
        raise InputError(f"{source}: 'units' is {top['units']!r}; plans are in metres. Plan again.")
    gripper = _text(top, "gripper", source)
    if gripper not in GRIPPERS:
        raise InputError(f"{source}: unknown gripper '{gripper}'; {nearest(gripper, GRIPPERS)}")
    steps = _list(top, "steps", source)
    if not steps:
        raise InputError(f"{source}: the plan has no steps. Plan an assembly with at least one free part.")
    supports = _names(top, "supports", source)
    model = robot_model(_text(top, "robot", source), source)
    return Plan(
        design_sha256=_text(top, "design_sha256", source),
        robot=model.name,
        gripper=gripper,
        cell=_cell(_mapping(top.get("cell"), f"{source}: cell"), f"{source}: cell", model.contact_force_n),
        steps=tuple(_step(_mapping(s, f"{source}: step {i}"), f"{source}: step {i}") for i, s in enumerate(steps)),
        design=_text(top, "design", source) if "design" in top else None,
        supports=supports,
        cradles=_cradles(top, supports, source),
    )


def _names(top: Mapping[str, Any], key: str, where: str) -> tuple[str, ...]:
    return tuple(_text({key: name}, key, where) for name in _sequence(top.get(key, []), f"{where}: '{key}'"))


def _cradles(top: Mapping[str, Any], supports: Collection[str], where: str) -> tuple[str, ...]:
    cradles = _names(top, "cradles", where)
    for name in cradles:
        if name not in supports:
            raise InputError(f"{where}: '{name}' lies in a cradle but is not among the 'supports'. Plan again.")
    return cradles


def _cell(raw: Mapping[str, Any], where: str, contact_n: float) -> Cell:
    box = _list(raw, "workspace_m", where)
    if len(box) != 2:
        raise InputError(f"{where}: 'workspace_m' has {len(box)} corners; give the low and the high one.")
    stroke = _numbers(raw.get("gripper_stroke_m", [0.0, 0.085]), 2, f"{where}: gripper_stroke_m")
    return Cell(
        name=_text(raw, "name", where),
        serial=_text(raw, "serial", where) if raw.get("serial") is not None else None,
        tcp_offset=six(_numbers(raw.get("tcp_offset"), 6, f"{where}: tcp_offset")),
        tool_mass_kg=_number(raw, "tool_mass_kg", where, 0.0),
        tool_cog_m=three(_numbers(raw.get("tool_cog_m", [0, 0, 0]), 3, f"{where}: tool_cog_m")),
        gripper_stroke_m=(stroke[0], stroke[1]),
        workspace_m=(
            three(_numbers(box[0], 3, f"{where}: workspace_m[0]")),
            three(_numbers(box[1], 3, f"{where}: workspace_m[1]")),
        ),
        limits=MotionLimits().lowered(_mapping(raw.get("limits", {}), f"{where}: limits"), where, contact_n),
        extra=_rest(raw, Cell),
        description=_mapping(raw.get("description", {}), f"{where}: description"),
        vacuum=_vacuum(raw["vacuum"], f"{where}: vacuum") if raw.get("vacuum") is not None else None,
        fingers=_fingers(raw["fingers"], f"{where}: fingers") if raw.get("fingers") is not None else None,
        gripper_address=_text(raw, "gripper_address", where) if "gripper_address" in raw else "",
    )


def _vacuum(value: object, where: str) -> VacuumWiring:
    raw = _mapping(value, where)
    output, switch = _signal(raw, "output", where), raw.get("input")
    return VacuumWiring(output, None if switch is None else _signal(raw, "input", where), _wait(raw, where))


def _wait(raw: Mapping[str, Any], where: str) -> float:
    wait = _number(raw, "wait_s", where, DEFAULT_WAIT_S)
    if not WAIT_S[0] <= wait <= WAIT_S[1]:
        raise InputError(f"{where}: wait_s is {wait:g}, limit {WAIT_S[0]:g} to {WAIT_S[1]:g}. Plan again.")
    return wait


def _fingers(value: object, where: str) -> FingerWiring:
    raw = _mapping(value, where)
    names = ("open_output", "open_input", "held_input")
    more = {name: _signal(raw, name, where) for name in names if raw.get(name) is not None}
    return FingerWiring(close_output=_signal(raw, "close_output", where), wait_s=_wait(raw, where), **more)


def _signal(raw: Mapping[str, Any], key: str, where: str) -> str:
    name = _text(raw, key, where)
    if name not in SIGNALS:
        raise InputError(f"{where}: {key} is '{name}'; {nearest(name, SIGNALS)}")
    return name


def _step(raw: Mapping[str, Any], where: str) -> Step:
    part = _text(raw, "part", where)
    where = f"{where} ({part})"
    grasp = _mapping(raw.get("grasp"), f"{where}: grasp")
    moves, motion = _list(raw, "moves", where), grasp.get("tray_motion")
    if not moves:
        raise InputError(f"{where}: no moves. Plan this part again.")
    direction: Three | None = None
    alpha = 0.0
    if "insertion" in raw:
        insertion = _mapping(raw["insertion"], f"{where}: insertion")
        direction = three(_numbers(insertion.get("direction"), 3, f"{where}: insertion direction"))
        alpha = math.radians(_number(insertion, "alpha_deg", f"{where}: insertion"))
    step = Step(
        part=part,
        grasp=Grasp(
            width_m=_number(grasp, "width_m", f"{where}: grasp"),
            mass_kg=_number(grasp, "mass_kg", f"{where}: grasp"),
            cog_m=three(_numbers(grasp.get("cog_m", [0, 0, 0]), 3, f"{where}: grasp cog_m")),
            force_n=_number(grasp, "force_n", f"{where}: grasp", 20.0),
            tray_motion=None if motion is None else six(_numbers(motion, 6, f"{where}: grasp tray_motion")),
            extra=_rest(grasp, Grasp),
        ),
        moves=tuple(_move(_mapping(m, f"{where}, move {k}"), f"{where}, move {k}") for k, m in enumerate(moves)),
        direction=direction,
        alpha_rad=alpha,
    )
    if words := disorder(step):
        raise InputError(f"{where}, {words}. Plan this part again.")
    return step


def _move(raw: Mapping[str, Any], where: str) -> Move:
    kind = _text(raw, "kind", where)
    if kind not in set(MoveKind):
        raise InputError(f"{where}: unknown kind '{kind}'; {nearest(kind, MoveKind)}")
    where = f"{where} ({kind})"
    return Move(
        kind=MoveKind(kind),
        path=_path(_list(raw, "path", where), where),
        speed_m_s=_number(raw, "speed_m_s", where),
        force_limit_n=_number(raw, "force_limit_n", where),
        gripper_m=_number(raw, "gripper_m", where),
        alternatives=tuple(
            _path(_sequence(p, f"{where}: alternative {a}"), f"{where}, alternative {a}")
            for a, p in enumerate(_sequence(raw.get("alternatives", []), f"{where}: alternatives"))
        ),
    )


def _path(raw: Sequence[Any], where: str) -> tuple[Waypoint, ...]:
    if not raw:
        raise InputError(f"{where}: the path is empty. Plan this part again.")
    out = []
    for w, entry in enumerate(raw):
        here = f"{where}, waypoint {w}"
        item = _mapping(entry, here)
        q, tcp = _numbers(item.get("q"), 6, f"{here}: q"), _numbers(item.get("tcp"), 6, f"{here}: tcp")
        out.append(Waypoint(_number(item, "t", here), six(q), six(tcp)))
    return tuple(out)


def _rest(raw: Mapping[str, Any], known: type[Cell] | type[Grasp]) -> dict[str, Any]:
    """Return the keys that mean nothing here: the planner's own, kept for others to read."""
    names = {f.name for f in fields(known)}
    return {key: value for key, value in raw.items() if key not in names}


def _mapping(value: object, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} is {_short(value)}, not an object. Plan again.")
    return value


def _sequence(value: object, where: str) -> Sequence[Any]:
    if not isinstance(value, list):
        raise InputError(f"{where} is {_short(value)}, not a list. Plan again.")
    return value


def _list(raw: Mapping[str, Any], key: str, where: str) -> Sequence[Any]:
    return _sequence(raw.get(key), f"{where}: '{key}'")


def _text(raw: Mapping[str, Any], key: str, where: str) -> str:
    value = raw.get(key)
    if not isinstance(value, str) or not value:
        raise InputError(f"{where}: '{key}' is {_short(value)}, not a text. Plan again.")
    return value


def _number(raw: Mapping[str, Any], key: str, where: str, default: float | None = None) -> float:
    return _numbers([raw.get(key, default)], 1, f"{where}: {key}")[0]


def _numbers(value: object, count: int, where: str) -> list[float]:
    if not isinstance(value, list) or len(value) != count:
        size = f"{len(value)} numbers" if isinstance(value, list) else _short(value)
        remedy = "x, y, z, rx, ry, rz or six joint angles" if count == 6 else f"exactly {count}"
        raise InputError(f"{where} has {size}; {count} are needed ({remedy}). Plan again.")
    for v in value:
        if isinstance(v, bool) or not isinstance(v, int | float) or not -1e300 < v < 1e300:
            raise InputError(f"{where} holds {_short(v)}, not a finite number. Plan again.")
    return [float(v) for v in value]


def _short(value: object) -> str:
    text = "missing" if value is None else repr(value)
    return text if len(text) <= 40 else text[:37] + "…"
