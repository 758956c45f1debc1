"""The robot cell as planning needs it: arm, gripper with its shape, table, where to build, where the tray stands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.config.keys import read_whole
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.documents import MAX_YAML_BYTES, parse_yaml, read_text
from mocca_robot.files.versions import CELL
from mocca_robot.plan.arm_models import RobotModel, robot_model
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Cell, Plan
from mocca_robot.plan.pose import six, three
from planners.robot.cell_keys import CELL_KEYS, EXAMPLE
from planners.robot.obstacles import CellBox, read_obstacles, require_clear
from planners.robot.tool import Gripper, ParallelGripper, SuctionGripper, read_gripper


@dataclass(frozen=True, eq=False)
class TrayPlace:
    """Where a part waits: the middle of its footprint `at_m` (2,), and the rotation vector `turn_rad` (3,) that turns
    it from how it will stand in the structure.
    """

    at_m: Array
    turn_rad: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotCell:
    """A cell; all lengths in metres, in the robot's base frame.

    Attributes:
        table_m, workspace_m: (2, 3) corners of boxes.
        build_origin_m: (3,), the point below the middle of the structure; above the table, a plinth carries it.
        build_yaw_rad: turn of the structure about z.
        places_m, yaws_rad: what planning may choose origin and turn from; no more than those two where they are given.
        build_size_m: longest side of the structure after scaling; None keeps the design's own size.
        thickness_m: of flat parts; None keeps the design's.
        supports: parts that something else holds once they are placed; `("all",)` for every part.
        cradles: parts that a cradle holds and brings to their place once they are let go; `("all",)` for every part.
        tray_m: (2, 2) corners of the tray in the horizontal; parts stand `nest_m` above the table, `gap_m` apart.
        tray_places: where parts wait, by name; empty when the layout is generated.
        obstacles: what else stands there.
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
    places_m: tuple[Array, ...]
    yaws_rad: tuple[float, ...]
    build_size_m: float | None
    thickness_m: float | None
    supports: tuple[str, ...]
    cradles: tuple[str, ...]
    tray_m: Array
    nest_m: float
    gap_m: float
    tray_places: Mapping[str, TrayPlace]
    obstacles: tuple[CellBox, ...]
    home: Array
    limits: MotionLimits
    document: Mapping[str, Any] = field(default_factory=dict)

    @property
    def execution(self) -> Cell:
        """Return what a plan records about the cell: what execution obeys, and the whole description beside it."""
        build = {
            **self.document.get("build", {}),
            "origin_m": self.build_origin_m.tolist(),
            "yaw_deg": float(np.rad2deg(self.build_yaw_rad)),
            "size_m": self.build_size_m,
            "thickness_m": self.thickness_m,
        }
        places = {
            name: {"at_m": place.at_m.tolist(), "turn_deg": np.rad2deg(place.turn_rad).tolist()}
            for name, place in self.tray_places.items()
        }
        tray = {**self.document.get("tray", {}), **({"parts": places} if places else {})}
        return Cell(
            name=self.name,
            tcp_offset=self.gripper.tcp_offset,
            workspace_m=(three(self.workspace_m[0]), three(self.workspace_m[1])),
            tool_mass_kg=self.gripper.mass_kg,
            tool_cog_m=self.gripper.cog_m,
            gripper_stroke_m=self.gripper.stroke_m,
            vacuum=self.gripper.wiring if isinstance(self.gripper, SuctionGripper) else None,
            fingers=self.gripper.fingers if isinstance(self.gripper, ParallelGripper) else None,
            gripper_address=self.gripper.address if isinstance(self.gripper, ParallelGripper) else "",
            serial=self.serial,
            limits=self.limits,
            description={**self.document, "build": build, "tray": tray},
        )


SMALLEST_RANGE_DEG = 10.0
AUTO_YAWS = 12
"""Turns of the structure that `yaw_deg: auto` chooses from."""


def read_cell(path: Path | str) -> RobotCell:
    """Return the cell that a YAML file describes; InputError names the key, its value and what it has to be."""
    path = Path(path)
    return cell_from_document(parse_yaml(read_text(path, MAX_YAML_BYTES), str(path)), str(path))


def cell_of(plan: Plan) -> RobotCell:
    """Return the cell that `plan` was made for, from the plan alone; InputError for a plan that does not record it."""
    if not plan.cell.description:
        raise InputError(f"The plan does not describe its cell '{plan.cell.name}'. Plan again with this version.")
    return cell_from_document(dict(plan.cell.description), "plan: cell.description")


def cell_from_document(content: object, where: str) -> RobotCell:
    """Return the cell that a parsed file describes; `where` names it in errors."""
    raw, _ = CELL.current(fields.mapping(content, where), where)
    top = read_whole(CELL_KEYS, raw, "", where, EXAMPLE)
    build = read_whole(CELL_KEYS, top["build"], "build", f"{where}: build", EXAMPLE)
    tray = read_whole(CELL_KEYS, top["tray"], "tray", f"{where}: tray", EXAMPLE)
    model = _ranged(robot_model(top["robot"]), top["joint_range_deg"], top["home_deg"], where)
    contact_n = model.contact_force_n
    places = _places(build["origin_m"], f"{where}: build.origin_m")
    yaws = _yaws(build["yaw_deg"], f"{where}: build.yaw_deg")
    obstacles = read_obstacles(top["obstacles"] or {}, f"{where}: obstacles")
    require_clear(obstacles, model, np.deg2rad(top["home_deg"]), f"{where}: obstacles")
    return RobotCell(
        name=top["name"],
        serial=top["serial"],
        model=model,
        gripper=read_gripper(top["gripper"], f"{where}: gripper"),
        table_m=top["table_m"],
        workspace_m=top["workspace_m"],
        build_origin_m=places[0],
        build_yaw_rad=yaws[0],
        places_m=places,
        yaws_rad=yaws,
        build_size_m=build["size_m"],
        thickness_m=build["thickness_m"],
        supports=build["supports"] or (),
        cradles=build["cradles"] or (),
        tray_m=fields.box([tray["low_m"].tolist(), tray["high_m"].tolist()], f"{where}: tray", 2),
        nest_m=tray["nest_m"],
        gap_m=tray["gap_m"],
        tray_places=_tray_places(tray["parts"] or {}, f"{where}: tray.parts"),
        obstacles=obstacles,
        home=read_only(np.deg2rad(top["home_deg"])),
        limits=replace(MotionLimits(), contact_force_n=contact_n).lowered(top["limits"], where, contact_n),
        document=raw,
    )


def _ranged(model: RobotModel, range_deg: Array, home_deg: Array, where: str) -> RobotModel:
    """Return the arm with joints that turn no farther than the cell's cables allow; home has to be within that."""
    allowed = np.minimum(np.rad2deg(model.joint_limit_rad), range_deg)
    for j, (most, home) in enumerate(zip(allowed, home_deg, strict=True)):
        if most < SMALLEST_RANGE_DEG:
            raise InputError(
                f"{where}: joint_range_deg allows joint {j} {most:g}°; at least {SMALLEST_RANGE_DEG:g}° are needed."
            )
        if abs(home) > most:
            raise InputError(f"{where}: home_deg turns joint {j} to {home:g}°, which may turn ±{most:g}° at most.")
    return replace(model, joint_limit_rad=six(np.deg2rad(allowed)))


def _places(value: object, where: str) -> tuple[Array, ...]:
    """Return one place or several to choose from."""
    several = value if isinstance(value, list) and value and isinstance(value[0], list) else [value]
    return tuple(read_only(fields.vector(v, where, (3,))) for v in several)


def _yaws(value: object, where: str) -> tuple[float, ...]:
    if value == "auto":
        return tuple(float(a) for a in np.arange(AUTO_YAWS) * (2 * np.pi / AUTO_YAWS))
    several = value if isinstance(value, list) and value else [value]
    return tuple(float(np.deg2rad(fields.number(v, where))) for v in several)


def _tray_places(value: object, where: str) -> dict[str, TrayPlace]:
    out = {}
    for name, entry in fields.mapping(value, where).items():
        here = f"{where}.{name}"
        raw = read_whole(CELL_KEYS, entry, "tray.parts.NAME", here, EXAMPLE)
        turn = np.zeros(3) if raw["turn_deg"] is None else np.deg2rad(raw["turn_deg"])
        if raw["yaw_deg"] is not None:
            if raw["turn_deg"] is not None:
                raise InputError(f"{here} has 'yaw_deg' and 'turn_deg'; give one: a yaw is a turn about [0, 0, 1].")
            turn = np.array([0.0, 0.0, np.deg2rad(raw["yaw_deg"])])
        out[fields.part_name(name, where)] = TrayPlace(raw["at_m"], read_only(turn))
    return out
