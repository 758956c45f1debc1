"""Inputs that nobody should hand in: sound files of every kind, broken at random from a seed, and hostile ones."""

from __future__ import annotations

import io
import json
import os
import random
import resource
import zipfile
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from solids import box
from ur_cell import small_plan

from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.cli import main
from mocca_robot.config.starter import DRAWING
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.files.compas_write import write_compas
from mocca_robot.files.mesh_write import write_glb, write_part
from mocca_robot.files.rhino import write_3dm
from mocca_robot.plan.plan import write_plan

ROOT = Path(__file__).parents[2]
MEMORY = 3 * 1024**3
"""Bytes of address space that a broken input may make the program ask for."""
CONFIG = """name: arch
model: arch.svg
fixed: [foot_left, foot_right]
sequence: [foot_left, foot_right, haunch_left, haunch_right, key]
goal: [{kind: equilibrium}, {kind: lateral, angle_deg: 3}, {kind: interlocking, key: key}]
alpha_deg: 5
thickness: 20 mm
parts: {key: {density: 700}}
insertion: {key: [0, -1]}
gravity: [0, -9.81]
joints: {kinds: [n, z], max_slope_deg: 60, margin: 0.05}
simulate: {azimuths: 4, seed: 3}
cut: {kerf: 0.2, labels: true}
"""
GENERATED = "generator: {kind: dome, blocks: [5, 4], radius: 0.2, thickness: 0.04}\nalpha_deg: 2\n"
NUMBERS = (
    "NaN",
    "Infinity",
    "-Infinity",
    "1e308",
    "-1e308",
    "1e-320",
    "0",
    "-1",
    "9" * 400,
    "1e999",
    "0.1",
    "100000000",
)
VALUES: tuple[Any, ...] = (
    *(
        None,
        True,
        "",
        "x",
        [],
        {},
        [[]],
        [None],
        {"a": 1},
        -1,
        0,
        1e308,
        -1e308,
        1e-320,
        10**400,
        2**63,
        "1e5",
        "é\u202e",
    ),
    *("../../../../etc/passwd", "/etc/passwd", "a\0b", "x" * 100_000, [[[[[[1]]]]]], [1e308, 1e308], [0, 0], [0, 0, 0]),
)


@dataclass(frozen=True)
class Case:
    """One input: what it is, the file, and the command line that reads it."""

    what: str
    arguments: list[str]


def corpus(folder: Path) -> dict[str, bytes]:
    """Return a sound file of every kind by name, made in `folder`."""
    folder.mkdir(parents=True)
    pile = Assembly(
        "pile",
        (
            Part("ground", box((0, 0, 0), (0.1, 0.1, 0.02)), fixed=True),
            Part("block", box((0.02, 0.02, 0.02), (0.08, 0.08, 0.05))),
        ),
    )
    (folder / "arch.svg").write_text(DRAWING, encoding="utf-8")
    (folder / "arch.yaml").write_text(CONFIG, encoding="utf-8")
    (folder / "dome.yaml").write_text(GENERATED, encoding="utf-8")
    with redirect_stdout(io.StringIO()):
        main(
            ["export", str(folder / "arch.yaml"), "--format", "dxf", "-o", str(folder / "arch.dxf"), "--min-wall", "0"]
        )
    (folder / "cell.yaml").write_bytes((ROOT / "configs/cells/ur5e_2f85.yaml").read_bytes())
    (folder / "study.yaml").write_text(
        "base: arch.yaml\nvary:\n  alpha_deg: [1, 2]\nstages: [design]\n", encoding="utf-8"
    )
    write_assembly(pile, folder / "pile.json")
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        main(["design", str(folder / "arch.yaml"), "-o", str(folder / "designed"), "--set", "goal=equilibrium"])
        main(["simulate", str(folder / "designed"), "--states"])
    (folder / "design.json").write_bytes((folder / "designed/design.json").read_bytes())
    (folder / "simulation.json").write_bytes((folder / "designed/simulation.json").read_bytes())
    write_plan(small_plan(1), folder / "plan.json")
    write_compas(pile, folder / "compas.json")
    write_compas(pile, folder / "model.json", kind="model")
    for kind in ("obj", "stl", "ply", "3mf"):
        write_part(box((0, 0, 0), (0.1, 0.1, 0.1)), folder / f"box.{kind}")
    write_glb(pile, folder / "pile.glb")
    write_3dm(
        [p.name for p in pile.parts], [p.shape for p in pile.parts if isinstance(p.shape, Mesh)], folder / "pile.3dm"
    )
    (folder / "pile.step").write_bytes((ROOT / "tests/files/pile.step").read_bytes())
    (folder / "surface.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 2 0 0\nv 2 0 1\nf 1 2 3 4\nf 2 5 6 3\n")
    (folder / "lines.json").write_text('{"nodes": [[0,0,0],[0,0,1],[1,0,1]], "rods": [[0,1],[1,2]]}')
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir()) if p.is_file()}


def command(name: str, path: Path, out: Path, rng: random.Random) -> list[str]:
    """Return a command line that reads the file `path`, a broken copy of the sound file `name`."""
    target = str(out / "o")
    if name == "plan.json":
        reads = (["execute", str(path)], ["export", str(path), "--format", "csv", "-o", target])
        return rng.choice((*reads, ["export", str(path), "--format", "urscript", "-o", target]))
    if name == "cell.yaml":
        return ["plan", str(path.with_name("design.json")), "--cell", str(path), "-o", f"{target}.json"]
    if name == "study.yaml":
        return ["study", str(path), "-o", target, "--jobs", "1"]
    if name == "simulation.json":
        return ["check", str(path.with_name("design.json"))]
    if name in ("surface.obj", "lines.json"):
        return ["new", "fuzzed", "--from", str(path), "-o", target]
    units = ["--set", "units=m"] if path.suffix in (".obj", ".stl", ".ply") else []
    look = (
        ["check", str(path), *units, "--set", "fixed=ground"]
        if path.stem == "pile" and name != "pile.json"
        else ["check", str(path), *units]
    )
    others = (
        ["config", "show", str(path), *units],
        [
            "export",
            str(path),
            "--format",
            rng.choice(("svg", "dxf", "json", "csv", "obj", "compas")),
            "-o",
            target,
            *units,
        ],
        ["new", "fuzzed", "--from", str(path), "-o", target, *(["--units", "m"] if units else [])],
        ["manual", str(path), "-o", f"{target}.html", *units],
    )
    return look if rng.random() < 0.6 else rng.choice(others)


def broken(name: str, content: bytes, rng: random.Random) -> tuple[str, bytes]:
    """Return how a file was broken and what it holds then."""
    ways: list[tuple[str, Callable[[bytes, random.Random], bytes]]] = [
        ("cut short", lambda b, r: b[: r.randrange(len(b))]),
        ("bytes changed", _bytes_changed),
        ("piece doubled", _piece_doubled),
        ("piece left out", _piece_left_out),
        ("numbers changed", _numbers_changed),
    ]
    if name.endswith(".json"):
        ways += [("value changed", _value_changed)] * 4
    if name.endswith(".yaml"):
        ways += [("value changed", _yaml_changed)] * 3
    what, change = rng.choice(ways)
    return what, change(content, rng)


def _bytes_changed(content: bytes, rng: random.Random) -> bytes:
    out = bytearray(content)
    for _ in range(rng.choice((1, 3, 30))):
        out[rng.randrange(len(out))] = rng.randrange(256)
    return bytes(out)


def _piece_doubled(content: bytes, rng: random.Random) -> bytes:
    a, b = sorted(rng.randrange(len(content)) for _ in range(2))
    return content[:b] + content[a:b] * rng.choice((1, 2, 20)) + content[b:]


def _piece_left_out(content: bytes, rng: random.Random) -> bytes:
    a = rng.randrange(len(content))
    return content[:a] + content[a + rng.choice((1, 5, 50, 500)) :]


def _numbers_changed(content: bytes, rng: random.Random) -> bytes:
    import re

    found = list(re.finditer(rb"-?\d+\.?\d*(?:e-?\d+)?", content))
    for match in sorted(rng.sample(found, min(len(found), rng.choice((1, 4)))), key=lambda m: -m.start()):
        content = content[: match.start()] + rng.choice(NUMBERS).encode() + content[match.end() :]
    return content


def _value_changed(content: bytes, rng: random.Random) -> bytes:
    data = json.loads(content)
    for _ in range(rng.choice((1, 1, 3))):
        holder: Any = data
        while True:
            keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
            if not keys:
                break
            key = rng.choice(keys)
            if isinstance(holder[key], (dict, list)) and holder[key] and rng.random() < 0.8:
                holder = holder[key]
                continue
            action = rng.random()
            if action < 0.7:
                holder[key] = deepcopy(rng.choice(VALUES))
            elif action < 0.85:
                del holder[key]
            elif isinstance(holder, dict):
                holder["extra"] = deepcopy(rng.choice(VALUES))
            else:
                holder.append(deepcopy(rng.choice(VALUES)))
            break
    return json.dumps(data).encode()


def _yaml_changed(content: bytes, rng: random.Random) -> bytes:
    lines = content.decode().splitlines()
    k = rng.randrange(len(lines))
    key, colon, _ = lines[k].partition(":")
    hostile = (
        "!!python/object/apply:os.system [id]",
        "&a [*a, *a]",
        "*b",
        "{{{{",
        "[" * 500,
        "|",
        "? a",
        "'",
        "2026-01-01",
    )
    plain = tuple(json.dumps(v) for v in VALUES)
    lines[k] = f"{key}{colon} {rng.choice(hostile + plain + NUMBERS)}"
    return "\n".join(lines).encode()


def hostile(folder: Path) -> Iterator[Case]:
    """Yield inputs that were made to do harm."""
    folder.mkdir(parents=True)

    def file(name: str, content: str | bytes) -> str:
        path = folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return str(path)

    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 100 100">{}</svg>'
    bomb = '<!DOCTYPE svg [<!ENTITY a "aaaaaaaaaa">' + "".join(
        f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9)
    )
    yield Case("entity bomb", ["check", file("bomb.svg", f"{bomb}]>{svg.format('&j;')}")])
    outside = '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    yield Case("external entity", ["check", file("xxe.svg", f"{outside}{svg.format('&x;')}")])
    yield Case("entity in UTF-16", ["check", file("utf16.svg", f"{bomb}]>{svg.format('&j;')}".encode("utf-16"))])
    loop = (
        '<g id="a"><use href="#b"/><use href="#b"/></g><g id="b"><use href="#a"/><use href="#a"/></g><use href="#a"/>'
    )
    yield Case("clones of clones", ["check", file("use.svg", svg.format(loop))])
    doubled = "".join(f'<g id="g{k + 1}"><use href="#g{k}"/><use href="#g{k}"/></g>' for k in range(30))
    yield Case(
        "clones doubled", ["check", file("double.svg", svg.format(f'<rect id="g0" width="1" height="1"/>{doubled}'))]
    )
    yield Case("deep groups", ["check", file("deep.svg", svg.format("<g>" * 50_000 + "</g>" * 50_000))])
    yield Case("long path", ["check", file("long.svg", svg.format(f'<path id="p" d="M 0 0 {"L 1 1 " * 400_000}Z"/>'))])
    yield Case(
        "many arcs", ["check", file("arcs.svg", svg.format(f'<path id="p" d="M 0 0 {"A 1 1 0 1 1 2 0 " * 60_000}Z"/>'))]
    )
    to_and_fro = "A 1 1 0 1 1 2 0 A 1 1 0 1 1 0 0 " * 4_000
    yield Case("arcs to and fro", ["check", file("fro.svg", svg.format(f'<path id="p" d="M 0 0 {to_and_fro}Z"/>'))])
    yield Case("huge rectangle", ["check", file("huge.svg", svg.format('<rect id="r" width="1e308" height="1e308"/>'))])
    head = "0\nSECTION\n2\nENTITIES\n"
    tail = "0\nENDSEC\n0\nEOF\n"
    circle = "0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n{}\n"
    units = ["--set", "units=mm", "--set", "fixed=[part_1]"]
    yield Case(
        "DXF of many circles",
        ["check", file("circles.dxf", head + "".join(circle.format(k + 1) for k in range(60_000)) + tail), *units],
    )
    yield Case("DXF of endless circles", ["check", file("inf.dxf", head + circle.format("1e999") + tail), *units])
    yield Case("DXF of deep heaps", ["check", file("heap.dxf", "0\nSECTION\n" * 100_000), *units])
    block = "0\nSECTION\n2\nBLOCKS\n0\nBLOCK\n2\na\n10\n0\n20\n0\n{}0\nENDBLK\n0\nENDSEC\n"
    insert = "0\nINSERT\n2\na\n10\n1\n20\n0\n"
    yield Case(
        "DXF block in itself", ["check", file("self.dxf", block.format(insert * 9) + head + insert + tail), *units]
    )
    yield Case("deep plan", ["execute", file("deepp.json", '{"a":' * 100_000 + "1" + "}" * 100_000)])
    deep = "[" * 200_000 + "]" * 200_000
    yield Case("deep JSON", ["check", file("deep.json", deep)])
    yield Case("deep JSON object", ["check", file("deepo.json", '{"a":' * 100_000 + "1" + "}" * 100_000)])
    yield Case("deep YAML", ["check", file("deep.yaml", "a: " + "[" * 20_000)])
    yield Case("deep YAML blocks", ["check", file("deepb.yaml", "\n".join(" " * k + "a:" for k in range(700)))])
    laughs = "a: &a [x, x]\n" + "".join(
        f"{chr(98 + k)}: &{chr(98 + k)} [*{chr(97 + k)}, *{chr(97 + k)}]\n" for k in range(20)
    )
    yield Case("YAML aliases", ["check", file("laughs.yaml", laughs)])
    yield Case("YAML tag", ["check", file("tag.yaml", "model: !!python/object/apply:os.system ['touch /tmp/owned']")])
    yield Case("YAML merge", ["check", file("merge.yaml", "<<: {model: a.svg}")])
    for kind, extra in {
        "wall": "courses: 500, columns: 500", "stack": "count: 2000", "arch": "voussoirs: 1000",
        "dome": f"blocks: {[500] * 400}",
        "shell": "surface: /etc/passwd, thickness: 0.1", "frame": "lines: ../../../../etc/passwd, width: 1, height: 1",
    }.items():  # fmt: skip
        yield Case(
            f"large {kind}", ["config", "show", file(f"large_{kind}.yaml", f"generator: {{kind: {kind}, {extra}}}")]
        )
    block = {"format": "mocca-robot/assembly", "version": 1, "units": "m", "dimension": 3, "name": "../../out"}
    part = {"name": "../../../owned", "mesh": "/dev/zero", "fixed": True}
    yield Case("device as mesh", ["check", file("dev.json", json.dumps({**block, "parts": [part, part]}))])
    yield Case("mesh that is a pipe", ["check", _pipe(folder)])
    many = [{"name": str(k), "polygon": [[0, 0], [1, 0], [0, 1]]} for k in range(20_000)]
    yield Case("many parts", ["check", file("many.json", json.dumps({**block, "dimension": 2, "parts": many}))])
    ring = [[k % 1000, k // 1000] for k in range(200_000)]
    yield Case(
        "long ring",
        [
            "check",
            file(
                "ring.json",
                json.dumps(
                    {**block, "dimension": 2, "parts": [{"name": "a", "polygon": ring, "fixed": True}, many[0]]}
                ),
            ),
        ],
    )
    names = ["../../../owned", "..\\..\\owned", "C:\\owned", "con", "a/b", "😀", "'; rm -rf", "\u202eabc", "..", " a "]
    squares = [
        {"name": n, "fixed": k == 0, "polygon": [[0, k], [1, k], [1, k + 1], [0, k + 1]]} for k, n in enumerate(names)
    ]
    odd = file("names.json", json.dumps({**block, "dimension": 2, "parts": squares}))
    for kind in ("obj", "svg", "dxf", "urdf", "mjcf", "json", "csv", "compas", "glb"):
        yield Case(f"odd names as {kind}", ["export", odd, "--format", kind, "-o", str(folder / "o")])
    yield Case("odd names in a manual", ["manual", odd, "-o", str(folder / "o.html")])
    yield Case("odd names designed", ["design", odd, "-o", str(folder / "o")])
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as pack:
        pack.writestr("3D/3dmodel.model", b"0" * 400_000_000)
        pack.writestr("../../../owned", "x")
    yield Case("zip bomb", ["check", file("bomb.3mf", archive.getvalue())])
    lying = bytearray(archive.getvalue())
    at = lying.rfind(b"PK\x01\x02", 0, lying.rfind(b"PK\x01\x02"))
    lying[at + 24 : at + 28] = (1000).to_bytes(4, "little")
    yield Case("zip bomb that lies about its size", ["check", file("lies.3mf", bytes(lying))])
    head = b"\0" * 80 + (2**32 - 1).to_bytes(4, "little")
    yield Case(
        "STL that promises four billion triangles", ["check", file("lie.stl", head + b"\0" * 500), "--set", "units=m"]
    )
    ply = "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n0\n"
    yield Case("PLY that promises four billion vertices", ["check", file("lie.ply", ply), "--set", "units=m"])
    glb = (
        b"glTF" + (2).to_bytes(4, "little") + (2**31).to_bytes(4, "little") + (2**31).to_bytes(4, "little") + b"JSON{}"
    )
    yield Case("GLB that promises two gigabytes", ["check", file("lie.glb", glb)])
    outward = (
        b'{"asset":{"version":"2.0"},"buffers":[{"uri":"file:///etc/passwd","byteLength":9}],"scenes":[{"nodes":[]}]}'
    )
    outward += b" " * (-len(outward) % 4)
    size = 20 + len(outward)
    glb = (
        b"glTF"
        + (2).to_bytes(4, "little")
        + size.to_bytes(4, "little")
        + len(outward).to_bytes(4, "little")
        + b"JSON"
        + outward
    )
    yield Case("GLB that reaches for a file", ["check", file("reach.glb", glb)])
    obj = "mtllib ../../../../etc/passwd\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n"
    yield Case("OBJ with a vertex beyond all", ["check", file("beyond.obj", obj), "--set", "units=m"])
    face = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + "1 2 3 " * 50_000
    yield Case("OBJ with one face of many corners", ["check", file("face.obj", face), "--set", "units=m"])
    for key in (
        "alpha_deg=" + "9" * 5000,
        "joints.margin=[[[",
        "a.b.c.d=1",
        "=",
        "parts.a.b.c=1",
        "goal={kind: lateral, angle_deg: 1e400}",
    ):
        yield Case(f"--set {key[:20]}", ["check", odd, "--set", key])
    for entry in ("x" * 5000, "\0", "/proc/self/mem", "/dev/null", "", ".", "~", "file:///etc/passwd", "-"):
        yield Case(f"path {entry[:20]!r}", ["check", "--", entry])


def _pipe(folder: Path) -> str:
    os.mkfifo(folder / "pipe.obj")
    return str(folder / "pipe.obj")


def cases(folder: Path, seed: int, count: int) -> Iterator[Case]:
    """Yield `count` broken copies of sound files; each is written when it is asked for, below `folder`."""
    sound = corpus(folder / "sound")
    names = list(sound)
    for number in range(count):
        rng = random.Random(f"{seed}/{number}")
        name = names[number % len(names)]
        what, content = broken(name, sound[name], rng)
        inside = folder / f"{number:05d}"
        inside.mkdir()
        for other, data in sound.items():  # neighbours that files refer to
            if other in ("arch.svg", "arch.yaml", "design.json"):
                (inside / other).write_bytes(data)
        for mesh in (folder / "sound" / "pile_parts").glob("*.obj"):
            (inside / "pile_parts").mkdir(exist_ok=True)
            (inside / "pile_parts" / mesh.name).write_bytes(mesh.read_bytes())
        path = inside / name
        path.write_bytes(content)
        yield Case(f"{name}, {what}, {seed}/{number}", command(name, path, inside / "out", rng))


def outcome(case: Case, seconds: int) -> str:
    """Return '' when the program ends with a verdict or a clear error, else what it did instead.

    `seconds` of processor time bound it, so that a busy machine changes nothing, and `MEMORY` bounds what it may ask
    for beyond what the process has.
    """
    import signal

    class Overdue(BaseException):
        pass

    def stop(*_: object) -> None:
        raise Overdue

    said, told = io.StringIO(), io.StringIO()
    old_handler = signal.signal(signal.SIGPROF, stop)
    limits = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY + _now(), limits[1]))
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        with redirect_stdout(said), redirect_stderr(told):
            status: object = main(case.arguments)
    except SystemExit as end:
        status = end.code
    except Overdue:
        return f"not finished after {seconds} s of processor time"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old_handler)
        resource.setrlimit(resource.RLIMIT_AS, limits)
    if status not in (0, 1, 2):
        return f"exit status {status}:\n{told.getvalue()[-1500:]}"
    if status == 2 and not told.getvalue().strip():
        return "an error without a word"
    return ""


def _now() -> int:
    """Return the address space that this process has mapped, bytes."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0]) * os.sysconf("SC_PAGE_SIZE")
