"""Joints into parts, in either dimension."""

from __future__ import annotations

from collections.abc import Sequence

from mocca_robot.assembly import Assembly
from mocca_robot.joints.joint import Joint


def build_parts(assembly: Assembly, joints: Sequence[Joint]) -> Assembly:
    """Return `assembly` with every joint cut in; neighbours share the same curve or the same patch exactly."""
    if assembly.dimension == 2:
        from mocca_robot.joints.build2d import build_parts_2d

        return build_parts_2d(assembly, joints)
    from mocca_robot.joints.build3d import build_parts_3d

    return build_parts_3d(assembly, joints)
