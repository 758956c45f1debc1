"""The robot cell as planning needs it: arm, gripper with its shape, table, where to build, where the tray stands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.assembly import Array, read_only
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.documents import parse_yaml, read_text
from mocca_robot.ur.limits import Limits
from mocca_robot.ur.models import RobotModel, robot_model
from mocca_robot.ur.plan import Cell, Plan
from mocca_robot.ur.plan_reader import GRIPPERS
from mocca_robot.ur.pose import Six, six, three


@dataclass(frozen=True, eq=False)
class Gripper:
    """A parallel gripper that closes along y of the flange's frame.

    Attributes:
        tcp_offset: the point between the pads, flange frame.
        stroke_m: smallest and largest opening.
        palm_m: (2, 3) corners of the box around the hand, flange frame.
        finger_m: (2, 3) corners of the box around one finger, pads left out, when closed; the other mirrors it in y.
        pad_radius_m: of the pads, which touch each other when closed; a part must cover them.
        opening_m: how much wider than the part the fingers open before and after the grasp.
    """

    name: str
    tcp_offset: Six
    mass_kg: float
    cog_m: tuple[float, float, float]
    stroke_m: tuple[float, float]
    palm_m: Array
    finger_m: Array
    pad_radius_m: float
    opening_m: float
    force_n: float


@dataclass(frozen=True, eq=False)
class RobotCell:
    """A cell; all lengths in metres, in the robot's base frame.

    Attributes:
        table_m, workspace_m: (2, 3) corners of boxes.
        build_origin_m: (3,), the point of the table below the middle of the structure.
        build_yaw_rad: turn of the structure about z.
        build_size_m: longest side of the structure after scaling; None keeps the design's own size.
        thickness_m: of flat parts; None keeps the design's.
        tray_m: (2, 2) corners of the tray in the horizontal; parts stand `nest_m` above the table, `gap_m` apart.
        home: joint angles (6,) where a build begins and ends.
        document: the file's content, from which a plan lets the cell be read again.
    """

    name: str
    serial: str | None
    model: RobotModel
    gripper: Gripper
    table_m: Array
    workspace_m: Array
    build_origin_m: Array
    build_yaw_rad: float
    build_size_m: float | None
    thickness_m: float | None
    tray_m: Array
    nest_m: float
    gap_m: float
    home: Array
    limits: Limits
    document: Mapping[str, Any] = field(default_factory=dict)

    @property
    def execution(self) -> Cell:
        """Return what a plan records about the cell: what execution obeys, and the whole description beside it."""
        build = {**self.document.get("build", {}), "size_m": self.build_size_m, "thickness_m": self.thickness_m}
        return Cell(
            name=self.name,
            tcp_offset=self.gripper.tcp_offset,
            workspace_m=(three(self.workspace_m[0]), three(self.workspace_m[1])),
            tool_mass_kg=self.gripper.mass_kg,
            tool_cog_m=self.gripper.cog_m,
            gripper_stroke_m=self.gripper.stroke_m,
            serial=self.serial,
            limits=self.limits,
            extra={
                "table_m": self.table_m.tolist(),
                "tray_m": self.tray_m.tolist(),
                "description": {**self.document, "build": build},
            },
        )


_KEYS = ("name", "serial", "robot", "gripper", "table_m", "workspace_m", "build", "tray", "home_deg", "limits")
_GRIPPER_KEYS = (
    *("name", "tcp_offset_m", "mass_kg", "cog_m", "stroke_m", "palm_m", "finger_m", "pad_radius_m"),
    *("opening_m", "force_n"),
)


def read_cell(path: Path | str) -> RobotCell:
    """Return the cell that a YAML file describes; InputError names the key, its value and what it has to be."""
    path = Path(path)
    return cell_from_document(parse_yaml(read_text(path), str(path)), str(path))


def cell_of(plan: Plan) -> RobotCell:
    """Return the cell that `plan` was made for, from the plan alone; InputError for a plan that does not record it."""
    raw = plan.cell.extra.get("description")
    if not isinstance(raw, dict):
        raise InputError(f"The plan does not describe its cell '{plan.cell.name}'. Plan again with this version.")
    return cell_from_document(raw, "plan: cell.description")


def cell_from_document(content: object, where: str) -> RobotCell:
    """Return the cell that a parsed file describes; `where` names it in errors."""
    raw = fields.mapping(content, where, _KEYS)
    build = fields.mapping(
        _needed(raw, "build", where), f"{where}: build", ("origin_m", "yaw_deg", "size_m", "thickness_m")
    )
    tray = fields.mapping(_needed(raw, "tray", where), f"{where}: tray", ("low_m", "high_m", "nest_m", "gap_m"))
    model = robot_model(str(_needed(raw, "robot", where)))
    return RobotCell(
        name=fields.part_name(_needed(raw, "name", where), f"{where}: name"),
        serial=fields.part_name(raw["serial"], f"{where}: serial") if raw.get("serial") is not None else None,
        model=model,
        gripper=_gripper(
            fields.mapping(_needed(raw, "gripper", where), f"{where}: gripper", _GRIPPER_KEYS), f"{where}: gripper"
        ),
        table_m=_box(_needed(raw, "table_m", where), f"{where}: table_m", 3),
        workspace_m=_box(_needed(raw, "workspace_m", where), f"{where}: workspace_m", 3),
        build_origin_m=fields.vector(_needed(build, "origin_m", where), f"{where}: build.origin_m", (3,)),
        build_yaw_rad=float(np.deg2rad(fields.number(build.get("yaw_deg", 0.0), f"{where}: build.yaw_deg"))),
        build_size_m=_optional(build, "size_m", f"{where}: build"),
        thickness_m=_optional(build, "thickness_m", f"{where}: build"),
        tray_m=_box([_needed(tray, "low_m", where), _needed(tray, "high_m", where)], f"{where}: tray", 2),
        nest_m=fields.number(tray.get("nest_m", 0.015), f"{where}: tray.nest_m", 0.0, 0.2),
        gap_m=fields.number(tray.get("gap_m", 0.045), f"{where}: tray.gap_m", 0.0, 1.0),
        home=read_only(np.deg2rad(fields.vector(_needed(raw, "home_deg", where), f"{where}: home_deg", (6,)))),
        limits=Limits().lowered(fields.mapping(raw.get("limits", {}), f"{where}: limits")),
        document=raw,
    )


def _gripper(raw: dict[str, Any], where: str) -> Gripper:
    stroke = fields.vector(_needed(raw, "stroke_m", where), f"{where}.stroke_m", (2,))
    if not 0.0 <= stroke[0] < stroke[1]:
        raise InputError(f"{where}.stroke_m is {stroke.tolist()}; give the smallest opening, then the largest.")
    offset = fields.vector(_needed(raw, "tcp_offset_m", where), f"{where}.tcp_offset_m", (3,))
    return Gripper(
        name=fields.choice(raw.get("name", "2f85"), GRIPPERS, f"{where}.name"),
        tcp_offset=six([*offset, 0.0, 0.0, 0.0]),
        mass_kg=fields.number(_needed(raw, "mass_kg", where), f"{where}.mass_kg", 0.0, 30.0),
        cog_m=three(fields.vector(raw.get("cog_m", [0, 0, 0]), f"{where}.cog_m", (3,))),
        stroke_m=(float(stroke[0]), float(stroke[1])),
        palm_m=_box(_needed(raw, "palm_m", where), f"{where}.palm_m", 3),
        finger_m=_box(_needed(raw, "finger_m", where), f"{where}.finger_m", 3),
        pad_radius_m=fields.number(raw.get("pad_radius_m", 0.006), f"{where}.pad_radius_m", 0.0, 0.1),
        opening_m=fields.number(raw.get("opening_m", 0.012), f"{where}.opening_m", 0.002, 0.1),
        force_n=fields.number(raw.get("force_n", 20.0), f"{where}.force_n", 1.0, 235.0),
    )


def _needed(raw: dict[str, Any], key: str, where: str) -> Any:
    if raw.get(key) is None:
        raise InputError(f"{where} has no '{key}'; compare it with configs/cells/ur5e_2f85.yaml.")
    return raw[key]


def _optional(raw: dict[str, Any], key: str, where: str) -> float | None:
    return None if raw.get(key) is None else fields.number(raw[key], f"{where}.{key}", above=0.0, high=10.0)


def _box(value: object, where: str, d: int) -> Array:
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{where} must be two corners, [low, high], not {fields.shown(value)}.")
    low, high = (fields.vector(v, f"{where}[{k}]", (d,)) for k, v in enumerate(value))
    if not (low < high).all():
        raise InputError(f"{where} is {fields.shown(value)}; the low corner must lie below the high one on every axis.")
    return read_only([low, high])
