"""Why MuJoCo and statics disagree on an assembly without friction: found by experiment, never guessed."""

from __future__ import annotations

from dataclasses import replace

from mocca_robot.verdicts.physics import Verdict
from sim.scene import Compiled, with_timestep
from sim.stability import LIMITS, StabilityReport, contact_points, judged


def cause(tilted: Compiled, found: StabilityReport) -> str:
    """Return what explains that MuJoCo found otherwise than statics.

    'soft contacts': a much finer step, with contacts stiffer by its square, gives another verdict.
    'history': let go at once, or more gently, it ends otherwise.
    'none found' else.
    """
    settings = tilted.scene.settings
    finest, tried = found.timestep, f"{found.verdict} with a step of {found.timestep * 1e6:.3g} µs"
    if finest > 1.01 * settings.timestep / LIMITS.finest:
        if contact_points(tilted) <= LIMITS.finest_points:
            finest = settings.timestep / LIMITS.finest
            stiff = judged(with_timestep(tilted, finest), replace(LIMITS, finer=()))
            if stiff.verdict not in (found.verdict, Verdict.FAILED):
                return f"soft contacts: {stiff.verdict} with a step of {finest * 1e6:.3g} µs"
            if stiff.verdict is Verdict.FAILED:
                tried += f"; no verdict with {finest * 1e6:.3g} µs"
            else:
                found, tried = stiff, f"{stiff.verdict} with a step of {finest * 1e6:.3g} µs, too"
        else:
            tried += "; finer ones are left out with so many contact points"
    for gentle in (0.0, 0.4):
        other = judged(tilted, replace(LIMITS, gentle_s=gentle)).verdict
        if other not in (found.verdict, Verdict.FAILED):
            return f"history: {other} when let go over {gentle:g} s"
    return f"none found ({tried}; another way of letting go changes nothing)"
