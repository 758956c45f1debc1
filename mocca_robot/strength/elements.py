"""Finite elements in one part: quadratic triangles in plane stress, quadratic tetrahedra, under loads in balance.

A part's contact forces and weight balance each other, so any constraint that only stops rigid motion leaves stresses as
they are; what meshing leaves unbalanced is taken up by an acceleration of the whole part, not by the constraint.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Mesh, Polygon
from mocca_robot.geometry.cones import cross
from mocca_robot.strength.mesh2d import NotMeshed, triangulated2d
from mocca_robot.strength.settings import TINY

if TYPE_CHECKING:
    from skfem import Basis

RATIO = 2.0
"""Largest circumradius over shortest edge of a tetrahedron: a smaller one costs points, a larger one accuracy."""
SPREAD = 1.0
"""How far from a contact sample the outside is pressed by it, in widths of what the sample stands for."""
ALIGNED = 0.9
"""Cosine between a sample's normal and that of the outside that it presses."""
MOST_NODES = 60_000
"""Corners beyond which a part is not looked at: the memory of its factors."""


def missing_packages(dimension: int) -> tuple[str, ...]:
    """Return the packages that elements in parts of 2 or 3 dimensions need and that are not installed."""
    needed = {"skfem": "scikit-fem"} | ({"tetgen": "tetgen"} if dimension == 3 else {})
    return tuple(name for module, name in needed.items() if find_spec(module) is None)


def meshed(shape: Polygon | Mesh, size: float) -> tuple[Array, IntArray]:
    """Return points (n, d) and simplices (m, d + 1) of a part, edges of at most about `size` metres.

    Raises NotMeshed where that fails.
    """
    if isinstance(shape, Polygon):
        return triangulated2d(shape, size)
    import tetgen

    try:
        made = tetgen.TetGen(np.array(shape.vertices), np.array(shape.faces, dtype=np.int32))
        points, cells, *_ = made.tetrahedralize(
            order=1, quality=True, minratio=RATIO, fixedvolume=True, maxvolume=size**3 / 6.0, quiet=True
        )
    except RuntimeError as error:
        raise NotMeshed(f"its surface cannot be filled with tetrahedra: {str(error).strip().splitlines()[0]}") from None
    if len(points) > MOST_NODES:
        raise NotMeshed(f"it would take {len(points)} corners of elements; {MOST_NODES} are looked at")
    return np.asarray(points, dtype=np.float64), np.asarray(cells, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Elements:
    """The elements of one part, ready for any loads.

    Attributes:
        points, cells: corners (n, d) and simplices (m, d + 1).
        stiffness, poisson: Pa and ratio.
        thickness: metres of a flat part, 1 of a solid.
    """

    points: Array
    cells: IntArray
    stiffness: float
    poisson: float
    thickness: float = 1.0

    @property
    def dimension(self) -> int:
        """Return 2 or 3."""
        return int(self.points.shape[1])

    @cached_property
    def _parts(self) -> tuple[Any, Any]:
        from skfem import ElementTetP2, ElementTriP2, ElementVector, MeshTet, MeshTri

        flat = self.dimension == 2
        mesh = (MeshTri if flat else MeshTet)(self.points.T.copy(), self.cells.T.copy())
        return mesh, ElementVector(ElementTriP2() if flat else ElementTetP2())

    @cached_property
    def basis(self) -> Basis:
        """Return the quadratic basis, integrated exactly for straight elements."""
        from skfem import Basis

        mesh, element = self._parts
        return Basis(mesh, element, intorder=2)

    @cached_property
    def moduli(self) -> tuple[float, float]:
        """Return Lamé's λ and μ; in 2D those of plane stress."""
        e, nu = self.stiffness, self.poisson
        lam, mu = e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
        return (2 * lam * mu / (lam + 2 * mu) if self.dimension == 2 else lam), mu

    @cached_property
    def places(self) -> Array:
        """Return (N, d) where every unknown acts; `axes` says along which axis."""
        return np.asarray(self.basis.doflocs.T)

    @cached_property
    def axes(self) -> IntArray:
        """Return (N,) the axis of every unknown: displacements at a place lie one after the other."""
        return np.tile(np.arange(self.dimension), self.basis.N // self.dimension)

    @cached_property
    def matrix(self) -> sp.csc_array:
        """Return the stiffness matrix."""
        from skfem import BilinearForm
        from skfem.helpers import ddot, sym_grad, trace

        lam, mu = self.moduli

        def energy(u: Any, v: Any, w: Any) -> Any:
            strain, virtual = sym_grad(u), sym_grad(v)
            return self.thickness * (lam * trace(strain) * trace(virtual) + 2.0 * mu * ddot(strain, virtual))

        return sp.csc_array(BilinearForm(energy).assemble(self.basis))

    @cached_property
    def _held(self) -> IntArray:
        """Return the unknowns that stop rigid motion and no more: three in 2D, six in 3D."""
        d, corners = self.dimension, self.points
        a = int(corners[:, 0].argmin())
        b = int(np.linalg.norm(corners - corners[a], axis=1).argmax())
        along = (corners[b] - corners[a]) / np.linalg.norm(corners[b] - corners[a])

        def unknown(corner: int, axis: int) -> int:
            return int(self.basis.nodal_dofs[axis, corner])

        if d == 2:
            return np.array([unknown(a, 0), unknown(a, 1), unknown(b, int(np.abs(along).argmin()))])
        off = np.linalg.norm(np.cross(corners - corners[a], along), axis=1)
        c = int(off.argmax())
        normal = np.cross(along, corners[c] - corners[a])
        main = int(np.abs(along).argmax())
        return np.array(
            [unknown(a, 0), unknown(a, 1), unknown(a, 2)]
            + [unknown(b, k) for k in range(3) if k != main]
            + [unknown(c, int(np.abs(normal).argmax()))]
        )

    @cached_property
    def _solver(self) -> tuple[Any, IntArray]:
        free = np.setdiff1d(np.arange(self.basis.N), self._held)
        inner = sp.csc_matrix(self.matrix[free][:, free])
        return splu(inner, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0), free

    def body(self, force: Array) -> Array:
        """Return (N,) nodal forces of `force` (d,) N/m³ in all of the part."""
        return np.asarray(self.mass @ force[self.axes])

    @cached_property
    def mass(self) -> sp.csc_array:
        """Return ∫ v·w over the part, thickness included: nodal forces of a field of forces per volume."""
        from skfem import Basis, BilinearForm, ElementTetP2, ElementTriP2

        mesh, _ = self._parts
        fine = Basis(mesh, ElementTriP2() if self.dimension == 2 else ElementTetP2(), intorder=4)
        one = BilinearForm(lambda u, v, w: self.thickness * u * v).assemble(fine)
        return sp.csc_array(sp.kron(one, sp.eye_array(self.dimension)))

    def at(self, points: Array, forces: Array) -> Array:
        """Return (N,) nodal forces of `forces` (k, d) N at places (k, d) in or on the part."""
        cell, weights = self._located(points)
        return self._spread(cell, weights, forces)

    def pressed(self, points: Array, forces: Array, normals: Array, areas: Array) -> Array:
        """Return (N,) nodal forces of contact samples: each force spread over the outside that lies nearest to it.

        `normals` (k, d) point out of the part, `areas` (k,) are what the samples stand for; where the elements are
        coarser than the samples, a force acts at its place.
        """
        from scipy.spatial import cKDTree

        cell, weights, places, outward, size = self._rim
        distance, nearest = (np.asarray(x) for x in cKDTree(points).query(places))
        reach = SPREAD * (areas[nearest] / self.thickness) ** (1.0 / (self.dimension - 1))
        there = (distance < reach) & (np.einsum("qd,qd->q", outward, normals[nearest]) > ALIGNED)
        covered = np.bincount(nearest[there], weights=size[there], minlength=len(points))
        alone = covered <= 0.0
        share = (size / np.maximum(covered[nearest], TINY))[there]
        out = self._spread(cell[there], weights[there], forces[nearest[there]] * share[:, None])
        return out + self.at(points[alone], forces[alone]) if alone.any() else out

    @cached_property
    def _rim(self) -> tuple[IntArray, Array, Array, Array, Array]:
        """Return points of the outside, Gauss's on every facet: the element (q,), barycentric coordinates (q, d + 1),
        places and outward normals (q, d), and sizes (q,).
        """
        d = self.dimension
        sides = np.concatenate([np.delete(self.cells, k, axis=1) for k in range(d + 1)])
        opposite = np.repeat(np.arange(d + 1), len(self.cells))
        _, first, counts = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
        outer = first[counts == 1]
        cell, alone = outer % len(self.cells), opposite[outer]
        corners = self.points[sides[outer]]
        edges = corners[:, 1:] - corners[:, :1]
        if d == 2:
            normal = np.stack([edges[:, 0, 1], -edges[:, 0, 0]], axis=1)
            inner = 0.5 + np.array([[-1.0, 1.0], [1.0, -1.0]]) / np.sqrt(12.0)
        else:
            normal = 0.5 * np.cross(edges[:, 0], edges[:, 1])
            inner = np.full((3, 3), 1.0 / 6.0) + 0.5 * np.eye(3)
        size = np.linalg.norm(normal, axis=1)
        inwards = self.points[self.cells[cell, alone]] - corners[:, 0]
        normal *= -np.sign(np.einsum("fd,fd->f", normal, inwards))[:, None] / np.maximum(size, TINY)[:, None]
        weights = np.zeros((len(outer), d, d + 1))
        kept = np.array([[i for i in range(d + 1) if i != k] for k in range(d + 1)])[alone]
        every = np.repeat(kept[:, None], d, axis=1)
        np.put_along_axis(weights, every, np.broadcast_to(inner, every.shape), axis=2)
        places = np.einsum("qk,fkd->fqd", inner, corners)
        return (
            np.repeat(cell, d),
            weights.reshape(-1, d + 1),
            places.reshape(-1, d),
            np.repeat(normal, d, axis=0),
            np.repeat(size / d, d),
        )

    def _located(self, points: Array) -> tuple[IntArray, Array]:
        """Return the element (k,) of every place and its barycentric coordinates (k, d + 1), pulled inside."""
        from scipy.spatial import cKDTree

        corners = self.points[self.cells]
        tree = cKDTree(corners.mean(axis=1))
        edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        inverse = np.linalg.inv(edges)
        count = min(24, len(corners))
        near = np.asarray(tree.query(points, k=count)[1]).reshape(len(points), count)
        local = np.einsum("kcij,kcj->kci", inverse[near], points[:, None] - corners[near, 0])
        share = np.concatenate([1.0 - local.sum(axis=2, keepdims=True), local], axis=2)
        best = share.min(axis=2).argmax(axis=1)
        rows = np.arange(len(points))
        weights = np.maximum(share[rows, best], 0.0)
        return near[rows, best], weights / weights.sum(axis=1, keepdims=True)

    def _spread(self, cell: IntArray, weights: Array, forces: Array) -> Array:
        d = self.dimension
        pairs = [(i, j) for i in range(d + 1) for j in range(i + 1, d + 1)]
        middles = np.stack([4.0 * weights[:, i] * weights[:, j] for i, j in pairs], axis=1)
        shapes = np.concatenate([weights * (2.0 * weights - 1.0), middles], axis=1)
        nodes = self._nodes[cell]
        out = np.zeros(self.basis.N)
        for axis in range(d):
            np.add.at(out, nodes * d + axis, shapes * forces[:, axis, None])
        return out

    @cached_property
    def _nodes(self) -> IntArray:
        """Return (m, nodes) the places of every element: corners, then the middles of edges 01, 02, … in that order."""
        d = self.dimension
        places = self.places[::d]
        from scipy.spatial import cKDTree

        corners = self.points[self.cells]
        pairs = [(i, j) for i in range(d + 1) for j in range(i + 1, d + 1)]
        middles = np.stack([0.5 * (corners[:, i] + corners[:, j]) for i, j in pairs], axis=1)
        wanted = np.concatenate([corners, middles], axis=1)
        return np.asarray(cKDTree(places).query(wanted.reshape(-1, d))[1].reshape(wanted.shape[:2]))

    def balanced(self, load: Array) -> tuple[Array, float]:
        """Return a load (N,) with an acceleration of the whole part that balances it, and how large what it took up is.

        The latter is a share of all forces that act.
        """
        d, k = self.dimension, 3 if self.dimension == 2 else 6
        centre = self.points.mean(axis=0)
        arm = self.places - centre
        size = float(np.linalg.norm(np.ptp(self.points, axis=0)))
        rigid = np.zeros((len(load), k))
        rigid[np.arange(len(load)), self.axes] = 1.0
        units = np.eye(d)[self.axes]
        rigid[:, d:] = cross(arm, units) / size
        unbalanced = rigid.T @ load
        field = self.mass @ rigid
        taken = np.linalg.solve(rigid.T @ field, unbalanced)
        acting = np.abs(load).sum() + TINY
        return load - field @ taken, float(np.abs(unbalanced).max() / acting)

    def solve(self, load: Array) -> Array:
        """Return (N,) displacements under a balanced load (N,), metres; where the part is held they are zero."""
        solver, free = self._solver
        u = np.zeros(self.basis.N)
        u[free] = solver.solve(load[free])
        return u

    @cached_property
    def _corners(self) -> Any:
        """Return the basis with its values at the corners of elements."""
        from skfem import Basis

        mesh, element = self._parts
        d = self.dimension
        at = np.concatenate([np.zeros((d, 1)), np.eye(d)], axis=1)
        return Basis(mesh, element, quadrature=(at, np.ones(d + 1)))

    def stress(self, u: Array) -> Array:
        """Return (n, d, d) stresses at the corners of elements, Pa: means of what their elements say there."""
        d, n = self.dimension, len(self.points)
        gradient = np.asarray(self._corners.interpolate(u).grad)  # (d, d, m, d + 1)
        strain = 0.5 * (gradient + gradient.swapaxes(0, 1))
        lam, mu = self.moduli
        trace = np.einsum("iimk->mk", strain)
        stress = 2.0 * mu * strain + lam * np.eye(d)[:, :, None, None] * trace
        flat = np.moveaxis(stress, (0, 1), (2, 3)).reshape(-1, d * d)
        weight = np.repeat(self._volumes, d + 1)
        corner = np.asarray(self._parts[0].t).T.ravel()  # in the order that the mesh keeps them
        total = np.bincount(corner, weights=weight, minlength=n)
        sums = [np.bincount(corner, weights=weight * column, minlength=n) for column in flat.T]
        return np.stack(sums, axis=1).reshape(n, d, d) / np.maximum(total, TINY)[:, None, None]

    @cached_property
    def _volumes(self) -> Array:
        corners = self.points[self.cells]
        return np.asarray(
            np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / (2.0 if self.dimension == 2 else 6.0)
        )
