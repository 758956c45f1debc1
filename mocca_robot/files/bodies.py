"""Objects of a mesh file → parts: every closed body is one, unless the user says that several are rigid together."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Mesh
from mocca_robot.files.fields import MAX_NAME
from mocca_robot.files.mending import WELD, Mended, NotClosed, mended
from mocca_robot.geometry.surfaces import components, welded

MAX_LISTED = 6
"""Names that a note lists."""


@dataclass(frozen=True, eq=False)
class MeshObject:
    """What a file holds under one name.

    Attributes:
        name: as the file has it; possibly that of other objects, too.
        vertices: (V, 3), metres.
        triangles: (F, 3) vertex indices.
        groups: the name of each triangle's group inside the object; empty when the file knows none.
        notes: what was assumed while reading it.
    """

    name: str
    vertices: Array
    triangles: IntArray
    groups: Sequence[str] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """A part as it came from a file.

    Attributes:
        name: different from that of all others.
        mesh: in metres.
        notes: what was mended, and what was assumed.
        object: what the file calls it; the same for all bodies that it holds under one name.
    """

    name: str
    mesh: Mesh
    notes: tuple[str, ...] = ()
    object: str = field(default="")


def parts_of(objects: Iterable[MeshObject], rigid: Collection[str] = ()) -> list[NamedMesh]:
    """Return the parts that objects hold, in their order; objects of one name are looked at together.

    An object of several bodies becomes several parts: named by their groups where each body has its own, else
    'name_1', 'name_2', …; one in `rigid` stays one part. Open surfaces of several objects that close together are one
    part. Raises InputError for surfaces that do not close.
    """
    named = _by_name(objects)
    found: dict[int, tuple[MeshObject, Mended]] = {}
    open_ones: list[int] = []
    first_error: NotClosed | None = None
    for k, thing in enumerate(named):
        try:
            found[k] = thing, mended(thing.name, thing.vertices, thing.triangles)
        except NotClosed as error:
            open_ones.append(k)
            first_error = first_error or error
    if first_error is not None:
        if len(open_ones) < 2:
            raise first_error
        found |= _closed_together(named, open_ones, first_error)
    taken = {thing.name for thing, _ in found.values()}
    return [part for k in sorted(found) for part in _parts(*found[k], rigid, taken)]


def _by_name(objects: Iterable[MeshObject]) -> list[MeshObject]:
    """Return one object per name, in the order in which the names appear."""
    together: dict[str, list[MeshObject]] = {}
    for thing in objects:
        together.setdefault(usable_name(thing.name), []).append(thing)
    return [_joined(name, things) for name, things in together.items()]


def _joined(name: str, things: Sequence[MeshObject]) -> MeshObject:
    if len(things) == 1:
        return replace(things[0], name=name)
    offset = np.cumsum([0] + [len(t.vertices) for t in things])
    groups = [g for t in things for g in (t.groups or [""] * len(t.triangles))]
    return MeshObject(
        name,
        np.concatenate([t.vertices for t in things]),
        np.concatenate([t.triangles + o for t, o in zip(things, offset)]),
        groups if any(groups) else (),
        tuple(dict.fromkeys(n for t in things for n in t.notes)),
    )


def usable_name(name: str) -> str:
    """Return a name without characters that cannot be shown, of a usable length."""
    shown = "".join(c if c.isprintable() else " " for c in name)
    return " ".join(shown.split())[:MAX_NAME].strip() or "part"


def _parts(thing: MeshObject, found: Mended, rigid: Collection[str], taken: set[str]) -> list[NamedMesh]:
    name, bodies = thing.name, found.bodies
    mine = (*thing.notes, *found.notes)
    if len(bodies) == 1:
        return [NamedMesh(name, bodies[0], mine, name)]
    if name in rigid:
        return [NamedMesh(name, found.whole, (*mine, f"{len(bodies)} bodies kept as one (rigid)"), name)]
    names = _names(thing, found, taken)
    listed = ", ".join(f"'{n}'" for n in names[:MAX_LISTED]) + (f" … '{names[-1]}'" if len(names) > MAX_LISTED else "")
    said = (
        f"'{name}' holds {len(bodies)} separate bodies, read as {listed}; if they are one rigid part: rigid: [{name}]"
    )
    notes = (*mine, said)
    return [NamedMesh(n, body, notes if k == 0 else (), name) for k, (n, body) in enumerate(zip(names, bodies))]


def _names(thing: MeshObject, found: Mended, taken: set[str]) -> list[str]:
    """Return a name for each body: that of its group where every body has one of its own, else a number."""
    if thing.groups:
        mine = [usable_name(thing.groups[t]) if thing.groups[t] else "" for t in found.first]
        if all(mine) and len(set(mine)) == len(mine) and not taken & set(mine):
            taken.update(mine)
            return mine
    names, number = [], 0
    for _ in found.bodies:
        number += 1
        while f"{thing.name}_{number}" in taken:
            number += 1
        names.append(f"{thing.name}_{number}")
    taken.update(names)
    return names


def _closed_together(
    named: Sequence[MeshObject], open_ones: Sequence[int], error: NotClosed
) -> dict[int, tuple[MeshObject, Mended]]:
    """Return the bodies that open objects form together, by the first object of each; raises `error` if they do not."""
    everything = _joined("", [named[k] for k in open_ones])
    size = float(np.linalg.norm(np.ptp(everything.vertices, axis=0)))
    _, place, _ = welded(everything.vertices, WELD[-1] * size)
    corners = place[everything.triangles]
    _, group = components(int(place.max()) + 1, corners[:, 0], corners[:, 1])
    _, group = components(len(group), *_links(group, corners))
    owner = np.repeat(open_ones, [len(named[k].triangles) for k in open_ones])
    cluster = group[corners[:, 0]]
    found: dict[int, tuple[MeshObject, Mended]] = {}
    for c in np.unique(cluster):
        mine = np.flatnonzero(cluster == c)
        members = np.unique(owner[mine])
        if len(members) == 1:
            raise error
        names = [named[k].name for k in members]
        name = _common_start(names).rstrip(" _-.:/0123456789")
        name = name if len(name) >= 2 and name not in {t.name for t in named} else names[0]
        thing = MeshObject(name, everything.vertices, everything.triangles[mine])
        try:
            closed = mended(name, thing.vertices, thing.triangles)
        except NotClosed:
            raise error from None
        listed = ", ".join(f"'{n}'" for n in names[:MAX_LISTED]) + (", …" if len(names) > MAX_LISTED else "")
        note = f"the surfaces {listed} close together: read as '{name}'"
        found[int(members[0])] = thing, Mended(closed.bodies, closed.first, (*closed.notes, note))
    return found


def _common_start(names: Sequence[str]) -> str:
    alike = [len(set(letters)) == 1 for letters in zip(*names)]
    return names[0][: [*alike, False].index(False)]


def _links(group: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Return pairs of places that triangles link, those linked already included."""
    order = np.argsort(group, kind="stable")
    same = group[order][1:] == group[order][:-1]
    return (
        np.concatenate([corners[:, 0], corners[:, 1], order[:-1][same]]),
        np.concatenate([corners[:, 1], corners[:, 2], order[1:][same]]),
    )
