"""Where the time of a design goes: own time of each room of the programme, and of the libraries beneath it."""

from __future__ import annotations

import cProfile
import os
import pstats
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

from benchmarks.measurement import Measurement
from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.designer import design

ROOT = Path(__file__).parents[1]
NAMES = ("deer", "lilium_tower", "igloo")
ROOMS = {
    "mocca_robot/statics": "statics",
    "mocca_robot/contacts": "contacts",
    "mocca_robot/geometry/facets": "contacts",
    "mocca_robot/motion": "sweeps",
    "mocca_robot/joints": "joint geometry",
    "mocca_robot/report": "report",
    "planners/cone_joints/curvature": "descent",
    "planners/cone_joints/descent": "descent",
    "planners/cone_joints/unknowns": "descent",
    "planners/cone_joints/energy": "energy and gradient",
    "planners/cone_joints/shapes": "joint geometry",
    "planners/cone_joints/clearance": "joint geometry",
    "planners": "search, other",
    "mocca_robot": "other",
}
SHARE = 0.01
"""Rooms with a smaller share of the time are added up as 'rest'."""


def profile(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield the seconds in each room for whole designs, contacts and verification included, on one thread."""
    for name in NAMES[:1] if quick else NAMES:
        if only is not None and only not in name:
            continue
        config = load(ROOT / "configs" / f"{name}.yaml")
        profiler = cProfile.Profile()
        # With one core no pool of threads is used, which a profiler would not see into.
        with patch.object(os, "cpu_count", lambda: 1):
            profiler.enable()
            report = find_contacts(config.assembly)
            found = design(config.assembly, config.joints, contacts=report)
            verify(found.design.assembly)
            profiler.disable()
        seconds = shares(pstats.Stats(profiler))
        total = sum(seconds.values())
        nothing = float("nan")
        for room, own in sorted(seconds.items(), key=lambda item: -item[1]):
            yield Measurement(
                bench="profile",
                case=name,
                tool=room,
                seconds=own,
                repeats=1,
                verdict=f"{own / total:.0%} of {total:.1f} s",
                kkt=nothing,
                memory_mb=nothing,
            )


def shares(stats: pstats.Stats) -> dict[str, float]:
    """Return own seconds by room; time inside a library counts for the room that called it."""
    entries = stats.stats  # type: ignore[attr-defined]
    found: dict[str, float] = {}
    for place, (_, _, own, _, callers) in entries.items():
        for room, seconds in _owners(place, own, callers, entries):
            found[room] = found.get(room, 0.0) + seconds
    total = sum(found.values())
    large = {room: s for room, s in found.items() if s >= SHARE * total}
    rest = total - sum(large.values())
    return {**large, "rest": rest} if rest > 0 else large


def _owners(place: tuple[str, int, str], own: float, callers: dict, entries: dict, depth: int = 4) -> list:  # type: ignore[type-arg]
    """Return (room, seconds): of the function's own file, or shared out among its callers by their share of it."""
    room = _room(place[0])
    if room is not None:
        return [(room, own)]
    weights = {caller: times[2] if len(times) == 4 else 0.0 for caller, times in callers.items()}
    whole = sum(weights.values())
    if depth == 0 or whole <= 0.0:
        return [("libraries", own)]
    shared = []
    for caller, weight in weights.items():
        above = entries[caller][4] if caller in entries else {}
        shared += _owners(caller, own * weight / whole, above, entries, depth - 1)
    return shared


def _room(file: str) -> str | None:
    try:
        path = Path(file).resolve().relative_to(ROOT).as_posix()
    except ValueError:
        return None
    return next((room for start, room in ROOMS.items() if path.startswith(start)), None)
