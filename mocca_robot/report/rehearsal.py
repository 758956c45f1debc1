"""rehearsal.html: what was seen of every part, and a player of the whole build, complete in one file."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocca_robot.arrays import Array
from mocca_robot.assembly import Mesh
from mocca_robot.files.output import write_atomic
from mocca_robot.report.markup import badge, esc, listed, script_json, table
from mocca_robot.report.page import document
from mocca_robot.report.scene3d import packed
from mocca_robot.report.sections import section

MOVED_M, MOVED_QUAT = 1e-4, 5e-4
"""A body that moved by less than this since its last kept frame has not moved to the eye."""


@dataclass(frozen=True, eq=False)
class ShownBody:
    """Something to look at: its surface in its own frame, its colour, and whether it is a part of the structure."""

    name: str
    mesh: Mesh
    rgb: tuple[float, float, float]
    is_part: bool


@dataclass(frozen=True)
class Chapter:
    """When something begins, seconds, and what."""

    time_s: float
    title: str
    part: str


@dataclass(frozen=True, eq=False)
class CellFilm:
    """Bodies and their motion in the robot's base frame.

    Attributes:
        times: (T,) seconds, simulated.
        poses: (T, B, 7) position and quaternion, w first.
        chapters: in the order of their times.
    """

    bodies: tuple[ShownBody, ...]
    times: Array
    poses: Array
    chapters: tuple[Chapter, ...]


def write_rehearsal_page(path: Path, data: Mapping[str, Any], film: CellFilm) -> Path:
    """Return `path` after writing the page there; `data` as in rehearsal.json."""
    return write_atomic(Path(path), rehearsal_page(data, film))


def rehearsal_page(data: Mapping[str, Any], film: CellFilm) -> str:
    """Return the page as one HTML document. Same data, same text."""
    mark = badge("ok", "built") if data["succeeded"] else badge("bad", "not built")
    placed = sum(bool(p["succeeded"]) for p in data["parts"])
    lead = (
        f"{placed} of {data['planned_parts']} parts placed by a simulated {esc(data['robot'])}; "
        f"{data['simulated_s']:.0f} s in {esc(data['engine'])}."
    )
    if data["interrupted"]:
        lead += " Interrupted: this is what was seen until then."
    header = f'<header class="top"><h1>{esc(data["name"])}: rehearsal {mark}</h1><p>{lead}</p>{_whole(data)}</header>'
    body = section("player", "What happened", player(film)) + section("parts", "Part by part", _parts(data, film))
    return document(f"{data['name']}: rehearsal", header, body + _about(data), ["rehearsal.js", "viewer3d.js"])


def _whole(data: Mapping[str, Any]) -> str:
    whole = data["whole"]
    if whole is None:
        return "<p>The finished structure was not reached.</p>"
    word = "with" if data["partial"] else "without"
    cradled = set(data["cradles"])
    kinds = {"supports": [n for n in data["supports"] if n not in cradled], "cradles": data["cradles"]}
    held = " and ".join(f"{kind} ({listed(names, 6)})" for kind, names in kinds.items() if names)
    taken = f" {word} its {held}" if held else ""
    what = ("What was built" if data["partial"] else "The whole") + taken
    return f"<p>{what}: {_standing(whole)} {esc(whole['reason'])}.</p>"


def _standing(standing: Mapping[str, Any] | None) -> str:
    if standing is None:
        return badge("none", "not reached")
    verdict = standing["stands"]
    if verdict is None:
        return badge("warn", "no verdict")
    return badge("ok", "stands") if verdict else badge("bad", "falls")


def _farthest(standing: Mapping[str, Any] | None) -> str:
    if standing is None or not standing["farthest"]:
        return "–"
    return f"{1e3 * standing['displacement_m']:.2f} mm ({esc(standing['farthest'])})"


def _parts(data: Mapping[str, Any], film: CellFilm) -> str:
    times = {c.part: c.time_s for c in film.chapters}
    rows = []
    for p in data["parts"]:
        grasped, inserted, standing = p["grasped"], p["inserted"], p["standing"]
        rows.append(
            [
                f'<button type="button" class="step" data-time="{times.get(p["part"], 0.0):.3f}">'
                f"{esc(p['part'])}</button>",
                _grasp(grasped),
                _insertion(inserted),
                _standing(standing),
                _farthest(standing),
                _remark(p),
            ]
        )
    head = ("Part", "Held", "Inserted", "After release", "Farthest from its place", "Remark")
    return table(head, rows, caption="What was seen of every part")


def _grasp(grasped: Mapping[str, Any] | None) -> str:
    if grasped is None:
        return badge("none", "not grasped")
    words = f"over {1e3 * grasped['width_m']:.1f} mm" if grasped["width_m"] else "by the cup"
    if grasped["slip_m"] is not None:
        words += f", slipped {1e3 * grasped['slip_m']:.2f} mm and {grasped['slip_deg']:.2f}°"
    lost = badge("bad", "lost") + " " if grasped["held"] is False else ""
    return lost + words


def _insertion(inserted: Mapping[str, Any] | None) -> str:
    if inserted is None:
        return badge("none", "not reached")
    mark = badge("ok", "in") if inserted["succeeded"] else badge("bad", "not in")
    depth = 0.0 if inserted["depth_m"] is None else inserted["depth_m"]
    pushes = "" if inserted["attempts"] == 1 else f", {inserted['attempts']} pushes"
    return (
        f"{mark} {1e3 * depth:.1f} of {1e3 * inserted['planned_depth_m']:.1f} mm, "
        f"at most {inserted['peak_force_n'] or 0.0:.1f} N{pushes}"
    )


def _remark(part: Mapping[str, Any]) -> str:
    words = [esc(f"{part['status']}: {part['detail']}")] if part["detail"] else []
    words += [f"{badge('warn', 'touched')} {esc(t['what'])}, {t['force_n']:.1f} N" for t in part["touches"]]
    standing = part["standing"]
    if standing is not None and standing["moved"]:
        words.append(f"moved: {listed(standing['moved'], 6)}")
    return "; ".join(words) or "–"


def _about(data: Mapping[str, Any]) -> str:
    o = data["options"]
    words = (
        f"Friction within joints {o['friction']:g}, between pads and parts {o['pad_friction']:g}; parts wait in the "
        f"tray with errors of {1e3 * o['pose_noise_m']:g} mm and {o['pose_noise_deg']:g}° (seed {o['seed']}); free "
        f"motions at {o['speed']:g} times their planned speed. Plan {esc(data['plan_sha256'][:12])}, design "
        f"{esc(data['design_sha256'][:12])}. A simulation is no proof about a real cell."
    )
    return section("about", "How this was made", f"<p>{words}</p>")


def player(film: CellFilm) -> str:
    """Return the player of a film with its data, for `rehearsal.js`."""
    rates = "".join(f'<option value="{r}"{" selected" if r == 8 else ""}>{r}×</option>' for r in (1, 2, 4, 8, 16, 32))
    rates = rates.replace(" selected", ' selected="selected"')
    controls = (
        '<div class="controls needs-script"><button type="button" id="play">▶ Play</button>'
        '<input type="range" id="time" min="0" max="1" step="0.05" value="0" aria-label="Time"/>'
        f'<label>speed <select id="rate">{rates}</select></label><span id="clock" class="mute"></span>'
        '<strong id="now" aria-live="polite"></strong>'
        '<label><input type="checkbox" class="scene-toggle" data-show="names"/>names</label>'
        '<input type="range" id="explode" hidden="hidden" min="0" max="1" value="0"/></div>'
    )
    stage = (
        '<div class="stage" id="stage3d"><canvas id="view" tabindex="0" role="img" '
        'aria-label="The cell; drag to turn, wheel to zoom."></canvas><div id="tags" aria-hidden="true"></div></div>'
    )
    payload = "".join(
        f'<script type="application/json" id="{key}">{script_json(value)}</script>'
        for key, value in (("scene", _scene(film)), ("motion", _motion(film)))
    )
    return stage + controls + payload


def _scene(film: CellFilm) -> dict[str, Any]:
    """Return the bodies as viewer3d.js takes them: nothing but surfaces, all there from the beginning."""
    places = film.poses[-1, :, :3]
    parts = places[[b.is_part for b in film.bodies]]
    low, high = parts.min(axis=0), parts.max(axis=0)
    nothing = {"low": [0, 0, 0], "step": [0, 0, 0], "vertices": "", "faces": "", "edges": "", "wide": False}
    bodies = [
        {
            "name": b.name if b.is_part else "",
            "colour": [round(c, 3) for c in b.rgb],
            "step": -1,
            "centroid": [0.0, 0.0, 0.0],
            "travel": [0.0, 0.0, 0.0],
            "result": packed(b.mesh),
            "input": nothing,
        }
        for b in film.bodies
    ]
    size = max(2.2 * float(np.linalg.norm(high - low)), 0.9)
    return {
        "centre": [float(v) for v in 0.5 * (low + high)],
        "size": size,
        "parts": bodies,
        "cones": {"asked": "", "free": ""},
        "forces": "",
        "collapse": {"result": None, "input": None},
        "states": {},
    }


def _motion(film: CellFilm) -> dict[str, Any]:
    tracks = []
    for poses in np.moveaxis(film.poses, 1, 0):
        kept = _kept(poses)
        tracks.append({"frames": _base64(kept.astype("<u2")), "poses": _base64(poses[kept].astype("<f4"))})
    return {
        "times": _base64(film.times.astype("<f4")),
        "tracks": tracks,
        "chapters": [{"t": c.time_s, "title": c.title} for c in film.chapters],
    }


def _kept(poses: Array) -> NDArray[np.int64]:
    """Return the frames in which a body has moved since the last that was kept."""
    kept = [0]
    for k in range(1, len(poses)):
        change = np.abs(poses[k] - poses[kept[-1]])
        if change[:3].max() > MOVED_M or change[3:].max() > MOVED_QUAT:
            kept.append(k)
    return np.array(kept, dtype=np.int64)


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


__all__: Sequence[str] = ("CellFilm", "Chapter", "ShownBody", "player", "rehearsal_page", "write_rehearsal_page")
