"""Questions about what has been computed: how a tilt is carried, and what happens when everything is let go."""

from __future__ import annotations

from typing import Any

import numpy as np

from mocca_robot.cli.studio import seen
from mocca_robot.cli.studio.compute import Computed
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at, solve_case
from mocca_robot.statics.loads import tilted_gravity

SHOWN_FALL = 0.4
"""Displacement, in assembly sizes, at which a fall has been seen."""
LONGEST_S = 1.6
FRAMES = 80


def _graph(computed: Computed, which: str) -> PartsGraph:
    return computed.after if which == "result" and computed.after is not None else computed.before


def tilted(computed: Computed, which: str, angle_deg: float, azimuth_deg: float) -> dict[str, Any]:
    """Return the statics of the finished structure on ground that is tilted: see `seen.case_data`."""
    graph = _graph(computed, which)
    case = case_at(graph.assembly, float(np.deg2rad(angle_deg)), float(np.deg2rad(azimuth_deg)))
    return seen.case_data(graph, solve_case(graph, case, computed.friction))


def let_go(computed: Computed, which: str, angle_deg: float, azimuth_deg: float) -> dict[str, Any]:
    """Return what MuJoCo sees when the finished structure is let go: times (s) and poses of the free parts.

    A pose is x, y and a turn of flat parts; a position and a quaternion (w first) of solid ones.
    """
    from sim.motion import run
    from sim.scene import compile_scene
    from sim.shapes.contact_model import contact_model
    from sim.stability import LIMITS, free_scene

    graph = _graph(computed, which)
    assembly, mu = graph.assembly, computed.config.simulate.friction
    gravity = tilted_gravity(assembly.gravity, float(np.deg2rad(angle_deg)), float(np.deg2rad(azimuth_deg)))
    model = contact_model(assembly, graph.contacts, mu)
    compiled = compile_scene(free_scene(assembly, model, gravity=gravity, friction=mu))

    def plain(time: float, displacement: Any, speed: Any) -> bool:
        return bool(displacement.max(initial=0.0) > SHOWN_FALL * assembly.size)

    motion = run(compiled, LONGEST_S, plain, samples=FRAMES, gentle_s=LIMITS.gentle_s)
    farthest = float(motion.displacement.max(initial=0.0))
    fell = farthest > LIMITS.fallen * assembly.size
    words = "It falls." if fell else f"It stays: no part moves by more than {farthest * 1e3:.2g} mm."
    if motion.failure is not None:
        words = f"MuJoCo gave up: {motion.failure}"
    return {
        "parts": motion.parts.tolist(),
        "times": seen.numbers(motion.times, 5),
        "poses": seen.numbers(motion.poses, 6),
        "fell": fell,
        "words": words,
        "which": which,
    }
