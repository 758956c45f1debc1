"""Cuts through a part, and what the loads on one side of each come to: the fast estimate's beams.

A part hangs together across each cut alone, so the forces and moments there follow from all that acts beyond it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.geometry.cones import cross
from mocca_robot.geometry.frames import tangents


@dataclass(frozen=True, eq=False, kw_only=True)
class Sections:
    """P cuts through one part.

    Attributes:
        normals: (P, d) unit, towards the side whose loads are summed up.
        centres: (P, d) centroids of the cuts.
        areas: (P,) m².
        inertia: (P, d − 1, d − 1) second moments about the centroid, along `tangents(normals)`, m⁴.
        rims: (P, E, d − 1) points of the cuts' outlines furthest out, from the centroid.
        beyond: (P, S) which of the part's contact samples lie beyond.
        volumes: (P,) m³ beyond.
        centroids: (P, d) of what lies beyond.
    """

    normals: Array
    centres: Array
    areas: Array
    inertia: Array
    rims: Array
    beyond: BoolArray
    volumes: Array
    centroids: Array

    def stresses(self, points: Array, forces: Array, body: Array, further: tuple[Array, Array, BoolArray]) -> Array:
        """Return (P, 3) largest and least normal stress and shear stress, Pa.

        Args:
            points, forces: (S, d) of contacts.
            body: (d,) N/m³.
            further: points (L, d) and forces (L, d) of user loads, and (P, L) which lie beyond.
        """
        here = self.beyond.astype(np.float64)
        own = self.volumes[:, None] * body
        total = here @ forces + own
        moment = here @ cross(points, forces) + cross(self.centroids, own)
        if len(further[0]):
            there = further[2].astype(np.float64)
            total, moment = total + there @ further[1], moment + there @ cross(further[0], further[1])
        moment = moment - cross(self.centres, total)
        axes = tangents(self.normals)
        normal = np.einsum("pd,pd->p", total, self.normals)
        if axes.shape[1] == 1:
            bent = -moment
            twisting = np.zeros(len(bent))
        else:
            about = np.einsum("pd,pkd->pk", moment, axes)
            bent = np.stack([-about[:, 1], about[:, 0]], axis=1)
            twist = np.abs(np.einsum("pd,pd->p", moment, self.normals))
            reach = np.linalg.norm(self.rims, axis=2).max(axis=1)
            twisting = twist * reach / np.trace(self.inertia, axis1=1, axis2=2)
        slope = np.linalg.solve(self.inertia, bent[:, :, None])[:, :, 0]
        fibres = np.einsum("pek,pk->pe", self.rims, slope) + (normal / self.areas)[:, None]
        sideways = np.linalg.norm(total - normal[:, None] * self.normals, axis=1)
        shear = 1.5 * sideways / self.areas + twisting
        return np.stack([fibres.max(axis=1), fibres.min(axis=1), shear], axis=1)
