"""Load cases and goals in words."""

from __future__ import annotations

from mocca_robot.assembly import Goal, Interlocking, Lateral, SupportFree
from mocca_robot.report.markup import degrees


def case_words(name: str) -> str:
    """Return a load case's name in words (not escaped): 'state_p05' → 'just after placing p05'."""
    if name.startswith("state_"):
        return f"just after placing {name[6:]}"
    if name.startswith("tilt_") and name[5:].lstrip("-").isdigit():
        return f"ground tilted towards {int(name[5:])}°"
    if name.startswith("load_"):
        load, _, placed = name[5:].partition("_state_")
        return f"under '{load}'" + (f", just after placing {placed}" if placed else "")
    known = {
        "gravity": "finished, under gravity",
        "gravity_key_held": "finished, under gravity, key held",
        "interlocking": "pushed apart, key held",
    }
    return known.get(name, name)


def goal_words(goal: Goal) -> str:
    """Return a goal in words (not escaped)."""
    if isinstance(goal, SupportFree):
        return "stands by itself in every state of the sequence"
    if isinstance(goal, Lateral):
        return f"stands on ground tilted by {degrees(goal.angle_rad, 0)}"
    if isinstance(goal, Interlocking):
        return f"interlocks with '{goal.key}' as its key"
    return "stands under gravity"
