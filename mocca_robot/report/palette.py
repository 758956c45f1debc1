"""Which part gets which colour: neighbours differ, and the colours stay apart for colour-blind readers."""

from __future__ import annotations

from collections.abc import Sequence

import networkx as nx

from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import Contact

LIGHT = ("#77aadd", "#ee8866", "#eedd88", "#ffaabb", "#99ddff", "#44bb99", "#bbcc33", "#aaaa00")
"""Paul Tol's 'light' scheme: fills that carry dark labels and stay distinct in every colour vision."""
FIXED = "#c3c9d1"


def part_colours(assembly: Assembly, contacts: Sequence[Contact]) -> tuple[int, ...]:
    """Return an index into `LIGHT` per part such that neighbours differ where eight colours allow it; −1 is ground."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(len(assembly.parts)))
    graph.add_edges_from(c.parts for c in contacts)
    chosen = [-1] * len(assembly.parts)
    for part in range(len(chosen)):
        if assembly.fixed[part]:
            continue
        taken = {chosen[n] for n in graph.neighbors(part)}
        # Among the free colours the next one in turn: a plain stack then shows more than two colours.
        turn = [(part + k) % len(LIGHT) for k in range(len(LIGHT))]
        chosen[part] = next((c for c in turn if c not in taken), turn[0])
    return tuple(chosen)


def fills() -> tuple[str, ...]:
    """Return the CSS class of each colour index, ground last (index −1)."""
    return (*(f"c{k}" for k in range(len(LIGHT))), "fixed")
