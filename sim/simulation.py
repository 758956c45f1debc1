"""What physics says about an assembly, beside what statics says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mocca_robot.tolerances import tilts_apart
from sim.insertion.trial import InsertionTrial
from sim.robust import RobustReport
from sim.states import StateResult
from sim.tilt import TiltReport


@dataclass(frozen=True)
class ConeSummary:
    """The cone that a part's insertion trials cover, radians; see `sim.insertion.directions.InsertionCone`."""

    part: str
    axis: tuple[float, ...]
    realised_rad: float
    tried_rad: float


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """What physics says, beside what statics says.

    Attributes:
        name: of the assembly.
        engine: 'mujoco 3.17.0'.
        dimension: 2 or 3.
        states: one per free part, in assembly order.
        tilt: by friction, then azimuth.
        cones, insertion: per part; every insertion trial.
        robust: success rates with confidence intervals; None when not asked for.
        seconds: wall time by stage.
        notes: near misses, parts inserted with their neighbours held, parts without a free direction.
        interrupted: Ctrl-C came before all trials were done.
    """

    name: str
    engine: str
    dimension: int
    states: tuple[StateResult, ...] = ()
    tilt: tuple[TiltReport, ...] = ()
    cones: tuple[ConeSummary, ...] = ()
    insertion: tuple[InsertionTrial, ...] = ()
    robust: RobustReport | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    interrupted: bool = False

    @property
    def disagreements(self) -> tuple[str, ...]:
        """Return where physics and statics contradict each other, in words; empty when they agree on everything."""
        out = [
            f"state after '{s.placed}': MuJoCo {s.verdict}, statics {s.statics}{_because(s.cause)}"
            for s in self.states
            if not s.agrees
        ]
        for t in self.tilt:
            if t.failed:
                out.append(f"{_tilt_words(t)}, {len(t.failed)} runs gave no verdict")
            elif self._apart(t):
                out.append(_tilt_words(t) + _because(t.cause))
        return tuple(out)

    def _apart(self, tilt: TiltReport) -> bool:
        critical, statics, within = np.rad2deg([tilt.critical_rad, tilt.statics_rad, tilt.within_rad]).tolist()
        return tilts_apart(critical, statics, within, self.dimension)

    @property
    def needs_support(self) -> tuple[str, ...]:
        """Return the parts after whose placing the assembly does not stand by itself."""
        return tuple(s.placed for s in self.states if not s.stands)


def _tilt_words(tilt: TiltReport) -> str:
    found, expected = np.rad2deg(tilt.critical_rad), np.rad2deg(tilt.statics_rad)
    where = f"tilt towards {np.rad2deg(tilt.azimuth_rad):.0f}° with friction {tilt.friction:g}"
    return f"{where}: MuJoCo {found:.2f}°, statics {expected:.2f}°"


def _because(cause: str) -> str:
    return f"; cause: {cause}" if cause else ""
