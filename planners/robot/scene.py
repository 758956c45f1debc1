"""Does the arm touch anything? Arm, gripper, table and parts as convex shapes in MuJoCo's collision detection.

Links are capsules around the published kinematics, thicker than the real ones; the gripper is boxes; parts are convex
pieces that cover them. Only geometry is used, no dynamics.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, IntArray
from planners.robot.arm_bodies import add_finger, add_links, add_obstacle, add_palm
from planners.robot.cell import RobotCell
from planners.robot.site import Site
from planners.robot.tool import ParallelGripper, SuctionGripper

SHORTEST_FINGER_M = 1e-4
"""Thinner slices of a finger are left out."""

CLEARANCE_M = 0.002
"""What arm, gripper and carried part keep from everything else."""
CUP_M = 0.02
"""Length of a bellows cup."""

_ARM, _FINGERS, _CARRIED, _SHOULDER = 1, 2, 4, 8


class CellScene:
    """A cell with its parts; `hit` answers for one configuration at a time. Holds a MuJoCo model, so: one thread."""

    def __init__(self, cell: RobotCell, site: Site, clearance_m: float = CLEARANCE_M) -> None:
        import mujoco

        self._mujoco = mujoco
        self._cell = cell
        self._clearance = clearance_m
        spec = mujoco.MjSpec()
        spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
        low, high = cell.table_m
        spec.worldbody.add_geom(
            name="table",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=0.5 * (low + high),
            size=0.5 * (high - low),
            contype=0,
            conaffinity=_ARM | _FINGERS | _CARRIED,
        )
        if site.plinth is not None:
            spec.worldbody.add_geom(
                name="plinth",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=0.5 * (site.plinth[0] + site.plinth[1]),
                size=0.5 * (site.plinth[1] - site.plinth[0]),
                contype=0,
                conaffinity=_ARM | _FINGERS | _CARRIED | _SHOULDER,
            )
        for obstacle in cell.obstacles:
            shoulder = 0 if obstacle.carries_base else _SHOULDER
            met = _ARM | _FINGERS | _CARRIED | shoulder
            add_obstacle(spec.worldbody, obstacle, contype=0, conaffinity=met)
        self._add_arm(spec)
        for body in site.bodies:
            node = spec.worldbody.add_body(name=f"part {body.name}")
            node.add_freejoint(name=f"part {body.name}")
            for k, piece in enumerate(body.pieces):
                name = f"part {body.name} {k}"
                spec.add_mesh(name=name, uservert=piece.ravel())
                node.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._flange = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, "flange")
        self._fingers = isinstance(cell.gripper, ParallelGripper)
        model = self.model
        self._geoms: dict[str, IntArray] = {}
        self._address: dict[str, int] = {}
        for body in site.bodies:
            index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"part {body.name}")
            self._geoms[body.name] = np.flatnonzero(model.geom_bodyid == index).astype(np.int64)
            self._address[body.name] = int(model.jnt_qposadr[model.body_jntadr[index]])
            self.place(body.name, np.eye(4))
        self.assign()

    def _add_arm(self, spec: Any) -> None:
        gripper = self._cell.gripper
        links, flange = add_links(spec.worldbody, self._cell.model)
        for k, link in enumerate(links):
            for shape in link.shapes:
                self._watch(shape, _SHOULDER if k == 0 else _ARM)
        self._watch(add_palm(flange, gripper), _ARM)
        hand = ["palm"]
        if isinstance(gripper, ParallelGripper):
            for side in ("left", "right"):
                finger = add_finger(flange, gripper, side)
                self._watch(finger.shape, _FINGERS)
                hand.append(finger.shape.name)
        else:
            hand += self._add_stem(flange, gripper)
        # The arm against itself: the hand and the wrist against shoulder, upper arm and forearm.
        names = [[shape.name for shape in link.shapes] for link in links]
        for first, second in (
            *((a, b) for k in (0, 1) for a in names[k] for j in (3, 4, 5) for b in names[j]),
            *((a, b) for k in (0, 1, 2) for a in names[k] for b in hand),
        ):
            spec.add_pair(geomname1=first, geomname2=second, margin=0.0)

    def _watch(self, shape: Any, kind: int) -> None:
        shape.contype, shape.conaffinity, shape.margin = kind, 0, self._clearance

    def _add_stem(self, flange: Any, gripper: SuctionGripper) -> list[str]:
        lip = gripper.tcp_offset[2]
        cup = min(CUP_M, lip - float(gripper.palm_m[1, 2]))
        names = []
        for name, radius, start, end in (
            ("stem", gripper.stem_radius_m, float(gripper.palm_m[1, 2]), lip - cup),
            # The bellows give: the cup ends short of its lip, so that what lies flush beside the part is not touched.
            ("cup", gripper.cup_radius_m, lip - cup, lip - 2.0 * gripper.bellows_m - self._clearance),
        ):
            if end - start > SHORTEST_FINGER_M:
                flange.add_geom(
                    name=name,
                    type=self._mujoco.mjtGeom.mjGEOM_CYLINDER,
                    fromto=[*gripper.tcp_offset[:2], start, *gripper.tcp_offset[:2], end],
                    size=[radius, 0, 0],
                    contype=_FINGERS,
                    conaffinity=0,
                    margin=self._clearance,
                )
                names.append(name)
        return names

    def assign(self, *, carried: str | None = None, grasped: str | None = None, absent: Iterable[str] = ()) -> None:
        """Set roles: `carried` moves with the tool; the fingers may touch `grasped`; `absent` parts are not there."""
        gone = set(absent)
        for name, geoms in self._geoms.items():
            kind, met = 0, _ARM | _FINGERS | _CARRIED | _SHOULDER
            if name in gone:
                met = 0
            elif name == carried:
                kind, met = _CARRIED, _ARM | _SHOULDER
            elif name == grasped:
                met = _ARM | _SHOULDER
            self.model.geom_contype[geoms] = kind
            self.model.geom_conaffinity[geoms] = met
            self.model.geom_margin[geoms] = self._clearance if name == carried else 0.0
            body = self.model.geom_bodyid[geoms[0]]
            self.model.body_contype[body] = kind
            self.model.body_conaffinity[body] = met
            self.model.body_margin[body] = self._clearance if name == carried else 0.0
        self._carried = carried

    def place(self, name: str, motion: Array) -> None:
        """Move a part by `motion` (4, 4) from its place in the structure."""
        a = self._address[name]
        self.data.qpos[a : a + 3] = motion[:3, 3]
        self._mujoco.mju_mat2Quat(self.data.qpos[a + 3 : a + 7], np.ascontiguousarray(motion[:3, :3]).ravel())

    def hit(self, q: Sequence[float] | Array, opening_m: float, grip: Array | None = None) -> str:
        """Return what touches what, '' when nothing does. `grip` (4, 4) takes the carried part along: its motion from
        its place in the structure is flange pose @ grip.
        """
        mujoco, data = self._mujoco, self.data
        data.qpos[:6] = q
        if self._fingers:
            data.qpos[6:8] = 0.5 * opening_m
        mujoco.mj_kinematics(self.model, data)
        if self._carried is not None and grip is not None:
            self.place(self._carried, self.flange @ grip)
            mujoco.mj_kinematics(self.model, data)
        mujoco.mj_collision(self.model, data)
        for k in range(data.ncon):
            contact = data.contact[k]
            if contact.dist < (self._clearance if contact.includemargin > 0 else 0.0):
                return " against ".join(self._name(g) for g in contact.geom)
        return ""

    @property
    def flange(self) -> Array:
        """Return the flange's pose (4, 4) in the configuration looked at last."""
        out = np.eye(4)
        out[:3, :3] = self.data.xmat[self._flange].reshape(3, 3)
        out[:3, 3] = self.data.xpos[self._flange]
        return out

    def _name(self, geom: int) -> str:
        name = str(self.model.geom(int(geom)).name)
        return name.rsplit(" ", 1)[0] if name.startswith(("part", "link")) else name


def straight(translation: Array) -> Array:
    """Return the (4, 4) motion that only translates."""
    out = np.eye(4)
    out[:3, 3] = translation
    return out
