"""What a design run leaves behind: built parts, joints, insertions, load cases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.friction import TANGENTIAL_RATIO, sprung
from mocca_robot.joints.joint import Joint


@dataclass(frozen=True, eq=False)
class Insertion:
    """How a part goes in: along `direction` (d,), unit, or any direction within `alpha_rad` of it."""

    part: str
    direction: Array
    alpha_rad: float


@dataclass(frozen=True)
class CaseResult:
    """A load case's infeasibility E/|w|² with the input's contacts and with the designed joints."""

    name: str
    infeasibility_before: float
    infeasibility_after: float


@dataclass(frozen=True)
class CountedFriction:
    """The friction that a design counts on: Coulomb's `coefficient` as declared, and `counted`, reduced for safety.

    `tangential_ratio` is k_t/k_n of the contacts with which it is judged.
    """

    coefficient: float
    counted: float
    tangential_ratio: float = TANGENTIAL_RATIO

    @property
    def declared(self) -> float:
        """Return the coefficient as declared, with the stiffness of contacts."""
        return sprung(self.coefficient, self.tangential_ratio)

    def data(self) -> dict[str, float]:
        """Return it for JSON; a stiffness that nobody gave is left out."""
        given = self.tangential_ratio != TANGENTIAL_RATIO
        ratio = {"tangential_ratio": self.tangential_ratio} if given else {}
        return {"coefficient": self.coefficient, "counted": self.counted, **ratio}

    @property
    def words(self) -> str:
        """Return it as it is told."""
        return f"counts on friction of {self.counted:.3g}, where it is {self.coefficient:g}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Design:
    """A designed assembly.

    Attributes:
        source: the assembly as it was handed in.
        assembly: the same parts with the joints cut in; exact geometry.
        joints: one per contact of the source, planar ones included.
        insertion: one per free part, in assembly order.
        load_cases: every case the goals ask for.
        seconds: wall time by stage.
        notes: what a reader should know: contacts too small for a joint, parts that need support, …
        friction: what it counts on; None for none.
    """

    source: Assembly
    assembly: Assembly
    joints: tuple[Joint, ...]
    insertion: tuple[Insertion, ...]
    load_cases: tuple[CaseResult, ...]
    seconds: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    friction: CountedFriction | None = None

    def __repr__(self) -> str:
        curved = sum(not j.is_planar for j in self.joints)
        worst = max((c.infeasibility_after for c in self.load_cases), default=0.0)
        joints = f"{len(self.joints)} joint{'' if len(self.joints) == 1 else 's'} ({curved} curved)"
        return f"<Design {self.assembly.name!r}: {self.assembly.said}, {joints}, infeasibility at most {worst:.2g}>"

    @property
    def judged_friction(self) -> float:
        """Return the coefficient with which it is judged: that which it counts on as declared, or none."""
        return 0.0 if self.friction is None else self.friction.declared
