"""The house rules: imports run one way, starting is cheap, every module says what it is, libraries do not print."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("mocca_robot", "planners", "sim")
HEAVY = {"numpy", "scipy", "mujoco", "shapely", "trimesh", "networkx", "matplotlib", "clarabel", "rich", "yaml", "lxml"}
SPEAKERS = ("mocca_robot/ur/commands.py", "mocca_robot/ur/fake/__main__.py", "mocca_robot/cli/__main__.py")
"""Modules that are commands: what they print is their product."""

MODULES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imported(path: Path) -> Iterator[str]:
    """Yield the full names that a module imports anywhere, also inside functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name_of(path)} imports relatively; name the module in full"
            yield node.module or ""


def forbidden(path: Path) -> tuple[str, ...]:
    """Return the packages that a module must not know."""
    name = name_of(path)
    if name.startswith("mocca_robot/cli/"):
        return ()
    if name.startswith("mocca_robot/"):
        return ("planners", "sim", "mocca_robot.cli")
    if name.startswith("planners/"):
        return ("sim", "mocca_robot.cli")
    if name.startswith("sim/"):
        return ("mocca_robot.cli",)
    return ("mocca_robot.cli",)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_run_one_way(path: Path) -> None:
    for module in imported(path):
        for package in forbidden(path):
            assert module != package and not module.startswith(f"{package}."), f"{name_of(path)} imports {module}"


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_every_module_says_what_it_is(path: Path) -> None:
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), f"{name_of(path)} has no docstring"


@pytest.mark.parametrize("path", [p for p in MODULES if name_of(p) not in SPEAKERS], ids=name_of)
def test_libraries_do_not_print(path: Path) -> None:
    calls = (n for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.Call))
    printing = [n.lineno for n in calls if isinstance(n.func, ast.Name) and n.func.id == "print"]
    assert not printing, f"{name_of(path)} prints in lines {printing}; the command line speaks, libraries return"


@pytest.mark.parametrize(
    "statement",
    [
        "import mocca_robot",
        "import planners",
        "from mocca_robot.cli.parser import build_parser; build_parser().format_help()",
        "from mocca_robot.cli.parser import main\ntry: main(['run', '--help'])\nexcept SystemExit: pass",
        "from mocca_robot.cli.parser import main\ntry: main(['execute', '--help'])\nexcept SystemExit: pass",
    ],
)
def test_starting_loads_nothing_heavy(statement: str) -> None:
    code = f"import sys\n{statement}\nprint('loaded:', *sorted({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.splitlines()[-1] == "loaded:", done.stdout.splitlines()[-1]


def test_public_names_are_all_there() -> None:
    import mocca_robot
    import planners
    import sim
    import sim.studies

    for package in (mocca_robot, planners, sim, sim.studies):
        for name in package.__all__:
            assert getattr(package, name) is not None
        with pytest.raises(AttributeError):
            package.no_such_name  # noqa: B018
    assert set(mocca_robot.__all__) <= set(dir(mocca_robot))


def test_the_robot_knows_plans_never_planners() -> None:
    for path in (ROOT / "mocca_robot" / "ur").rglob("*.py"):
        assert not [m for m in imported(path) if m.split(".")[0] in ("planners", "sim")], name_of(path)
