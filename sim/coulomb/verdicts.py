"""What the engine with friction says of states and tilts, as the simulation keeps it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly
from mocca_robot.statics.cases import critical_tilt, solve_case
from mocca_robot.statics.loads import LoadCase
from mocca_robot.verdicts.physics import StateVerdict, TiltVerdict, Verdict
from sim.coulomb.judge import CoulombVerdict, Rubbing, standing
from sim.coulomb.settle import COURSE, SettlingOutcome
from sim.coulomb.tilting import RESOLUTION_RAD, tilt_bracket
from sim.motion import reach

ENGINE = "coulomb 1"
"""The engine's name and which of its ways this is; raise the number where verdicts are reached in another way."""
VERDICTS = {
    SettlingOutcome.STANDS: Verdict.STANDS,
    SettlingOutcome.FALLS: Verdict.FELL,
    SettlingOutcome.UNDECIDED: Verdict.FAILED,
}
FINE_POINTS = 1500
"""Contact points from which on a tilt is searched half as narrowly: a run takes seconds."""
SHOWN, FRAMES, SHOWN_S = 0.3, 25, 0.5
"""A fall is drawn until a part has moved by this share of its size, in so many frames and seconds: the engine knows in
which way parts begin to move, not how fast."""


def state_verdict(rubbing: Rubbing, case: LoadCase) -> StateVerdict:
    """Return both verdicts on one state of `mocca_robot.statics.loads.state_cases`."""
    assembly = rubbing.graph.assembly
    statics = solve_case(rubbing.graph, case, rubbing.friction)
    found = standing(rubbing, case)
    free = np.flatnonzero(case.free)
    fell = found.settled.outcome is SettlingOutcome.FALLS
    times, poses = _drawn(assembly, found.settled.motions, free) if fell else ((), ())
    return StateVerdict(
        placed=assembly.parts[int(np.flatnonzero(case.present).max())].name,
        verdict=VERDICTS[found.settled.outcome],
        statics=statics.result.status,
        friction=rubbing.friction,
        reason=reason(found),
        moved=found.moved,
        statics_moved=statics.moving,
        times=times,
        poses=poses,
        parts=tuple(assembly.parts[p].name for p in free) if fell else (),
        engine=ENGINE,
    )


def tilt_verdict(rubbing: Rubbing, azimuth_rad: float) -> TiltVerdict:
    """Return the critical tilt towards one azimuth, beside that of statics."""
    guess = critical_tilt(rubbing.graph, azimuth_rad, rubbing.friction)
    fine = len(rubbing.whole.contacts.first) <= FINE_POINTS
    found = tilt_bracket(rubbing, azimuth_rad, guess, RESOLUTION_RAD if fine else 2.0 * RESOLUTION_RAD)
    fell = found.fell
    silent = fell is not None and fell.standing.settled.outcome is SettlingOutcome.UNDECIDED
    return TiltVerdict(
        azimuth_rad=azimuth_rad,
        critical_rad=found.critical_rad,
        statics_rad=guess,
        friction=rubbing.friction,
        moved=() if fell is None else fell.standing.moved,
        failed=(fell.place,) if fell is not None and silent else (),
        within_rad=found.within_rad,
        engine=ENGINE,
    )


def reason(found: CoulombVerdict) -> str:
    """Return the evidence in words."""
    settled = found.settled
    if settled.outcome is SettlingOutcome.STANDS:
        return f"at rest: all but {settled.unbalanced:.1g} of the load is balanced"
    if settled.outcome is SettlingOutcome.FALLS:
        way = f"{COURSE.gone:g} times as far as contacts give"
        return f"'{found.moved[0]}' goes: a contact has opened or slid {way}, and the load gains"
    return (
        f"no verdict after {settled.steps} steps: a contact has moved {settled.farthest:.0f} times as far as contacts "
        f"give, and {settled.unbalanced:.1g} of the load is not balanced"
    )


def _drawn(
    assembly: Assembly, motions: Array, free: IntArray
) -> tuple[tuple[float, ...], tuple[tuple[tuple[float, ...], ...], ...]]:
    """Return times (s) and the free parts' poses as a film of MuJoCo has them, from motions (N, dof) of any size."""
    d, far = assembly.dimension, reach(assembly)
    way = (np.linalg.norm(motions[:, :d], axis=1) + far * np.linalg.norm(motions[:, d:], axis=1)) / (2.0 * far)
    whole = motions[free] * SHOWN / way.max()
    shares = np.linspace(0.0, 1.0, FRAMES)
    about = np.array([p.centroid for p in assembly.parts])[free]
    poses = [_poses(about, share**2 * whole) for share in shares]  # as what falls does: ever faster
    return tuple(float(SHOWN_S * s) for s in shares), tuple(
        tuple(tuple(map(float, p)) for p in frame) for frame in poses
    )


def _poses(about: Array, motions: Array) -> Array:
    """Return (F, 3) shift and turn, or (F, 7) place of the centroid and quaternion (w first)."""
    if motions.shape[1] == 3:
        return motions
    quaternions = np.roll(Rotation.from_rotvec(motions[:, 3:]).as_quat(), 1, axis=1)
    return np.concatenate([about + motions[:, :3], quaternions], axis=1)
