"""MuJoCo: steps per second over threads, insertion trials over processes, and every configuration's insertions."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from benchmarks.measurement import Measurement, ToolAnswer, measure
from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.config.config import load
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.executors import executor
from mocca_robot.statics.cases import critical_tilt
from planners.cone_joints.designer import design
from sim.questions import Questions
from sim.scene import Compiled
from sim.shapes.contact_model import contact_model, telling_rays
from sim.simulate import simulate
from sim.stability import contact_points
from sim.tilt import detailed_scene, tilt_scene

CONFIGS = Path(__file__).parents[1] / "configs"
NAMES = ("leaning_tower_20", "horse", "pavilion", "igloo")
TOO_MANY_TRIALS = ("igloo",)
"""`insertions` has these; 920 trials for every number of processes would take half an hour."""
CLEARANCES = (0.0, 1e-4, 3e-4)
"""Metres by which the driven part is made smaller all around."""
STEPS = 400
"""Of each thread; MuJoCo lets go of Python's lock for all of them at once."""


def threads_tried() -> tuple[int, ...]:
    """Return 1, 2, 4, … up to the number of cores, and twice that."""
    cores = os.cpu_count() or 1
    return tuple(2**k for k in range(12) if 2**k <= 2 * cores)


def physics(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield steps, then insertion trials per second, by wall clock; designs come first and are not measured."""
    for name in NAMES[:1] if quick else NAMES:
        if only is not None and only not in name:
            continue
        config = load(CONFIGS / f"{name}.yaml")
        built = design(config.assembly, config.joints).design
        ways = {i.part: i.direction for i in built.insertion}
        compiled = _scene(built.assembly)
        for threads in threads_tried():
            run = partial(_steps, compiled, threads)
            yield measure("physics", f"{name} steps-{threads}", "mujoco", run, limit_s=120.0, repeats=1)
        if name not in TOO_MANY_TRIALS:
            for threads in threads_tried():
                trials: Callable[[], ToolAnswer] = partial(_trials, built.assembly, ways, threads)
                yield measure(
                    "physics", f"{name} insertions-{threads}", "mujoco", trials, limit_s=300.0, repeats=1, spawns=True
                )


def insertions(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield a row per configuration: insertions inside its cones and just outside, by clearance; flat ones when quick.

    A row agrees when all inside succeed, within the force that the hand's error and 5 % of the weight allow, and none
    outside do.
    """
    for path in sorted(CONFIGS.glob("*.yaml")):
        if only is not None and only not in path.stem:
            continue
        config = load(path)
        if quick and config.assembly.dimension == 3:
            continue
        built = design(config.assembly, config.joints, insertion=dict(config.insertion) or None).design
        run = partial(_insertions, built.assembly, {i.part: i.direction for i in built.insertion})
        yield measure("insertions", path.stem, "mujoco", run, limit_s=3600.0, repeats=1, spawns=True)


def _insertions(assembly: Assembly, ways: dict[str, Array]) -> ToolAnswer:
    asked = Questions(stages=("insertion",), clearances=CLEARANCES)
    with executor() as processes:
        trials = simulate(assembly, ways, asked, processes=processes).trials
    inside = [t for t in trials if t.inside]
    outside = [t for t in trials if not t.inside]
    failed = [t for t in inside if not t.succeeded]
    passed = sum(t.succeeded for t in outside)
    said = [f"{len(inside) - len(failed)} of {len(inside)} inside", f"{passed} of {len(outside)} outside"]
    for clearance in CLEARANCES:
        mine = [t.force_share for t in inside if t.clearance == clearance]
        said.append(f"{clearance * 1e3:g} mm: force at most {max(mine, default=0.0):.0%} of what is allowed")
    said += [f"'{t.part}' {t.kind}, {t.clearance * 1e3:g} mm, {t.below}: {t.reason}" for t in failed[:5]]
    return ToolAnswer(f"{'DISAGREE' if failed or passed else 'agree'}: {'; '.join(said)}")


def _scene(assembly: Assembly) -> Compiled:
    """Return the finished assembly as the tilt table has it without friction: large ones with chosen contact points."""
    graph = PartsGraph.of(assembly)
    contacts = graph.contacts
    rays = telling_rays(assembly, contacts, 0.0)
    if rays is None:
        return tilt_scene(assembly, contact_model(assembly, contacts))
    return detailed_scene(graph, rays, 0.0, critical_tilt(graph, 0.0, 0.0))


def _steps(compiled: Compiled, threads: int) -> ToolAnswer:
    import mujoco

    data = [mujoco.MjData(compiled.model) for _ in range(threads)]

    def advance(one: object) -> None:
        mujoco.mj_step(compiled.model, one, STEPS)

    started = time.perf_counter()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(advance, data))
    rate = threads * STEPS / (time.perf_counter() - started)
    model = compiled.model
    size = f"{model.nbody - 1} parts, {contact_points(compiled)} contact points"
    return ToolAnswer(f"{rate:.0f} steps/s, {threads} threads; {size}")


def _trials(assembly: Assembly, ways: dict[str, Array], jobs: int) -> ToolAnswer:
    asked = Questions(stages=("insertion",), clearances=(0.0,), errors=(), threads=jobs)
    with executor(jobs) as processes:
        list(processes.map(_awake, range(jobs)))
        started = time.perf_counter()
        found = simulate(assembly, ways, asked, processes=processes)
        rate = len(found.trials) / (time.perf_counter() - started)
    return ToolAnswer(f"{rate:.1f} trials/s, {jobs} processes, {len(found.trials)} trials")


def _awake(number: int) -> int:
    """Return `number` once everything that a trial needs is imported; slow enough to need a process of its own."""
    time.sleep(0.5)
    return number
