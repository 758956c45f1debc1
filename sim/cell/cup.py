"""What a suction cup does: it holds what lies at its lip, up to what its vacuum and its friction hold."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, IntArray
from planners.robot.tool import SuctionGripper
from sim.cell.weld import soften
from sim.cell.world import CellWorld

Grasp = tuple[Array, Array]
"""Where a part is in the flange's frame, (3,) and (3, 3)."""

BACK_M = 0.02
"""The part is looked for from this far behind the lip."""


def sealed(world: CellWorld, gripper: SuctionGripper) -> bool:
    """Return whether the part that moves lies at the middle of the cup's lip, as near as the bellows reach."""
    import mujoco

    if world.cup is None:
        return False
    data, flange = world.data, world.flange
    axes = data.xmat[flange].reshape(3, 3)
    lip = data.xpos[flange] + axes @ np.asarray(gripper.tcp_offset[:3])
    found = np.zeros(1, dtype=np.int32)
    # Everything of the flange is left out: its own stem would be met first.
    reached = mujoco.mj_ray(world.model, data, lip - BACK_M * axes[:, 2], axes[:, 2], None, 1, flange, found)
    mine = int(world.model.body(world.moving_name).id)
    if reached < 0 or found[0] < 0 or int(world.model.geom_bodyid[found[0]]) != mine:
        return False
    return abs(float(reached) - BACK_M) <= gripper.bellows_m


def suck(world: CellWorld, gripper: SuctionGripper, grasp: Grasp) -> None:
    """Hold the part that moves with the cup's stiffness; `grasp` is where it hangs when nothing pulls at it."""
    import mujoco

    world.forward()
    assert world.cup is not None
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(grasp[1]).ravel())
    data = world.model.eq_data[world.cup]
    data[:3], data[3:6], data[6:10] = 0.0, grasp[0], quat
    soften(world.model, world.cup, gripper.stiffness_n_m, gripper.stiffness_nm_rad)
    world.data.eq_active[world.cup] = 1


def overload(world: CellWorld, gripper: SuctionGripper) -> str:
    """Return '' or why the cup cannot hold its part: pulled harder than the vacuum, sideways than its friction, or
    tilted until an edge of the lip lifts.
    """
    data = world.data
    if world.cup is None or not data.eq_active[world.cup]:
        return ""
    rows = np.flatnonzero((data.efc_id == world.cup) & (data.efc_type == 0))
    if len(rows) < 6:
        return ""  # not stepped since it took hold
    force, moment = _held_with(world, gripper, rows)
    axis = data.xmat[world.flange].reshape(3, 3)[:, 2]
    along = float(force @ axis)
    across = float(np.linalg.norm(force - along * axis))
    tilting = float(np.linalg.norm(moment - float(moment @ axis) * axis))
    # On the part, negative is towards the cup: what the vacuum has to pull with. The rest presses the lip on.
    pressed = max(0.0, gripper.force_n + along)
    if -along > gripper.force_n or across > world.place.pad_friction * pressed:
        return f"the cup let go: {-along:.1f} N along its axis, {across:.1f} N across"
    if tilting > pressed * gripper.cup_radius_m:
        return f"the cup let go: tilted with {tilting:.2f} Nm, its lip holds {pressed * gripper.cup_radius_m:.2f} Nm"
    return ""


def _held_with(world: CellWorld, gripper: SuctionGripper, rows: IntArray) -> tuple[Array, Array]:
    """Return force and moment (3,) with which the cup holds its part, world frame, about the middle of the lip."""
    import mujoco

    model, data = world.model, world.data
    only, joint = np.zeros(data.nefc), np.zeros(model.nv)
    only[rows] = data.efc_force[rows]
    mujoco.mj_mulJacTVec(model, data, joint, only)
    part = int(model.body(world.moving_name).id)
    first = int(model.body_dofadr[part])
    force = joint[first : first + 3]
    turning = data.xmat[part].reshape(3, 3) @ joint[first + 3 : first + 6]
    lip = data.xpos[world.flange] + data.xmat[world.flange].reshape(3, 3) @ np.asarray(gripper.tcp_offset[:3])
    return force, turning + np.cross(data.xpos[part] - lip, force)
