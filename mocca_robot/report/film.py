"""What MuJoCo saw of a state that falls, as frames for the player: taken from simulation.json, nothing invented."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mocca_robot.report.data import ReportData
from mocca_robot.report.findings import State, entries

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
    simulated = {str(s.get("placed")): s.get("motion") for s in entries(data, "states")}
    made: dict[str, dict[str, Any]] = {}
    for step, state in enumerate(found):
        motion = simulated.get(state.part)
        if not isinstance(motion, dict) or not motion.get("poses"):
            continue
        names = [str(n) for n in motion.get("parts", [])]
        try:
            poses = np.asarray(motion["poses"], dtype=np.float64)
            times = np.asarray(motion["times_s"], dtype=np.float64)
        except (KeyError, TypeError, ValueError):
            continue
        shape = (len(times), len(names), width)
        if poses.shape != shape or not np.isfinite(poses).all() or not set(names) <= set(index):
            continue
        frames = np.unique(np.linspace(0, len(times) - 1, min(MOST_FRAMES, len(times))).round().astype(int))
        poses = poses[frames].copy()
        used += poses.size
        if used > MOST_NUMBERS:
            break
        parts = [index[n] for n in names]
        if width == 7:
            poses[:, :, :3] -= np.array([assembly.parts[p].centroid for p in parts])
        rounded = [[[float(f"{v:.5g}") for v in pose] for pose in frame] for frame in poses]
        made[str(step + 1)] = {"times": [float(f"{t:.4g}") for t in times[frames]], "parts": parts, "poses": rounded}
    return made
