"""The house rules: imports run one way, starting is cheap, every module says what it is, libraries do not print."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("mocca_robot", "planners", "sim")
HEAVY = {"numpy", "scipy", "mujoco", "shapely", "trimesh", "networkx", "matplotlib", "clarabel", "rich", "yaml", "lxml"}
SPEAKERS = (
    "mocca_robot/cli/execute.py",
    "mocca_robot/ur/fake/serve.py",
    "mocca_robot/ur/fake/__main__.py",
    "mocca_robot/cli/__main__.py",
)
"""Modules that are commands: what they print is their product."""

FLOORS = (
    ("mocca_robot.errors", "mocca_robot.arrays", "mocca_robot.tolerances"),
    ("mocca_robot.assembly",),
    ("mocca_robot.geometry", "mocca_robot.runtime"),
    ("mocca_robot.contacts", "mocca_robot.statics.solver"),
    ("mocca_robot.joints",),
    ("mocca_robot.design", "mocca_robot.statics", "mocca_robot.motion"),
    ("mocca_robot.files", "mocca_robot.verdicts"),
    ("mocca_robot.fabrication", "mocca_robot.generators", "mocca_robot.plan"),
    ("mocca_robot.config", "mocca_robot.report", "mocca_robot.ur"),
    ("planners", "mocca_robot"),
    ("sim",),
    ("mocca_robot.cli",),
)
"""The rooms of the house, floor by floor: a room imports only from floors below its own."""

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


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def graph() -> dict[str, set[str]]:
    """Return which modules every module imports; a name that is itself a module counts as that module."""
    known = {module_of(p): p for p in MODULES}
    found: dict[str, set[str]] = {}
    for name, path in known.items():
        found[name] = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES:
                found[name] |= {f"{node.module}.{a.name}" for a in node.names} & set(known) or {str(node.module)}
            elif isinstance(node, ast.Import):
                found[name] |= {a.name for a in node.names} & set(known)
    return found


def room_of(module: str) -> str:
    """Return the room of a module: its place in `FLOORS`, the longest name that fits."""
    fitting = [room for floor in FLOORS for room in floor if module == room or module.startswith(f"{room}.")]
    assert fitting, f"{module} is in no room; give it one in FLOORS, above all that it imports"
    return max(fitting, key=len)


def test_imports_run_one_way() -> None:
    floor = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
    upwards = [
        f"{name} imports {target}"
        for name, targets in graph().items()
        for target in targets
        if room_of(name) != room_of(target) and floor[room_of(target)] >= floor[room_of(name)]
    ]
    assert not upwards


def test_no_modules_import_each_other_in_a_circle() -> None:
    imports = nx.DiGraph([(name, target) for name, targets in graph().items() for target in targets])
    assert not [sorted(circle) for circle in nx.strongly_connected_components(imports) if len(circle) > 1]


def test_the_house_stays_small_enough_to_know() -> None:
    assert len(FLOORS) <= 12
    assert sum(map(len, FLOORS)) <= 25
    in_rooms = {room_of(name) for name in graph()}
    assert in_rooms == {room for floor in FLOORS for room in floor}, "a room in FLOORS is empty"


def test_tests_mirror_the_rooms() -> None:
    rooms = {p.name for p in (ROOT / "mocca_robot").iterdir() if (p / "__init__.py").exists()} | {"planners", "sim"}
    folders = {p.parent.name for p in (ROOT / "tests").rglob("test_*.py")}
    assert folders <= rooms | {"project"}, "tests lie in folders that are no rooms"


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
