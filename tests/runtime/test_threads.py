"""A solve keeps the linear algebra to one thread, and gives the others back to whoever calls it."""

import os
import subprocess
import sys

import numpy as np
import scipy.linalg  # noqa: F401  (its BLAS is one of those that are counted)
from threadpoolctl import threadpool_info, threadpool_limits

from benchmarks.cases import dome
from mocca_robot.runtime.threads import with_one_blas_thread
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.solver import interior_point
from mocca_robot.statics.solver.solvers import kkt_residual


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_inside_there_is_one_thread_and_outside_there_are_as_many_as_before():
    with threadpool_limits(limits=2, user_api="blas"):
        assert with_one_blas_thread(threads)() == {1}
        assert threads() == {2}


def test_large_problems_are_solved_so(monkeypatch):
    seen = []
    look = interior_point._solved

    def watched(*args):
        seen.append(threads())
        return look(*args)

    monkeypatch.setattr(interior_point, "_solved", watched)
    block = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    count = 40
    pairs = np.repeat([[k, k + 1] for k in range(count)], 4, axis=0)
    points = np.concatenate([block + np.array([0, 0, k]) for k in range(count)])
    up = np.tile([0.0, 0, 1], (len(pairs), 1))
    loads = np.zeros((count + 1, 6))
    loads[:, 2] = -1.0
    loads[:, 3:] = np.cross([0.5, 0.5, 0.0], [0, 0, -1.0])
    with threadpool_limits(limits=2, user_api="blas"):
        result = equilibrium(pairs, points, up, loads, fixed=[0], solver="interior_point")
    assert result.stands and seen == [{1}]


def test_chains_of_loads_have_the_same_answers_on_any_number_of_cores(monkeypatch):
    case = dome(36, 10)
    loads = np.array([case.system.scaled(case.wrenches(t)) for t in np.linspace(0.0, 0.3, 21)])
    c = np.zeros(len(case.pairs))
    monkeypatch.setattr(interior_point, "WORTH_THREADS", 100)
    found = []
    for cores in (1, 2, 3):
        monkeypatch.setattr(os, "cpu_count", lambda cores=cores: cores)
        found.append(interior_point.solve_interior_point(case.system, loads, c))
    for motions, forces in found[1:]:
        assert np.array_equal(motions, found[0][0]) and np.array_equal(forces, found[0][1])
    residuals = [kkt_residual(case.system.matrix, w, c, v, f) for w, v, f in zip(loads, *found[0], strict=True)]
    assert max(residuals) < 1e-8


def test_a_command_starts_with_one_thread_unless_told_otherwise():
    code = (
        "import sys; from mocca_robot.cli.parser import main\n"
        "try: main(['--version'])\nexcept SystemExit: pass\n"
        "import numpy, scipy.linalg; from threadpoolctl import threadpool_info\n"
        "print(*sorted({p['num_threads'] for p in threadpool_info() if p['user_api'] == 'blas'}))"
    )
    free = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    for extra, expected in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")):
        done = subprocess.run(
            [sys.executable, "-c", code], env=free | extra, capture_output=True, text=True, check=True
        )
        assert done.stdout.splitlines()[-1] == expected
