"""CONTRIBUTING.md: the files and names it mentions exist, and its worked examples work as printed."""

from __future__ import annotations

import importlib
import re
import shlex
import sys
import textwrap
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
import yaml

from mocca_robot.cli.parser import build_parser
from mocca_robot.statics.solver.solvers import SolverFailed, kkt_residual, solve_daqp
from mocca_robot.ur.grippers import ROBOTIQ

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
CODE = {
    path: textwrap.dedent(text)
    for path, text in re.findall(r"<!-- (?:file|into): (\S+) -->\n *```python\n(.*?)\n *```", PAGE, re.DOTALL)
}


def made(path: str, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what the page's code for `path` defines: a new module, importable, or an addition to one that exists."""
    name = path.removesuffix(".py").replace("/", ".")
    if (ROOT / path).exists():
        space = dict(vars(importlib.import_module(name)))
        exec(compile(CODE[path], path, "exec"), space)
        return space
    module = ModuleType(name)
    exec(compile(CODE[path], path, "exec"), vars(module))
    monkeypatch.setitem(sys.modules, name, module)
    return vars(module)


def run_tests(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    tests = [value for name, value in made(path, monkeypatch).items() if name.startswith("test_")]
    assert tests
    for test in tests:
        test()


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`((?:[\w.-]+/)+[\w.]*|\w+\.(?:md|toml))`", PAGE)) - set(CODE)))
def test_files_that_the_page_names_exist(path: str) -> None:
    assert (ROOT / path).exists()


@pytest.mark.parametrize(("name", "path"), sorted(set(re.findall(r"`(\w+)`\s+in\s+`([\w/.]+)`", PAGE))))
def test_names_are_where_the_page_says(name: str, path: str) -> None:
    assert re.search(rf"\b{name}\b", (ROOT / path).read_text(encoding="utf-8"))


def test_commands_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    lines = [line.strip() for text in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) for line in text.splitlines()]
    for line in lines:
        if line.startswith(".venv/bin/mocca-robot "):
            build_parser().parse_args(shlex.split(line, comments=True)[1:])
        elif not line:
            continue
        elif line.startswith("make "):
            assert re.search(rf"^{line.split()[1]}:", makefile, re.MULTILINE), line
        else:
            assert line.startswith(".venv/bin/python "), line


def test_pythons_are_the_same_in_metadata_and_workflow() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    workflow = yaml.safe_load((ROOT / ".github/workflows/test.yml").read_text(encoding="utf-8"))
    tried = workflow["jobs"]["test"]["strategy"]["matrix"]["python"]
    named = re.findall(r"Python :: (3\.\d+)", " ".join(project["classifiers"]))
    assert tried == named
    assert project["requires-python"] == f">={tried[0]}"


def test_the_joint_family_works(monkeypatch: pytest.MonkeyPatch) -> None:
    made("mocca_robot/joints/vee.py", monkeypatch)
    run_tests("tests/joints/test_vee.py", monkeypatch)


def test_the_solver_finds_the_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    solve = made("mocca_robot/statics/solver/solvers.py", monkeypatch)["solve_nnls"]
    rng = np.random.default_rng(0)
    b, w, free = sp.csr_array(rng.normal(size=(8, 6))), rng.normal(size=6), np.zeros(8)
    v, f = solve(b, w, free)
    assert kkt_residual(b, w, free, v, f) < 1e-9
    assert v == pytest.approx(solve_daqp(b, w, free)[0], abs=1e-8)
    with pytest.raises(SolverFailed):
        solve(b, w, np.ones(8))


def test_the_gripper_sends_its_own_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ROBOTIQ, "2f140", made("mocca_robot/ur/grippers.py", monkeypatch)["Robotiq2F140"])
    run_tests("tests/ur/test_wide_fingers.py", monkeypatch)
