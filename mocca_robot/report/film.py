"""What MuJoCo saw of a state that falls, as frames for the player: as it was recorded, nothing invented."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mocca_robot.report.data import ReportData
from mocca_robot.report.findings import State
from mocca_robot.verdicts.physics import StateVerdict

MOST_NUMBERS = 150_000
"""Coordinates in all films of a page together, about 1.2 MB: films beyond that are left out, later states first."""
MOST_FRAMES = 40


def films(data: ReportData, found: Sequence[State]) -> dict[str, dict[str, Any]]:
    """Return a film per step (1, 2, … as text) that has one: 'times' (s), 'parts' (indices) and 'poses'.

    poses[t][f] is a part's displacement from its place: [x, y, turn] in 2D, [x, y, z, quaternion w x y z] in 3D,
    metres and radians, about its centroid. A motion that does not have that shape is left out.
    """
    assembly = data.design.assembly
    index = {p.name: k for k, p in enumerate(assembly.parts)}
    width, used = (3 if assembly.dimension == 2 else 7), 0
    made: dict[str, dict[str, Any]] = {}
    for step, state in enumerate(found):
        seen = state.seen
        if seen is None or not seen.poses or not _fits(seen, width, index):
            continue
        poses, times = np.array(seen.poses), np.array(seen.times)
        frames = np.unique(np.linspace(0, len(times) - 1, min(MOST_FRAMES, len(times))).round().astype(int))
        poses = poses[frames].copy()
        used += poses.size
        if used > MOST_NUMBERS:
            break
        parts = [index[n] for n in seen.parts]
        if width == 7:
            poses[:, :, :3] -= np.array([assembly.parts[p].centroid for p in parts])
        rounded = [[[float(f"{v:.5g}") for v in pose] for pose in frame] for frame in poses]
        made[str(step + 1)] = {"times": [float(f"{t:.4g}") for t in times[frames]], "parts": parts, "poses": rounded}
    return made


def _fits(seen: StateVerdict, width: int, index: Mapping[str, int]) -> bool:
    """Return whether a motion has a pose of `width` numbers per moment and part, all of known parts."""
    whole = len(seen.poses) == len(seen.times) and all(len(frame) == len(seen.parts) for frame in seen.poses)
    return whole and all(len(pose) == width for frame in seen.poses for pose in frame) and set(seen.parts) <= set(index)
