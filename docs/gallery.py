"""Run the configurations and draw what came out: `python docs/gallery.py [NAME …]` (or `make gallery`).

Every configuration is designed, verified from its written files and let go in MuJoCo, by the commands that a user
types; what they say is kept in docs/gallery/figures.json, pictures and films beside it. docs/gallery_pages.py turns
that into pages. Results of the runs lie in out/gallery; those that are there already are used again with --keep.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.cli import main as mocca_robot
from mocca_robot.contacts.find import find_contacts
from mocca_robot.files.design_json import StoredDesign, read_design
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report import drawing3d, raster
from mocca_robot.report.animation import Shot, film
from mocca_robot.report.drawing2d import view_of
from mocca_robot.report.figures import beside, stand_alone
from mocca_robot.report.palette import FIXED, LIGHT, part_colours
from mocca_robot.report.pictures import Picture, draw, shared_view
from mocca_robot.statics.cases import critical_tilt
from mocca_robot.statics.loads import tilt_azimuths
from mocca_robot.verdicts.agreement import agree
from mocca_robot.verdicts.physics import Simulation
from mocca_robot.verdicts.simulation_json import read_simulation
from mocca_robot.verdicts.verification import verify

ROOT = Path(__file__).resolve().parents[1]
GALLERY = ROOT / "docs" / "gallery"
RUNS = ROOT / "out" / "gallery"
NAMES = (
    "m", "horse", "pavilion", "lilium_tower", "scarecrow", "sphere", "stack", "tree", "leaning_tower_10",
    "leaning_tower_20", "leaning_tower_30", "leaning_tower_support_free", "deer", "igloo",
)  # fmt: skip
COMPARED = ("scarecrow", "sphere")
HEAVIEST_PAGE = 800_000
"""Reports larger than this many bytes are left out of the documentation."""
APART = 0.6


def command(*arguments: str) -> dict[str, Any]:
    """Return what a command says as JSON; SystemExit when it could not be run at all."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        status = mocca_robot([*arguments, "--json"])
    if status not in (0, 1):
        sys.exit(f"mocca-robot {' '.join(arguments)} ended with exit status {status}\n{said.getvalue()}")
    return dict(json.loads(said.getvalue()))


def run(name: str, keep: bool) -> None:
    """Design, simulate and compare one configuration; results go to out/gallery/NAME."""
    folder = RUNS / name
    if not (keep and (folder / "said.json").is_file()):
        said = command("run", f"configs/{name}.yaml", "-o", str(folder))
        (folder / "said.json").write_text(json.dumps(said), encoding="utf-8")
    if name in COMPARED and not (keep and (folder / "compared.json").is_file()):
        said = command("compare", f"configs/{name}.yaml", "-o", str(folder))
        (folder / "compared.json").write_text(json.dumps(said), encoding="utf-8")


def figures(name: str) -> dict[str, Any]:
    """Return what is known about one configuration, from what the commands said and from the written files."""
    folder = RUNS / name
    said = json.loads((folder / "said.json").read_text(encoding="utf-8"))
    stored = read_design(folder)
    assembly, source = stored.assembly, stored.source or stored.assembly
    tightest = min(said["insertions"], key=lambda i: i["alpha_deg"])
    found: dict[str, Any] = {
        "name": name,
        "dimension": assembly.dimension,
        "parts": said["parts"],
        "fixed": int(assembly.fixed.sum()),
        "contacts": said["contacts"],
        "curved": said["curved_joints"],
        "alpha_deg": None if assembly.alpha_rad is None else round(float(np.rad2deg(assembly.alpha_rad)), 3),
        "tightest": {"part": tightest["part"], "deg": round(tightest["alpha_deg"], 1)},
        "cases": len(said["cases"]),
        "e_before": max(c["infeasibility"] for c in said["input_cases"]),
        "e_after": max(c["infeasibility"] for c in said["cases"]),
        "stands": all(c["status"] == "equilibrium" for c in said["cases"]),
        "ok": said["ok"],
        "seconds": {k: round(v, 3) for k, v in stored.seconds.items()},
        "tilt_deg": {"before": weakest(source), "after": weakest(assembly)},
        "report": (folder / "report.html").stat().st_size <= HEAVIEST_PAGE,
    }
    found["physics"] = physics(read_simulation(folder / "simulation.json"))
    if name in COMPARED:
        told = json.loads((folder / "compared.json").read_text(encoding="utf-8"))
        keys = ("name", "physics_stands", "tilt_deg", "goes_in", "deadlocked")
        found["compared"] = [
            {
                **{k: v[k] for k in keys},
                "stands": all(c["status"] == "equilibrium" for c in v["cases"]),
                "as_asked": all(i["assemblable"] for i in v["insertions"]),
                "narrowest_deg": round(min(i["alpha_deg"] for i in v["insertions"]), 1),
            }
            for v in told["variants"]
        ]
    return found


def weakest(assembly: Any) -> float:
    """Return the smallest critical tilt by statics over all azimuths, degrees."""
    graph = PartsGraph.of(assembly)
    azimuths = tilt_azimuths(assembly.dimension, 8)
    return round(float(np.rad2deg(min(critical_tilt(graph, float(a)) for a in azimuths))), 2)


def physics(simulation: Simulation) -> dict[str, Any]:
    """Return MuJoCo's verdicts as counts."""
    smooth = [float(np.rad2deg(t.critical_rad)) for t in simulation.tilt if not t.friction]
    sides = [[t for t in simulation.trials if t.inside is side] for side in (True, False)]
    inside, outside = ([sum(t.succeeded for t in side), len(side)] for side in sides)
    return {
        "engine": simulation.engine,
        "states": len(simulation.states),
        "agree": sum(agree(s.verdict, s.statics) is True for s in simulation.states),
        "tilt_deg": round(min(smooth), 2) if smooth else None,
        "inside": inside,
        "outside": outside,
    }


def pictures(name: str) -> None:
    """Write the pictures and films of one configuration, and its report where it is small."""
    folder, stored = GALLERY / name, read_design(RUNS / name)
    folder.mkdir(parents=True, exist_ok=True)
    design_picture(stored, folder / "design.svg")
    if stored.assembly.dimension == 2:
        flat_film(stored, folder / "film.svg")
    else:
        solid_film(stored, folder / "film.webp")
    for page in ("report.html", "comparison.html"):
        target = folder / page
        target.unlink(missing_ok=True)
        if (RUNS / name / page).is_file() and (RUNS / name / page).stat().st_size <= HEAVIEST_PAGE:
            shutil.copy(RUNS / name / page, target)


def example(page: str, source: str, picture: str, *arguments: str) -> None:
    """Write the picture of an example from its text on a page: its files and its Python, then `source` designed."""
    folder = RUNS / Path(picture).stem
    folder.mkdir(parents=True, exist_ok=True)
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    for name, content in re.findall(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", text, re.DOTALL):
        (folder / name).write_text(content, encoding="utf-8")
    with contextlib.chdir(folder):
        for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if source.endswith(".obj") else ():
            exec(compile(code, page, "exec"), {"__name__": "example"})
        if source.endswith(".obj"):
            Path(source).with_suffix(".yaml").unlink(missing_ok=True)
            command("new", Path(source).stem, "--from", source, "--units", "m")
            source = f"{Path(source).stem}.yaml"
        command("design", source, "-o", ".", *arguments)
    design_picture(read_design(folder), ROOT / "docs" / "assets" / picture)


def design_picture(stored: StoredDesign, path: Path) -> None:
    """Write input and result side by side: how the input would move; the forces in the result, or its parts apart."""
    built, source = stored.assembly, stored.source or stored.assembly
    before, after = verify(source), verify(built)
    colours = part_colours(after.graph)
    view = shared_view([source, built], 380.0)
    worst = sorted(before.cases, key=lambda c: -float(np.nan_to_num(c.result.infeasibility)))[:1]
    left = Picture(graph=before.graph, colours=colours, cases=worst, names=False)
    if built.dimension == 2:
        right, title = (
            Picture(graph=after.graph, colours=colours, cases=after.cases[:1], names=False),
            "cone joints",
        )
        drawn = [draw(left, view, "input"), draw(right, view, "result")]
    else:
        wide = shared_view([built], 380.0, APART)
        title = "cone joints, taken apart"
        drawn = [
            draw(left, view, "input"),
            draw(Picture(graph=after.graph, colours=colours, apart=APART), wide, "result"),
        ]
        if abs(wide.width - view.width) + abs(wide.height - view.height) > 1:
            view = wide if wide.height > view.height else view
    path.write_text(beside(drawn, ["flat contacts", title], view.width, view.height, built.name), encoding="utf-8")


def flat_film(stored: StoredDesign, path: Path) -> None:
    """Write the film of input and result: put together, let go. How the input falls is MuJoCo's run, slowed down."""
    source = stored.source or stored.assembly
    ways = {i.part: np.asarray(i.direction) for i in stored.insertion}
    falling, moving = fall(source)
    shots = [
        Shot(
            assembly=source,
            title="flat contacts",
            ways=ways,
            stands=None if falling is None else False,
            falling=falling,
            moving=moving,
        ),
        Shot(assembly=stored.assembly, title="cone joints", ways=ways, stands=verify(stored.assembly).stands),
    ]
    path.write_text(stand_alone(film(shots, part_colours(PartsGraph.of(source)))), encoding="utf-8")


def fall(source: Any) -> tuple[Array | None, Array | None]:
    """Return MuJoCo's motion of a flat assembly until something has moved by a fifth of its size; None if it stays."""
    from sim.motion import run as let_go
    from sim.scene import compile_scene
    from sim.shapes.contact_model import contact_model
    from sim.stability import free_scene

    scene = free_scene(source, contact_model(source, find_contacts(source).contacts))
    far = 0.2 * source.size
    seen = let_go(compile_scene(scene), 2.0, lambda time, moved, speed: bool((moved > far).any()), samples=400)
    if seen.failure is not None or seen.displacement[-1].max() < 0.05 * source.size:
        return None, None
    return seen.poses, seen.parts


def solid_film(stored: StoredDesign, path: Path, frames: int = 48, side: int = 320) -> None:
    """Write an animated WebP: the parts go in one after the other while the camera walks round."""
    from PIL import Image

    assembly = stored.assembly
    colours = part_colours(PartsGraph.of(assembly))
    fills = [FIXED if c < 0 else LIGHT[c] for c in colours]
    ways = {i.part: np.asarray(i.direction) for i in stored.insertion}
    order = {p: k for k, p in enumerate(n for n, q in zip(assembly.sequence, assembly.parts) if not q.fixed)}
    meshes = drawing3d.exploded(assembly, 0.0)
    middle = np.mean([m.vertices.mean(axis=0) for m in meshes], axis=0)
    points = np.concatenate([m.vertices for m in meshes]) - middle
    radius = float(np.linalg.norm(points[:, :2], axis=1).max())
    box = np.array([[-radius, points[:, 2].min() * 0.95], [radius, points[:, 2].max() * 1.15]])
    view, pictures_ = view_of(box, side, 0.06), []
    for frame in range(frames):
        placed = len(order) * (frame + 1) / (frames - 12)
        axes = drawing3d.camera(np.deg2rad(-100 + 70 * frame / (frames - 1)))
        shown = []
        for mesh, part in zip(meshes, assembly.parts):
            done = 1.0 if part.fixed else float(np.clip(placed - order[part.name], 0.0, 1.0))
            if done <= 0.0:
                continue
            way = ways.get(part.name, np.array([0.0, 0.0, -1.0]))
            shift = -0.25 * assembly.size * (1.0 - done) ** 2 * way
            shown.append((type(mesh)(mesh.vertices - middle + shift, mesh.faces), part))
        width, height = round(view.width * 2), round(view.height * 2)
        seen = raster.look([m for m, _ in shown], axes, view.scale * 2, view.low, width, height)
        mine = [assembly.index(p.name) for _, p in shown]
        pixels = raster.painted(seen, [fills[k] for k in mine], [assembly.parts[k].fixed for k in mine], 2)
        pictures_.append(Image.fromarray(pixels, "RGBA"))
    times = [90] * (frames - 1) + [2500]
    pictures_[0].save(path, save_all=True, append_images=pictures_[1:], duration=times, loop=0, quality=45, method=4)


def main() -> None:
    """Run what was asked for, or all, and keep the other entries of figures.json."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="configurations (default: all)")
    parser.add_argument("--keep", action="store_true", help="use results that lie in out/gallery already")
    parser.add_argument("--run-only", action="store_true", help="run, draw nothing")
    args = parser.parse_args()
    if unknown := set(args.names) - set(NAMES):
        parser.error(f"unknown: {', '.join(sorted(unknown))}; there are {', '.join(NAMES)}")
    store = GALLERY / "figures.json"
    known = json.loads(store.read_text(encoding="utf-8")) if store.is_file() else {}
    if not args.names and not args.run_only:
        example("index.md", "first.json", "first.svg")
        tilted = ("--set", "goal={kind: lateral, angle_deg: 10}", "--set", "alpha_deg=3")
        example("tutorials/shell.md", "dome.obj", "shell.svg", *tilted)
    for name in args.names or NAMES:
        print(name, flush=True)
        run(name, args.keep)
        if args.run_only:
            continue
        known[name] = figures(name)
        pictures(name)
        ordered = {n: known[n] for n in NAMES if n in known}
        store.write_text(json.dumps(ordered, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
