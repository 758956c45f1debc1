"""Does an assembly, or a state of it, stand in physics?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.assembly import Assembly
from mocca_robot.verdicts.physics import Verdict
from sim.motion import Motion, reach, run
from sim.scene import Compiled, Scene, compile_scene, predict, with_timestep
from sim.settings import settings_for
from sim.shapes.contact_model import ContactModel

SHORTEST_FALL_S = 0.02
"""Of two falls, what is shorter counts as this long: runs are looked at no more often."""


@dataclass(frozen=True, kw_only=True)
class StabilityLimits:
    """When a part counts as moved, and a run as settled; lengths relative to the part's size.

    Attributes:
        moved: displacement, at any time, from which a part has moved. Block stacks 0.3° on the safe side of their
            critical tilt move by 1e-5 of their size, 0.3° beyond it by more than 1; in curved seats a part may
            come to rest again after sliding by a few thousandths, up to 0.3° beyond it.
        fallen: displacement at which a run ends early: no part comes back from there.
        speed: sizes per second below which a part rests. 0.05° beyond the critical tilt a part of 5 cm slides
            with 0.07 sizes per second after 0.4 s.
        gentle_s: velocities are removed for so long before the parts are let go; see `sim.motion.run`.
        first_look_s, longest_s: a run ends between the two after being let go, as soon as it rests.
        finer: steps to repeat a fall with, as divisors of the settings' step. Contacts give in proportion to the
            step's square, and what wedges under many times its weight falls when they give too much.
        same_fall: a fall is believed without the finest step when with two steps it takes equally long, up to this
            factor.
        told: displacement, as a multiple of `moved`, at which the run with the finest step ends: it decides alone, and
            what creeps because contacts give takes longest with it.
        finest: further divisor, for a fall where statics says that forces exist which hold. On a leaning tower the
            brackets of the critical tilt with a thirtieth (11.03 … 11.25°) and a hundredth (11.01 … 11.08°) overlap; a
            run with the latter takes three times as long.
        finest_points: contact points above which that run is left out: it takes many minutes.
    """

    moved: float = 0.005
    fallen: float = 0.05
    speed: float = 2e-3
    gentle_s: float = 0.1
    first_look_s: float = 0.4
    longest_s: float = 4.0
    finer: tuple[float, ...] = (3.0, 10.0)
    same_fall: float = 1.5
    told: float = 2.0
    finest: float = 30.0
    finest_points: int = 1500


LIMITS = StabilityLimits()


@dataclass(frozen=True, eq=False, kw_only=True)
class StabilityReport:
    """One run's verdict with its evidence.

    Attributes:
        verdict: stands, fell or failed.
        reason: for people; names what failed or which part moved farthest.
        moved: names of parts that moved by more than the limit, in assembly order.
        max_displacement: farthest displacement bound of any part, metres.
        max_share: the same relative to the part's size: the margin to `StabilityLimits.moved`.
        final_speed: fastest part at the end, m/s.
        duration: simulated seconds.
        steps: of the simulation.
        timestep: seconds; of the run that decided, smaller than the settings' where a fall had to be confirmed.
        motion: the sampled run.
    """

    verdict: Verdict
    reason: str
    moved: tuple[str, ...]
    max_displacement: float
    max_share: float
    final_speed: float
    duration: float
    steps: int
    timestep: float
    motion: Motion

    @property
    def stands(self) -> bool:
        """Return whether the verdict is that it stands."""
        return self.verdict is Verdict.STANDS


def free_scene(
    assembly: Assembly,
    model: ContactModel,
    *,
    present: BoolArray | None = None,
    held: BoolArray | None = None,
    gravity: Array | None = None,
    friction: float = 0.0,
) -> Scene:
    """Return the scene in which every part that is there and not held is left alone."""
    there = np.ones(len(assembly.parts), dtype=np.bool_) if present is None else present
    fixed = assembly.fixed if held is None else held
    settings = settings_for(assembly, friction, int((there & ~fixed).sum()))
    return Scene(
        assembly=assembly,
        contact_model=model,
        present=there,
        held=fixed,
        gravity=assembly.gravity if gravity is None else gravity,
        settings=settings,
    )


def stability(scene: Scene, limits: StabilityLimits = LIMITS, doubted: bool = False) -> StabilityReport:
    """Return whether `scene` stands, by letting it go; see `confirmed` for `doubted`."""
    return judged(compile_scene(scene), limits, doubted)


def judged(compiled: Compiled, limits: StabilityLimits = LIMITS, doubted: bool = False) -> StabilityReport:
    """Return the verdict on a compiled scene; the model can be used again. See `confirmed` for `doubted`."""
    return confirmed(compiled, at_once(compiled, limits), limits, doubted)


def confirmed(
    compiled: Compiled, found: StabilityReport, limits: StabilityLimits = LIMITS, doubted: bool = False
) -> StabilityReport:
    """Return the verdict on a scene of which `found` is what `at_once` says.

    That it stands is believed at once. That it fell, or gave no verdict, is confirmed with finer steps and stiffer
    contacts: the last of them decides, or two falls that take equally long.

    A fall is `doubted` where statics knows forces that hold. Then it has to survive all the finer steps and the
    finest, and must not be a creep that gets slower with the step: what falls takes equally long with every step;
    what only creeps, because contacts give, takes n times longer with 1/n of the step and in the limit of small steps
    stands. The border is √n.
    """
    first = found
    for divisor in limits.finer:
        if found.stands:
            return found
        before = found
        ends = limits if divisor != limits.finer[-1] else _ends_early(limits)
        found = at_once(_finer(compiled, divisor), ends)
        if not doubted and _same_fall(before, found, limits):
            return found
    return _undoubted(compiled, first, found, limits) if doubted and limits.finer else found


def _undoubted(
    compiled: Compiled, first: StabilityReport, fine: StabilityReport, limits: StabilityLimits
) -> StabilityReport:
    """Return what remains of a fall by the finest step, or by how much slower it gets with finer ones."""
    if fine.verdict is not Verdict.FELL:
        return fine
    if first.verdict is Verdict.FELL and _creeps(compiled, first, fine, limits):
        return _at_rest_in_the_limit(fine, first)
    if contact_points(compiled) > limits.finest_points:
        return fine
    shown = _creep_factor(limits.finer[-1], limits.finest) * _told_after(compiled, fine, limits)
    ends = replace(_ends_early(limits), longest_s=1.1 * max(shown, limits.first_look_s))
    finest = at_once(_finer(compiled, limits.finest), ends)
    if finest.motion.failure is None and not finest.stands and _creeps(compiled, fine, finest, limits):
        return _at_rest_in_the_limit(finest, fine)
    return finest


def contact_points(compiled: Compiled) -> int:
    """Return about how many contact points the scene has at most."""
    return predict(compiled.scene).contacts


def _finer(compiled: Compiled, divisor: float) -> Compiled:
    return with_timestep(compiled, compiled.scene.settings.timestep / divisor)


def _ends_early(limits: StabilityLimits) -> StabilityLimits:
    return replace(limits, fallen=limits.told * limits.moved)


def _creeps(compiled: Compiled, coarse: StabilityReport, fine: StabilityReport, limits: StabilityLimits) -> bool:
    """Return whether the same displacement takes longer in proportion to the number of steps."""
    factor = _creep_factor(fine.timestep, coarse.timestep)
    return _told_after(compiled, fine, limits) > factor * _told_after(compiled, coarse, limits)


def _creep_factor(few: float, many: float) -> float:
    return float(np.sqrt(many / few))


def _told_after(compiled: Compiled, found: StabilityReport, limits: StabilityLimits) -> float:
    """Return the seconds since it was let go until a part has moved tellingly; infinite when none has."""
    size = 2.0 * reach(compiled.scene.assembly)[found.motion.parts]
    share = (found.motion.displacement / size).max(axis=1) / (limits.told * limits.moved)
    if not (share >= 1.0).any():
        return np.inf
    late = int(np.argmax(share >= 1.0))
    t0, t1 = found.motion.times[max(0, late - 1)], found.motion.times[late]
    s0, s1 = share[max(0, late - 1)], share[late]
    when = t1 if s1 <= s0 else t0 + (t1 - t0) * (1.0 - s0) / (s1 - s0)
    return max(float(when) - limits.gentle_s, SHORTEST_FALL_S)


def _at_rest_in_the_limit(fine: StabilityReport, coarse: StabilityReport) -> StabilityReport:
    shown = " and ".join(
        f"{run.max_displacement * 1e3:.3g} mm in {run.duration:.2f} s with steps of {run.timestep * 1e6:.3g} µs"
        for run in (coarse, fine)
    )
    words = f"stands in the limit of small steps: it creeps, the slower the finer the step ({shown})"
    return replace(fine, verdict=Verdict.STANDS, reason=words, moved=())


def _same_fall(coarse: StabilityReport, fine: StabilityReport, limits: StabilityLimits) -> bool:
    if not (coarse.verdict is fine.verdict is Verdict.FELL):
        return False
    slow = max(coarse.duration, fine.duration) - limits.gentle_s
    fast = min(coarse.duration, fine.duration) - limits.gentle_s
    return min(coarse.max_share, fine.max_share) >= limits.fallen and slow <= limits.same_fall * max(
        fast, SHORTEST_FALL_S
    )


def at_once(compiled: Compiled, limits: StabilityLimits = LIMITS) -> StabilityReport:
    """Return what one run with the scene's own step says; a fall may be owed to contacts that give."""
    assembly = compiled.scene.assembly
    size = 2.0 * reach(assembly)[compiled.parts]

    def enough(time: float, displacement: Array, speed: Array) -> bool:
        if (displacement > limits.fallen * size).any():
            return True
        return time >= limits.gentle_s + limits.first_look_s and bool((speed <= limits.speed * size).all())

    longest = limits.gentle_s + limits.longest_s
    motion = run(compiled, longest, enough, samples=round(longest / 0.02), gentle_s=limits.gentle_s)
    return report(assembly, motion, compiled.scene.settings.timestep, limits)


def report(assembly: Assembly, motion: Motion, timestep: float, limits: StabilityLimits = LIMITS) -> StabilityReport:
    """Return the verdict on a run with steps of `timestep` seconds that is over."""
    size = 2.0 * reach(assembly)[motion.parts]
    # The farthest a part has been: one that rocks back has let go all the same.
    peak = motion.displacement.max(axis=0)
    share = peak / size
    moved = tuple(assembly.parts[p].name for p, s in zip(motion.parts, share) if s > limits.moved)
    resting = bool((motion.speed[-1] <= limits.speed * size).all())
    if motion.failure is not None:
        verdict, reason = Verdict.FAILED, f"after {motion.times[-1]:.3f} s: {motion.failure}"
    elif moved:
        farthest = int(share.argmax())
        name = assembly.parts[motion.parts[farthest]].name
        verdict, reason = Verdict.FELL, f"'{name}' moved by {peak[farthest] * 1e3:.3g} mm"
    elif not resting:
        verdict, reason = Verdict.FAILED, f"still moving after {motion.times[-1]:.1f} s, but not yet far"
    else:
        verdict, reason = Verdict.STANDS, f"at rest after {motion.times[-1]:.2f} s"
    return StabilityReport(
        verdict=verdict,
        reason=reason,
        moved=moved,
        max_displacement=float(peak.max(initial=0.0)),
        max_share=float(share.max(initial=0.0)),
        final_speed=float(motion.speed[-1].max(initial=0.0)),
        duration=float(motion.times[-1]),
        steps=motion.steps,
        timestep=timestep,
        motion=motion,
    )
