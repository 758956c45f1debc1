"""Which part gets which colour: neighbours differ, and the colours stay apart for colour-blind readers."""

from __future__ import annotations

from mocca_robot.motion.parts_graph import PartsGraph

LIGHT = ("#77aadd", "#ee8866", "#eedd88", "#ffaabb", "#99ddff", "#44bb99", "#bbcc33", "#aaaa00")
"""Paul Tol's 'light' scheme: fills that carry dark labels and stay distinct in every colour vision."""
FIXED = "#c3c9d1"


def part_colours(graph: PartsGraph) -> tuple[int, ...]:
    """Return an index into `LIGHT` per part such that neighbours differ where eight colours allow it; −1 is ground."""
    chosen = [-1] * len(graph.assembly.parts)
    for part in graph.free:
        taken = {chosen[n] for n in graph.neighbours(part)}
        # Among the free colours the next one in turn: a plain stack then shows more than two colours.
        turn = [(part + k) % len(LIGHT) for k in range(len(LIGHT))]
        chosen[part] = next((c for c in turn if c not in taken), turn[0])
    return tuple(chosen)


def fills() -> tuple[str, ...]:
    """Return the CSS class of each colour index, ground last (index −1)."""
    return (*(f"c{k}" for k in range(len(LIGHT))), "fixed")
