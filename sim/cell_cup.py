"""What a suction cup does: it holds what lies at its lip, up to what its vacuum and its friction hold."""

from __future__ import annotations

import numpy as np

from planners.robot.tool import SuctionGripper
from sim.cell_world import CellWorld

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


def suck(world: CellWorld) -> None:
    """Hold the part that moves where it is now."""
    import mujoco

    world.forward()
    grasp = world.in_hand()
    assert grasp is not None and world.cup is not None
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(grasp[1]).ravel())
    data = world.model.eq_data[world.cup]
    data[:3], data[3:6], data[6:10], data[10] = 0.0, grasp[0], quat, 0.05
    world.data.eq_active[world.cup] = 1


def overload(world: CellWorld, gripper: SuctionGripper) -> str:
    """Return '' or why the cup cannot hold its part: pulled harder than the vacuum, or sideways than its friction."""
    data = world.data
    if world.cup is None or not data.eq_active[world.cup]:
        return ""
    rows = np.flatnonzero((data.efc_id == world.cup) & (data.efc_type == 0))[:3]
    if len(rows) < 3:
        return ""  # not stepped since it took hold
    force = -data.efc_force[rows]  # MuJoCo's acts on the flange
    axis = data.xmat[world.flange].reshape(3, 3)[:, 2]
    along = float(force @ axis)
    across = float(np.linalg.norm(force - along * axis))
    # On the part, negative is towards the cup: what the vacuum has to pull with.
    if -along > gripper.force_n or across > world.place.pad_friction * max(0.0, gripper.force_n + along):
        return f"the cup let go: {-along:.1f} N along its axis, {across:.1f} N across"
    return ""
