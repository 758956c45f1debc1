"""The house rules: imports run one way, starting is cheap, every module says what it is, libraries do not print."""

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import networkx as nx
import pytest
from house import FLOORS, LINE, PACKAGES, imports, modules, room_of

ROOT = Path(__file__).parents[2]
HEAVY = {"numpy", "scipy", "mujoco", "shapely", "trimesh", "networkx", "matplotlib", "clarabel", "rich", "yaml", "lxml"}
SPEAKERS = (
    "mocca_robot/cli/execute.py",
    "mocca_robot/ur/fake/serve.py",
    "mocca_robot/ur/fake/__main__.py",
    "mocca_robot/cli/__main__.py",
)
"""Modules that are commands: what they print is their product."""

MODULES = list(modules().values())


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


def test_imports_run_one_way() -> None:
    floor = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
    upwards = [
        f"{name} imports {target}"
        for name, targets in imports().items()
        for target in targets
        if room_of(name) != room_of(target) and floor[room_of(target)] >= floor[room_of(name)]
    ]
    assert not upwards


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = nx.DiGraph([(name, target) for name, targets in imports().items() for target in targets])
    assert not [sorted(circle) for circle in nx.strongly_connected_components(graph) if len(circle) > 1]


def test_the_house_stays_small_enough_to_know() -> None:
    assert len(FLOORS) <= 12
    assert sum(map(len, FLOORS)) <= 26
    in_rooms = {room_of(name) for name in imports()}
    assert in_rooms == {room for floor in FLOORS for room in floor}, "a room in FLOORS is empty"
    assert set(LINE) <= in_rooms


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


def test_a_flat_design_loads_what_it_needs(tmp_path: Path) -> None:
    command = ["design", str(ROOT / "configs" / "stack.yaml"), "-o", str(tmp_path)]
    code = f"import sys\nfrom mocca_robot.cli.parser import main\nassert main({command!r}) == 0\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert {"trimesh", "mujoco", "numba", "clarabel", "viser"}.isdisjoint(done.stdout.splitlines()[-1].split())


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


def test_there_is_one_tangent_frame() -> None:
    """Seeding a frame with the axis a direction leans on least is `geometry.frames`' business alone."""
    seeded = [name_of(p) for p in MODULES if re.search(r"eye\(3\)\[.*argmin", p.read_text(encoding="utf-8"))]
    assert seeded == ["mocca_robot/geometry/frames.py"]


MOST_IN_A_ROW = 5
"""Arguments that a reader tells apart by their place; more are named."""


def classes_of(path: Path) -> set[str]:
    return {n.name for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.ClassDef)}


def test_long_records_name_their_fields() -> None:
    everywhere = [p for folder in (*PACKAGES, "benchmarks", "docs", "tests") for p in (ROOT / folder).rglob("*.py")]
    known = {name for p in everywhere for name in classes_of(p)}
    found = []
    for path in everywhere:
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(call, ast.Call) or len(call.args) <= MOST_IN_A_ROW:
                continue
            name = ast.unparse(call.func).split(".")[-1]
            if name in known or name == "cls":
                found.append(f"{name_of(path)}:{call.lineno} {name}")
    assert not found, "name the fields; records of more than five take kw_only=True"


def test_a_class_name_tells_one_thing() -> None:
    places: dict[str, list[str]] = {}
    for path in (*MODULES, *(ROOT / "benchmarks").rglob("*.py")):
        for name in classes_of(path):
            places.setdefault(name, []).append(name_of(path))
    assert not {name: where for name, where in places.items() if len(where) > 1}


def wraps_contacts(node: ast.AST) -> bool:
    """Return whether `node` makes planar joints of contacts, one after the other."""
    if isinstance(node, (ast.ListComp, ast.SetComp, ast.GeneratorExp)):
        return isinstance(node.elt, ast.Call) and called(node.elt) == "planar"
    return isinstance(node, ast.Call) and called(node) == "map" and "planar" in map(ast.unparse, node.args)


def called(call: ast.Call) -> str:
    return ast.unparse(call.func).split(".")[-1]


def test_only_the_parts_graph_says_how_parts_can_move() -> None:
    """Contacts become planar joints, and normals part motion cones, in one place; everybody else reads the graph."""
    home = "mocca_robot/motion/parts_graph.py"
    # Shapes that joints could take are no joints yet: the catalogue centres parts among them.
    derives = {home, "mocca_robot/geometry/cones.py", "planners/cone_joints/catalogue.py"}
    for path in MODULES:
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        wrapping = [n.lineno for n in nodes if isinstance(n, ast.expr) and wraps_contacts(n)]
        assert name_of(path) == home or not wrapping, f"{name_of(path)}: use PartsGraph.joints in lines {wrapping}"
        cones = [n.lineno for n in nodes if isinstance(n, ast.Call) and called(n) in ("largest_cone", "PartMotion")]
        assert name_of(path) in derives or not cones, f"{name_of(path)}: use PartsGraph.motion in lines {cones}"
    (wrapped,) = ast.parse("[planar(c) for c in report.contacts]").body
    assert isinstance(wrapped, ast.Expr) and wraps_contacts(wrapped.value)


SMALL = 1e-3
INPUT_LIMITS = ("number", "at_least", "Key")
"""Calls whose numbers are the limits of a key that somebody writes."""


def small_numbers_without_name(source: str) -> list[int]:
    """Return the lines on which a small number stands inside a function: neither constant, field nor default."""
    found = []

    def visit(node: ast.AST, inside: bool) -> None:
        if isinstance(node, ast.Constant) and isinstance(node.value, float) and 0.0 < node.value <= SMALL and inside:
            found.append(node.lineno)
        if isinstance(node, ast.arguments):
            return
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in INPUT_LIMITS:
                return
        for child in ast.iter_child_nodes(node):
            visit(child, inside or isinstance(node, ast.FunctionDef | ast.Lambda))

    visit(ast.parse(source), False)
    return found


@pytest.mark.parametrize("path", [p for p in MODULES if p.stem not in ("tolerances", "settings")], ids=name_of)
def test_small_numbers_have_a_name_and_a_reason(path: Path) -> None:
    lines = small_numbers_without_name(path.read_text(encoding="utf-8"))
    assert not lines, f"lines {lines}: take one of mocca_robot/tolerances.py, or a constant with its reason"


def without_encoding(source: str) -> list[int]:
    """Return the lines that read or write text in the encoding that the system happens to have."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        named = {k.arg for k in node.keywords}
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        given = {"read_text": 1, "write_text": 2}.get(called)
        if isinstance(node.func, ast.Attribute) and given and len(node.args) < given and "encoding" not in named:
            found.append(node.lineno)
        binary = any(isinstance(a, ast.Constant) and "b" in str(a.value) for a in node.args[1:])
        if isinstance(node.func, ast.Name) and called == "open" and not binary and "encoding" not in named:
            found.append(node.lineno)
    return found


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_texts_have_an_encoding(path: Path) -> None:
    assert not without_encoding(path.read_text(encoding="utf-8"))
    assert without_encoding("open('a')\nopen('a', 'rb')\np.read_text()\np.write_text('x', 'utf-8')\n") == [1, 3]


def test_small_numbers_are_found_where_they_stand() -> None:
    source = "A = 1e-6\ndef f(x, y=1e-6):\n    return x > 1e-9 * y\nclass B:\n    c: float = 1e-4\n"
    assert small_numbers_without_name(source) == [3]


def test_no_two_test_files_have_one_name() -> None:
    """pytest tells files without packages apart by their names alone."""
    names = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name, count in names.items() if count > 1] == []
