"""Bad input: whatever is wrong with a file ends in one InputError that says where, what and what to do."""

import ast
import json
import random
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mocca_robot.cli import main
from mocca_robot.cli.console import Console
from mocca_robot.config.config import Config, load
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.errors import InputError, MoccaError

CONFIGS = Path(__file__).parents[2] / "configs"
SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 100 100">'
    '<g transform="translate(1,2) rotate(0)"><rect id="top" x="10" y="20" width="30" height="10"/>'
    '<path id="base" d="M 10 30 L 40 30 C 41 34 41 36 40 40 L 10 40 Z M 20 33 l 4 0 l 0 4 z"/></g></svg>'
)
YAML = """name: two
model: model.svg
fixed: [base]
sequence: [base, top]
goal: [{kind: support_free}, {kind: lateral, angle_deg: 10}]
alpha_deg: 5
density: 1200
thickness: 20
insertion: {top: [0, -1]}
joints: {kinds: [n, z], max_slope_deg: 60, margin: 0.05}
cut: {kerf: 0.2}
"""
ASSEMBLY = {
    "format": "mocca-robot/assembly",
    "version": 1,
    "units": "mm",
    "dimension": 2,
    "name": "two",
    "parts": [
        {"name": "base", "polygon": [[0, 0], [100, 0], [100, 50], [0, 50]], "fixed": True, "density": 1000.5},
        {"name": "top", "polygon": [[0, 50], [100, 50], [50, 90]], "holes": [[[40, 55], [60, 55], [50, 60]]]},
    ],
    "sequence": ["base", "top"],
    "goal": [{"kind": "equilibrium"}],
    "alpha_deg": 5.0,
    "gravity": [0, -9.81],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "model.svg").write_text(SVG)
    (tmp_path / "model.json").write_text(json.dumps(ASSEMBLY))
    (tmp_path / "c.yaml").write_text(YAML)
    return tmp_path


def config(folder: Path, text: str) -> Path:
    (folder / "c.yaml").write_text(text, encoding="utf-8")
    return folder / "c.yaml"


def assembly(folder: Path, parts: list[dict[str, Any]], **changes: Any) -> Path:
    (folder / "model.json").write_text(json.dumps({**ASSEMBLY, "sequence": [], **changes, "parts": parts}))
    return folder / "model.json"


def box(name: str, x: float, y: float, fixed: bool = False) -> dict[str, Any]:
    return {"name": name, "polygon": [[x, y], [x + 10, y], [x + 10, y + 10], [x, y + 10]], "fixed": fixed}


def test_the_examples_here_are_sound(folder: Path) -> None:
    for name in ("c.yaml", "model.json"):
        loaded = load(folder / name)
        require_sound(loaded.assembly, find_contacts(loaded.assembly))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("alfa_deg: 5", "unknown key 'alfa_deg'; did you mean 'alpha_deg'"),
        ("joints: {max_slope: 30}", "unknown key 'max_slope'; did you mean 'max_slope_deg'"),
        ("joints: {kinds: [n, y]}", "joints.kinds is 'y'"),
        ("joints: [n]", "joints must be a mapping"),
        ("alpha_deg: 90", r"alpha_deg is 90; it must be at least 0 and less than 90"),
        ("alpha_deg: -2", "alpha_deg is -2"),
        ("alpha_deg: .nan", "alpha_deg is nan; it must be a finite number"),
        ("alpha_deg: 5,0", "decimal point: 5.0"),
        ("alpha_deg: five", "alpha_deg must be a number, not 'five'"),
        ("density: 0", "density is 0; it must be more than 0"),
        ("density: .inf", "density is inf"),
        ("density: 1e999", "density is inf"),
        ("thickness: -1", "thickness is -1"),
        ("thickness: 1e308", "give at most 1e.06 m"),
        ("thickness: 3 parsec", "unit of .*thickness is 'parsec'"),
        ("thickness: thick", "thickness"),
        ("scale: 0", "scale is 0"),
        ("units: milimeter", "units is 'milimeter'"),
        ("units: in", "one of its units is 1 mm.*units: in.*remove one"),
        ("fixed: [bass]", "'bass'.*did you mean 'base'"),
        ("fixed: []", r"no part is fixed.*fixed: \[base\]"),
        ("fixed: [base, top]", "every part is fixed"),
        ("fixed: {base: 1}", "fixed must be a name"),
        ("sequence: [base, tip]", "sequence names 'tip', which is no part; did you mean 'top'"),
        ("sequence: [base]", "sequence leaves out 'top'"),
        ("sequence: [base, top, top]", "'top' 2 times"),
        ("parts: {tops: {density: 5}}", "'tops'.*did you mean 'top'"),
        ("parts: {top: {weight: 5}}", "part 'top' has the unknown key 'weight'"),
        ("parts: {top: {density: heavy}}", "part 'top': density must be a number"),
        ("goal: []", "goal is an empty list"),
        ("goal: {kind: lateral, angle_deg: 95}", "angle_deg is 95"),
        ("goal: {kind: interlocking, key: tip}", "key names 'tip'"),
        ("gravity: [0, 0, -9.81]", "gravity must be a list of 2 numbers"),
        ("gravity: 0", "gravity is 0"),
        ("friction: -0.1", "friction is -0.1"),
        ("insertion: {top: [0, 0]}", "insertion.top.*direction"),
        ("insertion: {top: [0, -1, 0]}", "insertion.top must be a list of 2"),
        ("insertion: {base: [0, -1]}", "'base', which is fixed"),
        ("insertion: {tip: [0, -1]}", "'tip'"),
        ("simulate: {azimuths: 0}", "simulate.azimuths is 0"),
        ("simulate: {azimuths: 2.5}", "whole number"),
        ("cut: {kerf: -1}", "cut.kerf is -1"),
        ("cut: {labels: yes}", "true or false"),
        ("model: c.yaml", "name a file that holds parts"),
        ("model: modle.svg", "does not exist; did you mean '.*model.svg'"),
        ("model: notes.txt", "notes.txt' does not exist"),
        ("model: [a]", "model must be a text"),
        ('model: "a\\0b.svg"', "printable"),
        ("generator: {kind: dome}", "both 'model' and 'generator'"),
        ("name: ''", "printable"),
    ],
)
def test_a_wrong_value_is_named_with_its_remedy(folder: Path, change: str, said: str) -> None:
    key = change.split(":")[0]
    kept = [line for line in YAML.splitlines() if not line.startswith(f"{key}:")]
    with pytest.raises(InputError, match=said) as caught:
        load(config(folder, "\n".join([*kept, change])))
    assert len(str(caught.value)) < 600 and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("# nothing", "nothing but comments"),
        ("- model.svg", "must be a mapping"),
        ("just words", "must be a mapping"),
        ("fixed: base", "names no parts"),
        ("generator: {}", "no 'kind'"),
        ("generator: {kind: dom}", "did you mean 'dome'"),
        ("generator: {kind: dome}\nunits: mm", "generators work in metres"),
        ("model: model.svg\nmodel: model.svg", "'model' appears twice"),
        ("model: !!python/object/apply:os.system ['true']", "tag"),
        ("a: &a [x]\nb: *a", "alias"),
        ("model: [unclosed", "line"),
        ("model: model.svg\n\tfixed: base", "line 2"),
        ("[" * 5000, "nested too deeply"),
        ("scale: " + "9" * 6000, "number that cannot be used"),
        ("? {a: 1}\n: 2", "key must be plain text"),
        ("x" * 600_000, "MB"),
    ],
)
def test_a_broken_configuration_is_refused(folder: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load(config(folder, text))


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.svg", b"", "empty"),
        ("a.svg", SVG[:200].encode(), "truncated"),
        ("a.svg", b"\x89PNG\r\n\x1a\n\0\0", "not UTF-8"),
        ("a.svg", SVG.encode("utf-16"), "UTF-16"),
        ("a.json", b"{}", "format"),
        ("a.json", json.dumps(ASSEMBLY).encode()[:150], "truncated"),
        ("a.json", b"\x00\x01\x02", "binary"),
        ("a.json", b"[" * 100_000, "nested too deeply"),
        ("a.json", b'{"format": NaN}', "NaN"),
        ("a.json", b'{"format": 1, "format": 2}', "'format' twice"),
        ("a.json", b'{"a": ' + b"9" * 5000 + b"}", "number"),
        ("a.json", b'{"format": "mocca-robot/plan", "version": 1}', "holds no parts"),
        ("a.json", b'{"format": "mocca-robot/assembly", "version": 9}', "version 9.*Upgrade"),
        ("a.txt", b"hello", "'.txt'.*no model"),
        ("a.obj", b"v 0 0\n", r"a\.obj"),
        ("a.obj", b"v 0 0 1e200\nf 1 1 1\n", r"a\.obj, line 1: .*below 1e.12"),
        ("a.stl", b"solid", r"a\.stl"),
        ("a.3mf", b"PK\x03\x04", r"a\.3mf"),
    ],
)
def test_a_broken_model_is_refused(folder: Path, name: str, content: bytes, said: str) -> None:
    (folder / name).write_bytes(content)
    with pytest.raises(InputError, match=said):
        load(folder / name, {"units": "mm"} if name[2:] in ("obj", "stl", "3mf") else None)


def test_a_mesh_that_unpacks_to_gigabytes_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import zipfile

    from mocca_robot.files import meshes

    monkeypatch.setattr(meshes, "LARGEST_FILE", 10**6)
    with zipfile.ZipFile(folder / "bomb.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", b" " * 2 * 10**6)
    assert (folder / "bomb.3mf").stat().st_size < 10**5
    with pytest.raises(InputError, match="holds 2 MB, the limit is 1 MB"):
        load(folder / "bomb.3mf")


def test_faces_beyond_the_last_vertex_are_refused(folder: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    body = "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 99\n"
    (folder / "a.ply").write_text(header + body)
    with pytest.raises(InputError, match="has a face with vertex 99, but only 3 vertices"):
        load(folder / "a.ply", {"units": "m"})


def test_things_that_are_no_files_are_refused(folder: Path) -> None:
    for path, said in ((folder / "none.yaml", "does not exist"), (folder / "sub.yaml", "folder")):
        (folder / "sub.yaml").mkdir(exist_ok=True)
        with pytest.raises(InputError, match=said):
            load(path)
    for odd in ("/dev/zero", "a\0b", "x" * 5000, str(folder / "sub.yaml" / "nothing")):
        with pytest.raises(InputError):
            load(odd)
    with pytest.raises(InputError, match="holds no mesh"):
        (folder / "empty").mkdir()
        load(folder / "empty")


def test_parts_that_overlap_float_or_nearly_touch_are_named(folder: Path) -> None:
    def check(parts: list[dict[str, Any]]) -> None:
        loaded = load(assembly(folder, parts, sequence=[p["name"] for p in parts]))
        require_sound(loaded.assembly, find_contacts(loaded.assembly))

    check([box("a", 0, 0, True), box("b", 0, 10)])
    with pytest.raises(InputError, match=r"'a' and 'b' overlap by 1 mm"):
        check([box("a", 0, 0, True), box("b", 0, 9)])
    with pytest.raises(InputError, match="'c' floats free"):
        check([box("a", 0, 0, True), box("b", 0, 10), box("c", 50, 50)])
    with pytest.raises(InputError, match=r"'b' floats free.*0\.05 mm away from 'a'"):
        check([box("a", 0, 0, True), box("b", 0, 10.05)])
    with pytest.raises(InputError, match="no part is fixed"):
        check([box("a", 0, 0), box("b", 0, 10)])


def test_absurd_sizes_are_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="origin"):
        load(assembly(folder, [box("a", 1e8, 0, True), box("b", 1e8, 10)], sequence=["a", "b"]))
    with pytest.raises(InputError, match="at most 5000"):
        load(assembly(folder, [{"name": str(k)} for k in range(6000)]))


def _mutated(text: str, rng: random.Random) -> bytes:
    data = bytearray(text.encode())
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(data) + 1) if data else 0
        kind = rng.randrange(7)
        if kind == 0:
            del data[at:]
        elif kind == 1 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 2:
            junk = (
                b"nan",
                b"-1e308",
                b"null",
                b"[]",
                b"{}",
                b'"',
                b"\xff",
                b"0",
                b"99999999999",
                b"&a ",
                b"*a",
                b"!!x ",
            )
            data[at:at] = rng.choice(junk)
        elif kind == 3:
            end = min(len(data), at + rng.randint(1, 30))
            data[at:at] = data[at:end] * rng.randint(1, 50)
        elif kind == 4:
            del data[at : at + rng.randint(1, 12)]
        elif kind == 5:
            words = [b"top", b"base", b"mm", b"5", b"Z", b"model.svg", b"[", b"}", b"true", b"rect", b'"polygon"']
            word = rng.choice(words)
            data = data.replace(word, rng.choice([b"", b"1e400", b"[[[[", b"\x00", b"px", b"-3", b"false", word * 3]))
        else:
            digits = [k for k, c in enumerate(data) if 48 <= c <= 57]
            if digits:
                data[rng.choice(digits)] = rng.choice(b"0123456789e.-,")
    return bytes(data)


@pytest.mark.parametrize("seed", range(6))
def test_mutated_files_end_in_a_configuration_or_an_error(folder: Path, seed: int) -> None:
    rng = random.Random(seed)
    originals = {"c.yaml": YAML, "model.svg": SVG, "model.json": json.dumps(ASSEMBLY)}
    outcomes = {"read": 0, "refused": 0}
    start = time.monotonic()
    for _ in range(80):
        name = rng.choice(sorted(originals))
        (folder / name).write_bytes(_mutated(originals[name], rng))
        try:
            loaded = load(folder / ("model.json" if name == "model.json" else "c.yaml"))
            assert isinstance(loaded, Config)
            outcomes["read"] += 1
        except MoccaError as error:
            assert str(error)
            outcomes["refused"] += 1
        (folder / name).write_text(originals[name])
    assert outcomes["refused"] >= 20 and outcomes["read"] >= 1
    assert time.monotonic() - start < 60.0  # a hang, not a slow machine
    assert {p.name for p in folder.iterdir()} == {"c.yaml", "model.svg", "model.json"}


def test_a_folder_that_takes_no_files_is_told_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    begun: list[str] = []
    stage = Console.stage

    def noted(console: Console, name: str) -> Any:
        begun.append(name)
        return stage(console, name)

    monkeypatch.setattr(Console, "stage", noted)
    blocked = tmp_path / "a file"
    blocked.write_text("not a folder")
    config, cell = str(CONFIGS / "stack.yaml"), str(CONFIGS / "cells" / "ur5e_2f85.yaml")
    part = {"name": "a", "fixed": True, "polygon": [[0, 0], [1, 0], [1, 1]]}
    design = {"format": "mocca-robot/design", "version": 1, "units": "m", "dimension": 2, "name": "d"}
    (tmp_path / "design.json").write_text(
        json.dumps({**design, "parts": [part, {**part, "name": "b", "fixed": False}], "sequence": ["a", "b"]})
    )
    for command in (
        ["run", config, "-o", str(blocked / "x")],
        ["design", config, "-o", str(blocked / "x")],
        ["simulate", config, "-o", str(blocked / "x")],
        ["check", config, "--picture", str(blocked / "x.svg")],
        ["view", config, "--export", str(blocked / "x.html")],
        ["manual", config, "-o", str(blocked / "x.html")],
        ["plan", str(tmp_path / "design.json"), "--cell", cell, "-o", str(blocked / "x.json")],
    ):
        assert main(command) == 2, command
        assert "Nothing can be written to the folder" in capsys.readouterr().err, command
        assert set(begun) <= {"read"}, command


def test_a_disk_that_fills_up_during_the_work_is_no_error_in_the_program(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")

    def small_files_only() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))

    command = [sys.executable, "-m", "mocca_robot.cli", "design", str(CONFIGS / "stack.yaml"), "-o", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=300, preexec_fn=small_files_only)
    assert ended.returncode == 2, ended.stdout + ended.stderr
    assert re.search(r"cannot be written: File too large\. Free space or name another folder", ended.stderr)
    assert "Traceback" not in ended.stderr
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_no_number_is_written_or_read_by_the_locale() -> None:
    for path in (p for part in ("mocca_robot", "planners", "sim") for p in (CONFIGS.parent / part).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                assert "locale" not in [a.name for a in node.names], path
            if isinstance(node, ast.ImportFrom):
                assert node.module != "locale", path
            if isinstance(node, ast.FormattedValue) and node.format_spec is not None:
                plain = [v.value for v in getattr(node.format_spec, "values", []) if isinstance(v, ast.Constant)]
                assert not (plain and str(plain[-1]).endswith("n")), path


@pytest.mark.parametrize("seed", range(20))
def test_a_part_placed_before_what_it_rests_on_hangs_in_the_air(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    scale, shift = 10 ** rng.uniform(-1, 2), rng.uniform(-100, 100, 2)

    def box(x: float, y: float, width: float, height: float) -> list[list[float]]:
        corners = np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]])
        return np.asarray(np.roll(corners * scale + shift, seed, axis=0)).tolist()

    parts = [
        {"name": "ground", "fixed": True, "polygon": box(0, 0, 100, 10)},
        {"name": "hat", "polygon": box(40, 60, 20, 20)},
        {"name": "post", "polygon": box(40, 10, 20, 50)},
    ]
    data = {"format": "mocca-robot/assembly", "version": 1, "units": "mm", "dimension": 2, "parts": parts}
    (tmp_path / "a.json").write_text(json.dumps({**data, "alpha_deg": None}))
    assert main(["check", str(tmp_path / "a.json")]) == 1
    assert "'hat' hangs in the air when it is placed" in capsys.readouterr().out
    (tmp_path / "b.json").write_text(json.dumps({**data, "alpha_deg": None, "sequence": ["post", "hat"]}))
    assert main(["check", str(tmp_path / "b.json")]) == 0
