"""What the optimiser needs to know of joints, whatever their dimension: parameters → surfaces → rays, mass, room."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions


class Shapes(Protocol):
    """All joints of an assembly, evaluated together. E joints, Q pairs, S shape and L lean parameters."""

    @property
    def assembly(self) -> Assembly:
        """Return the assembly with planar contacts."""

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Return the contact of each joint."""

    @property
    def options(self) -> JointOptions:
        """Return the designer's bounds."""

    @property
    def pair(self) -> IntArray:
        """Return (E,) the pair of each joint; joints of one pair share u."""

    @property
    def pair_normal(self) -> Array:
        """Return (Q, d) the reference direction from which each pair's u leans."""

    @property
    def n_lean(self) -> int:
        """Return L: 1 in 2D, 2 in 3D."""

    @property
    def steepest_lean(self) -> float:
        """Return the largest lean of u from its reference: radians in 2D, tangents in 3D."""

    @property
    def heights(self) -> tuple[int, ...]:
        """Return the columns of `shape` that are heights; all zero = planar."""

    @property
    def rest(self) -> Array:
        """Return the shape (S,) of a planar joint."""

    @property
    def rest_kind(self) -> Any:
        """Return the family that planar joints are listed under."""

    @property
    def normals(self) -> Array:
        """Return (E, d) contact normals."""

    @property
    def centres(self) -> Array:
        """Return (E, d) a point in the middle of each contact."""

    @property
    def lengths(self) -> Array:
        """Return (E,) the size of each contact, m."""

    @property
    def can_curve(self) -> BoolArray:
        """Return (E,) which contacts may become joints."""

    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds of shapes (E, S)."""

    def directions(self, lean: Array) -> Array:
        """Return (E, d) principal directions for leans (Q, L)."""

    def surface(self, shape: Array, u: Array) -> Array:
        """Return (E, V, d) surface points for shapes (E, S) and directions (E, d)."""

    def rays(self, surface: Array) -> tuple[Array, Array]:
        """Return contact points and normals (E, R, d) of surfaces, enough of them to design with.

        They span a subset of the joints' cones, so what holds with them holds (Theorem 3.2).
        """

    def all_rays(self, surface: Array) -> tuple[Array, Array]:
        """Return contact points and normals (E, R, d) of surfaces: the corners of every facet."""

    def transferred(self, surface: Array) -> tuple[Array, Array]:
        """Return volume (E,) and first moment (E, d) moved from P_j to P_i, per unit thickness in 2D."""

    def violations(self, surface: Array, shape: Array) -> Array:
        """Return (E, *) by how much, in contact sizes, room and radius are exceeded; ≤ 0 is well."""

    def candidate_rays(self) -> tuple[Array, Array, Array]:
        """Return points, normals (E, R, d) and prices (E, R) of the forces a joint could transmit."""

    def catalogue(self, kinds: Sequence[str]) -> list[tuple[Any, Array]]:
        """Return realisable (kind, shape row), shallow to sharp."""

    def uniform_bumps(self) -> list[tuple[Any, Array]]:
        """Return (kind, shapes (E, S)) with the same bump everywhere, starting points where nothing else serves."""

    def further(self) -> tuple[str, ...]:
        """Return the families beyond those that `uniform_bumps` starts from, fewest numbers first; () without any."""

    def refined(self, family: str, shape: Array) -> tuple[Shapes, Array] | None:
        """Return the same joints in a richer family, and their rows there: the same surfaces or the nearest to them.

        None where the family cannot take the place of these joints.
        """

    def begun(self, family: str) -> Sequence[tuple[Shapes, Array]]:
        """Return joints of a richer family on all contacts to start from, and their rows."""

    def mixed(self) -> Shapes:
        """Return the same joints, to be chosen from a catalogue of all families."""

    def with_kinds(self, kinds: Sequence[Any]) -> Shapes:
        """Return the same joints with other families."""

    def within(self, limits: Array) -> Shapes:
        """Return the same joints with bumps between the lowest and highest heights `limits` (E, 2), m."""

    def joint(self, index: int, shape: Array, u: Array) -> Joint:
        """Return one joint built."""


def turned_within(rows: Array, heights: tuple[int, ...], low: Array, top: Array) -> Array:
    """Return shapes (E, S) between bounds: bumps on a side without room are turned to the other one."""
    columns = list(heights)
    wanted = rows[:, columns]
    cut = np.clip(wanted, low[:, columns], top[:, columns])
    barred = ((cut == 0.0) & (wanted != 0.0)).any(axis=1)
    kept = rows.copy()
    kept[:, columns] = np.clip(np.where(barred[:, None], -wanted, wanted), low[:, columns], top[:, columns])
    return kept
