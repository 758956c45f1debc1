"""What is said about parts with Coulomb friction: stands, stands only clamped, falls, undecided; and what shows it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from mocca_robot.arrays import Array
from mocca_robot.statics.solution import EquilibriumResult


class Standing(StrEnum):
    """Verdict with friction."""

    STANDS = "stands"
    STANDS_ONLY_CLAMPED = "stands_only_clamped"
    """Some forces would hold the load, but nothing brings them about: it slides out, or thousands of times as far as
    its contacts give, unless it is clamped."""
    FALLS = "falls"
    UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False, kw_only=True)
class FrictionVerdict:
    """One load on contacts with friction.

    Attributes:
        standing: the verdict.
        forces: (C, d) contact forces on part j, newtons; unique where it stands, where it falls those of the fall.
        displacements: (N, dof) how far parts give until they rest [metres at their reference point; radians]; zero
            where they do not rest.
        slip: (C, d) how far part j slides over part i at every point, metres; where it falls, per second as `motions`.
        motions: (N, dof) how it falls [velocity at the reference point; angular velocity], per unit of unbalanced
            force, as of Eq. 7; zero where it stands.
        unbalanced: share of the load that no contact force balances: tiny where it stands.
        travel: how far parts slide, over how far contacts are pressed together.
        complementarity: largest violation of Coulomb's law, relative: forces outside cones, forces across gaps, parts
            that penetrate, slip that sticks or that friction does not oppose, lift. NaN where the fall is known
            from Eq. 8 alone: no forces within the cones hold the load.
        clamped_forces: (C, d) forces within the cones that would hold it, where it stands only clamped.
        bound: the frictional equilibrium of Eq. 8, where it was asked for: whether some forces would hold the load.
        programs: second-order cone programs solved.
        shares: what each step of time left unbalanced, shortest first, where rest was not found at once.
        state: (n,) for `start` of a similar load.
    """

    standing: Standing
    forces: Array
    displacements: Array
    slip: Array
    motions: Array
    unbalanced: float
    complementarity: float
    travel: float = 1.0
    clamped_forces: Array | None = None
    bound: EquilibriumResult | None = None
    programs: int = 0
    shares: tuple[float, ...] = ()
    state: Array | None = None

    @property
    def stands(self) -> bool:
        """Return whether it stands without being clamped."""
        return self.standing is Standing.STANDS
