"""The parts-graph: parts in the order in which they are placed, what they touch, and which motions that leaves them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import networkx as nx
import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.assembly import Assembly, Part
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.find import find_contacts
from mocca_robot.geometry.cones import MotionCone, generalized_normals, largest_cone
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.tolerances import COARSE


@dataclass(frozen=True, eq=False)
class PartMotion:
    """V_j of one part: the translations that take it out of what was placed before it.

    Attributes:
        part: index.
        normals: (m, d) normals of the earlier contacts; V_j = {x : normals·x ≥ 0}.
        alpha_rad: half-angle of the widest circular cone in V_j (negative: how deep the best direction is
            blocked); π/2 when the part touches nothing placed before it.
        axis: (d,) the axis of that cone, the best way *out*; insertion runs along −axis.
        blockers: indices of the earlier parts whose normals limit the cone.
    """

    part: int
    normals: Array
    alpha_rad: float
    axis: Array
    blockers: tuple[int, ...]

    def room(self, way_out: Array) -> float:
        """Return the half-angle (radians) of the widest cone about `way_out` (d,), unit, that V_j leaves: negative
        when an earlier contact blocks the way itself, π/2 when there is none.
        """
        if not len(self.normals):
            return float(np.pi / 2)
        return float(np.arcsin(np.clip((self.normals @ way_out).min(), -1.0, 1.0)))


class _Kept:
    """What is worked out when it is first asked for and then kept; another process works it out anew."""

    def __getstate__(self) -> dict[str, object]:
        return {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False, kw_only=True)
class Meeting(_Kept):
    """An edge j → i of the parts-graph: what is between P_j and its neighbour P_i, which was placed before it.

    Attributes:
        earlier, later: indices i and j.
        contacts: C_ij^k.
        numbers: the places of these contacts among those of the whole assembly.
        made: the joints that replace them, one each; None where the contacts are left as they are.
        about: (d,) the centroid of P_j.
    """

    earlier: int
    later: int
    contacts: tuple[Contact, ...]
    numbers: tuple[int, ...]
    made: tuple[Joint, ...] | None
    about: Array

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """Return J_ij^k, one per contact: planar ones where the contacts are left as they are."""
        return tuple(planar(c) for c in self.contacts) if self.made is None else self.made

    @cached_property
    def motion_cone(self) -> MotionCone:
        """Return V_ij (Eq. 1): the motions of P_j, about its centroid, while P_i stays."""
        rows = [generalized_normals(points, normals, self.about) for points, normals in (j.rays for j in self.joints)]
        return MotionCone(read_only(np.concatenate(rows)))

    @cached_property
    def facet_normals(self) -> Array:
        """Return (m, d) the normals of all facets: T(V_ij) = {x : facet_normals·x ≥ 0}."""
        return np.concatenate([j.facet_normals for j in self.joints])


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedPart(_Kept):
    """A node of the parts-graph: a part in its place.

    Attributes:
        index: its place in the sequence.
        part: the part.
        before: what is between it and each neighbour that was placed before it.
        chosen: (d,) unit vector d_j, in which the part is to go in, where somebody has chosen one.
    """

    index: int
    part: Part
    before: tuple[Meeting, ...]
    chosen: Array | None

    @cached_property
    def motion(self) -> PartMotion:
        """Return V_j = ∩ T(V_ij) over the neighbours placed before (Eq. 11)."""
        if not self.before:
            return _motion(self.index, np.zeros((0, self.part.shape.dimension)), np.zeros(0, dtype=np.int64))
        normals = np.concatenate([m.facet_normals for m in self.before])
        owners = np.repeat([m.earlier for m in self.before], [len(m.facet_normals) for m in self.before])
        return _motion(self.index, normals, owners)

    @property
    def direction(self) -> Array:
        """Return (d,) how the part goes in: as somebody chose, else along −axis of its widest cone."""
        return -self.motion.axis if self.chosen is None else self.chosen


@dataclass(frozen=True, eq=False)
class PartsGraph(_Kept):
    """Parts and what is between them: an edge j → i says that P_i is placed before its neighbour P_j.

    The states of the sequence are sub-graphs, in which the parts keep their indices.

    Attributes:
        assembly: all parts, in assembly order.
        network: nodes are part indices with 'placed' (PlacedPart), edges (j, i) have 'meeting' (Meeting).
    """

    assembly: Assembly
    network: nx.DiGraph[int]

    @classmethod
    def of(
        cls,
        assembly: Assembly,
        contacts: Sequence[Contact] | None = None,
        insertion: Mapping[str, Array] | None = None,
    ) -> PartsGraph:
        """Return the graph of an assembly as it is: every contact is a planar joint.

        `contacts` default to those that its geometry shows; `insertion` gives directions (d,), unit, by part name.
        Raises InputError when it names a part that does not exist.
        """
        found = find_contacts(assembly).contacts if contacts is None else tuple(contacts)
        return cls(assembly, _network(assembly, found, None, insertion or {}))

    @classmethod
    def joined(
        cls, assembly: Assembly, joints: Sequence[Joint], insertion: Mapping[str, Array] | None = None
    ) -> PartsGraph:
        """Return the graph of an assembly whose contacts are replaced by `joints`; `insertion` as in `of`."""
        contacts = tuple(j.contact for j in joints)
        return cls(assembly, _network(assembly, contacts, tuple(joints), insertion or {}))

    @cached_property
    def there(self) -> frozenset[int]:
        """Return the indices of the parts that are there."""
        return frozenset(self.network)

    @cached_property
    def present(self) -> BoolArray:
        """Return (N,) which of the assembly's parts are there."""
        present = np.zeros(len(self.assembly.parts), dtype=np.bool_)
        present[list(self.there)] = True
        return read_only(present, np.bool_)

    @cached_property
    def free(self) -> tuple[int, ...]:
        """Return the parts there that are not fixed, in assembly order."""
        return tuple(p for p in sorted(self.there) if not self.assembly.fixed[p])

    @property
    def chosen(self) -> dict[str, Array]:
        """Return the insertion directions (d,) that somebody has chosen, by part name."""
        nodes = (self.placed(part) for part in sorted(self.there))
        return {node.part.name: node.chosen for node in nodes if node.chosen is not None}

    @cached_property
    def meetings(self) -> tuple[Meeting, ...]:
        """Return the edges, those of earlier parts first."""
        return tuple(m for part in sorted(self.there) for m in self.placed(part).before)

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Return all contacts between parts that are there, in the order in which they were found."""
        found = {n: c for m in self.meetings for n, c in zip(m.numbers, m.contacts)}
        return tuple(found[n] for n in sorted(found))

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """Return one joint per contact, in the same order."""
        found = {n: j for m in self.meetings for n, j in zip(m.numbers, m.joints)}
        return tuple(found[n] for n in sorted(found))

    def placed(self, part: int) -> PlacedPart:
        """Return the node of a part. Raises KeyError when it is not there."""
        node: PlacedPart = self.network.nodes[part]["placed"]
        return node

    def motion(self, part: int) -> PartMotion:
        """Return V_j of part j (Eq. 11). Raises KeyError when it is not there."""
        return self.placed(part).motion

    def motions(self) -> Iterator[tuple[int, PartMotion]]:
        """Yield every free part with its V_j, in assembly order."""
        yield from ((part, self.motion(part)) for part in self.free)

    def meeting(self, earlier: int, later: int) -> Meeting | None:
        """Return what is between two parts, the one placed earlier first; None when they do not touch."""
        found: Meeting | None = self.network.get_edge_data(later, earlier, {}).get("meeting")
        return found

    def neighbours_before(self, part: int) -> tuple[int, ...]:
        """Return the parts that `part` touches and that are placed before it."""
        return tuple(sorted(self.network.successors(part)))

    def neighbours_after(self, part: int) -> tuple[int, ...]:
        """Return the parts that touch `part` and are placed after it."""
        return tuple(sorted(self.network.predecessors(part)))

    def neighbours(self, part: int) -> tuple[int, ...]:
        """Return the parts that touch `part`."""
        return tuple(sorted((*self.network.successors(part), *self.network.predecessors(part))))

    def touching(self, part: int) -> tuple[IntArray, Array]:
        """Return (m,) the neighbours of `part`, earlier and later, and (m, d) the contact normals from them into it:
        one row per contact, in the order in which they were found.
        """
        return self._touching[part]

    def leaving(self, part: int, others: Collection[int]) -> PartMotion:
        """Return the translations that take `part` out from among `others`, whether they were placed earlier or later:
        what V_j would be in another order.
        """
        neighbours, normals = self._touching[part]
        here = np.isin(neighbours, list(others))
        return _motion(part, normals[here], neighbours[here])

    def among(self, there: Collection[int]) -> PartsGraph:
        """Return the sub-graph of the parts `there`: V_j of a part grows when an earlier neighbour is missing."""
        network: nx.DiGraph[int] = self.network.subgraph(there).copy()
        for part, data in network.nodes(data=True):
            node: PlacedPart = data["placed"]
            kept = tuple(m for m in node.before if m.earlier in network)
            if len(kept) < len(node.before):
                data["placed"] = PlacedPart(index=part, part=node.part, before=kept, chosen=node.chosen)
        return PartsGraph(self.assembly, network)

    def without(self, part: int) -> PartsGraph:
        """Return the sub-graph that is left when `part` is taken away."""
        return self.among(self.there - {part})

    def around(self, part: int) -> PartsGraph:
        """Return the sub-graph of `part` and its neighbours."""
        return self.among([part, *self.neighbours(part)])

    def state(self, part: int) -> PartsGraph:
        """Return the assembly as it stands when `part` has just been placed: the sub-graph of the parts up to it."""
        return PartsGraph(self.assembly, self.network.subgraph([p for p in self.there if p <= part]))

    @cached_property
    def states(self) -> Mapping[int, PartsGraph]:
        """Return `state` of every free part, in assembly order: the intermediate assemblies of the sequence."""
        return {part: self.state(part) for part in self.free}

    @cached_property
    def _touching(self) -> dict[int, tuple[IntArray, Array]]:
        rows: dict[int, list[tuple[int, Array]]] = {part: [] for part in self.there}
        for contact in self.contacts:
            i, j = contact.parts
            rows[j].append((i, contact.normal))
            rows[i].append((j, -contact.normal))
        d = self.assembly.dimension
        return {
            part: (np.array([o for o, _ in mine], dtype=np.int64), np.array([n for _, n in mine]).reshape(-1, d))
            for part, mine in rows.items()
        }


def _network(
    assembly: Assembly,
    contacts: Sequence[Contact],
    joints: Sequence[Joint] | None,
    insertion: Mapping[str, Array],
) -> nx.DiGraph[int]:
    numbers: dict[tuple[int, int], list[int]] = {}
    for number, contact in enumerate(contacts):
        numbers.setdefault(contact.parts, []).append(number)
    before: dict[int, list[Meeting]] = {index: [] for index in range(len(assembly.parts))}
    for (i, j), mine in numbers.items():
        meeting = Meeting(
            earlier=i,
            later=j,
            contacts=tuple(contacts[n] for n in mine),
            numbers=tuple(mine),
            made=None if joints is None else tuple(joints[n] for n in mine),
            about=assembly.parts[j].centroid,
        )
        before[j].append(meeting)
    chosen = {assembly.index(name): np.asarray(direction) for name, direction in insertion.items()}
    network: nx.DiGraph[int] = nx.DiGraph(name=assembly.name)
    for index, part in enumerate(assembly.parts):
        node = PlacedPart(index=index, part=part, before=tuple(before[index]), chosen=chosen.get(index))
        network.add_node(index, placed=node)
    network.add_edges_from((j, m.earlier, {"meeting": m}) for j, mine_of in before.items() for m in mine_of)
    return network


def _motion(part: int, normals: Array, owners: IntArray) -> PartMotion:
    """Return V_j of part j from the normals (m, d) of what was placed before it, whose indices are `owners` (m,)."""
    alpha, axis = largest_cone(normals)
    limiting = np.asarray(normals @ axis <= np.sin(alpha) + COARSE)
    blockers = tuple(sorted({int(o) for o in owners[limiting]}))
    return PartMotion(part, read_only(normals), alpha, axis, blockers)
