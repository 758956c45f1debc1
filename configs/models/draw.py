"""Writes the flat models of this folder as SVG: `python configs/models/draw.py [FOLDER]`.

A drawing is a dictionary of outlines in millimetres, x to the right, y up. An outline is a list of points: `(x, y)` is
a corner, `(x, y, S)` a point that a smooth curve runs through between the corners before and after it. Straight
edges that two outlines share become contacts. Corners are rounded once, and a corner of one part that lies on an edge
of another is added to that edge, so that neighbours share their vertices to the last digit.
"""

from __future__ import annotations

import math
import sys
from itertools import pairwise
from pathlib import Path

Point = tuple[float, float]
Outline = list[tuple[float, ...]]
Drawing = dict[str, Outline]

S = 1.0
"""Marks a point on a smooth curve."""
DIGITS = 4
MARGIN_MM = 10.0
GREY = "#b8b8b8"
PALETTES = {
    "m": ("#77aadd", "#99ddff", "#44bb99", "#ee8866"),
    "scarecrow": ("#ee8866", "#ee8866", "#eedd88"),
    "stack": ("#77aadd", "#eedd88", "#ee8866", "#99ddff", "#bbcc33", "#ffaabb", "#44bb99", "#aaaa00", "#77aadd"),
    "tree": ("#44bb99", "#bbcc33"),
    "deer": ("#d9a066", "#b97a45", "#f0cfa0", "#b97a45", "#d9a066", "#b97a45", "#d9a066", "#f0cfa0", "#d9a066",
             "#eedd88", "#aaaa00", "#f0cfa0"),
    "tower": ("#ee8866", "#eedd88", "#ffaabb", "#eedd88", "#ffaabb", "#ee8866", "#eedd88", "#ee8866", "#eedd88",
              "#ffaabb", "#eedd88", "#ee8866"),
}  # fmt: skip
"""Fill colours of the free parts in drawing order, mostly Paul Tol's light scheme: they stay apart in common colour
blindness, and neighbours differ in lightness. Fixed parts are grey."""


def mirrored(outline: Outline, axis_x: float = 0.0) -> Outline:
    """Return the outline mirrored left to right."""
    return [(2 * axis_x - p[0], *p[1:]) for p in reversed(outline)]


def turned(outline: Outline, angle_deg: float) -> Outline:
    """Return the outline turned clockwise about the origin."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    return [(c * p[0] + s * p[1], -s * p[0] + c * p[1], *p[2:]) for p in outline]


def letter_m() -> Drawing:
    """Ten parts in one chain: two legs of four blocks, and two arms that slide down their slanted shoulders."""
    left: Drawing = {
        "foot_left": [
            (-16, 0), (146, 0), (146, 26), (134, 34, S), (130, 54, S), (130, 84), (0, 84), (0, 54, S), (-4, 34, S),
            (-16, 26),
        ],
        "shin_left": [(0, 84), (130, 84), (130, 164), (0, 164)],
        "thigh_left": [(0, 164), (130, 164), (130, 236), (0, 236)],
        "shoulder_left": [(0, 236), (130, 236), (130, 258), (0, 324)],
        "arm_left": [(0, 324), (130, 258), (208, 172), (208, 230), (110, 400), (0, 400)],
    }  # fmt: skip
    right = {name.replace("left", "right"): mirrored(outline, 208) for name, outline in left.items()}
    return left | right


def scarecrow() -> Drawing:
    """A body on a pole; the head is a wedge between two arms that balance on sloping shoulders."""
    arm: Outline = [
        (22, 250), (94, 232), (128, 225, S), (170, 220), (168, 208), (188, 220), (212, 206), (208, 226), (230, 238),
        (208, 248), (214, 268), (190, 260), (170, 276), (172, 264), (132, 276, S), (108, 290, S), (86, 294),
    ]  # fmt: skip
    right_side: Outline = [
        (0, -30), (13, -4), (13, 84), (34, 66), (52, 84), (72, 62), (104, 80), (92, 130, S), (88, 190, S), (94, 232),
        (22, 250),
    ]  # fmt: skip
    face: Outline = [
        (22, 250), (86, 294), (74, 306, S), (46, 304), (66, 330, S), (68, 356, S), (60, 378), (122, 370, S),
        (126, 382, S), (62, 396), (58, 430, S), (34, 480), (16, 470, S),
    ]  # fmt: skip
    return {
        "body": right_side + mirrored(right_side)[:-1],
        "arm_left": mirrored(arm),
        "arm_right": arm,
        "head": [*face, (-2, 478), *mirrored(face)],
    }  # fmt: skip


def tree() -> Drawing:
    """A fir: three tiers, each split down the middle, on a trunk whose top sheds them to either side."""
    right: Drawing = {
        "low_right": [(0, 124), (62, 114), (104, 100, S), (156, 82), (100, 140, S), (58, 222), (0, 232)],
        "middle_right": [(0, 232), (58, 222), (88, 210, S), (126, 194), (82, 246, S), (46, 318), (0, 326)],
        "top_right": [(0, 326), (46, 318), (66, 308, S), (96, 292), (50, 356, S), (0, 452)],
    }
    trunk: Outline = [
        (-62, 114), (-62, 60, S), (-76, 24, S), (-112, 0), (112, 0), (76, 24, S), (62, 60, S), (62, 114), (0, 124),
    ]  # fmt: skip
    left = {name.replace("right", "left"): mirrored(outline) for name, outline in right.items()}
    return {"trunk": trunk} | left | right


def stack() -> Drawing:
    """A cairn: stones on slanted beds, with two stones side by side in the second layer."""

    def bed(x: float, y: float, half: float, slope_deg: float) -> tuple[Point, Point]:
        dx, dy = half * math.cos(math.radians(slope_deg)), half * math.sin(math.radians(slope_deg))
        return (x - dx, y - dy), (x + dx, y + dy)

    def stone(beds_below: list[tuple[Point, Point]], beds_above: list[tuple[Point, Point]], bulge: float) -> Outline:
        left, right = beds_below[0][0], beds_below[-1][1]
        top_left, top_right = beds_above[0][0], beds_above[-1][1]
        height = 0.5 * (top_left[1] + top_right[1] - left[1] - right[1])
        out_right, out_left = max(right[0], top_right[0]) + bulge, min(left[0], top_left[0]) - bulge
        up = [p for bed in beds_below for p in bed]
        down = [p for bed in reversed(beds_above) for p in reversed(bed)]
        right_side = [(out_right - 2, right[1] + 0.35 * height, S), (out_right, right[1] + 0.65 * height, S)]
        left_side = [(out_left, left[1] + 0.65 * height, S), (out_left + 2, left[1] + 0.35 * height, S)]
        return [*up, *right_side, *down, *left_side]

    ground = bed(0, 46, 84, 7)
    twins = [bed(-50, 112, 32, 9), bed(52, 112, 30, -9)]
    lintel = [bed(-48, 162, 30, -8), bed(50, 162, 30, 8)]
    heights = [(4, 218, 58, -10), (-3, 270, 50, 12), (4, 318, 42, -11), (-2, 360, 34, 12), (3, 398, 26, -10)]
    upper = [bed(*height) for height in heights]
    cobbles = {f"cobble_{k}": stone([low], [high], 14) for k, (low, high) in enumerate(pairwise(upper), start=1)}
    return {
        "ground": [(-190, 0), (190, 0), (160, 22, S), (120, 42, S), ground[1], ground[0], (-120, 34, S), (-160, 20, S)],
        "boulder": stone([ground], twins, 22),
        "twin_left": stone([twins[0]], [lintel[0]], 8),
        "twin_right": stone([twins[1]], [lintel[1]], 8),
        "slab": stone(lintel, [upper[0]], 18),
        **cobbles,
        "pebble": [*upper[-1], (34, 412, S), (22, 434, S), (0, 442, S), (-20, 436, S), (-32, 418, S)],
    }


def leaning_tower(lean_deg: float, doorway: bool) -> Drawing:
    """A battlemented tower of running bond, turned as a whole; only its lowest stones are cut for the lean.

    With a doorway the footing is two stones, which the middle stone of the lowest course bridges.
    """
    width, course, batter, bulge, overhang = 200.0, 40.0, 4.0, 3.0, 10.0
    cut = math.tan(math.radians(0.35 * lean_deg))
    footing = 120.0

    def bed(k: int, x: float) -> Point:
        """A point of the bed under course k + 1; the shaft gets narrower by the batter on either side."""
        inside = min(max(x, k * batter), width - k * batter)
        return inside, footing + k * course + (cut * (x - width / 2) if k == 0 else 0.0)

    def block(k: int, x0: float, x1: float) -> Outline:
        low_left, low_right, high_right, high_left = bed(k, x0), bed(k, x1), bed(k + 1, x1), bed(k + 1, x0)
        right = [(width - (k + 0.5) * batter + bulge, 0.5 * (low_right[1] + high_right[1]), S)] if x1 == width else []
        left = [((k + 0.5) * batter - bulge, 0.5 * (low_left[1] + high_left[1]), S)] if x0 == 0.0 else []
        return [low_left, low_right, *right, high_right, high_left, *left]

    # Flat stones and a low battlement: the higher a stone, the further it leans out over its own bed.
    thirds, quarters, parapet = (0.0, 1 / 3, 2 / 3, 1.0), (0.0, 0.18, 0.5, 0.82, 1.0), 0.5
    parts: Drawing = {}
    for k, row in enumerate((thirds, quarters, thirds)):
        for n, (x0, x1) in reversed(list(enumerate(pairwise(row)))):
            parts[f"course_{k + 1}_{n + 1}"] = block(k, x0 * width, x1 * width)

    wall, low, high = width - 3 * batter, bed(3, 0)[1], bed(4, 0)[1]
    edge, breadth = wall + overhang, 2 * (wall + overhang) - width
    merlon, gap, tip = 0.15 * breadth, 0.4 / 3 * breadth, high + 15.0

    def battlement(seam: float) -> Outline:
        """The right one of two stones that meet at x = seam, in the middle one of three gaps."""
        return [
            (seam, low), (wall, low), (wall, low + 14), (edge, low + 25), (edge, tip), (edge - merlon, tip),
            (edge - merlon, high), (edge - merlon - gap, high), (edge - merlon - gap, tip),
            (edge - 2 * merlon - gap, tip), (edge - 2 * merlon - gap, high), (seam, high),
        ]  # fmt: skip

    parts["parapet_right"] = battlement(parapet * width)
    parts["parapet_left"] = mirrored(battlement((1.0 - parapet) * width), width / 2)
    return _footing(lean_deg, doorway, width, bed(0, 0), bed(0, width)) | {
        name: turned(outline, lean_deg) for name, outline in parts.items()
    }


def _footing(lean_deg: float, doorway: bool, width: float, left: Point, right: Point) -> Drawing:
    """The fixed stones: what the leaning shaft stands on, down to level ground."""
    slope = math.tan(math.radians(lean_deg))
    ground = min(0.0, *(y for _, y in turned([(0.0, 0.0), (width, 0.0)], lean_deg)))
    cos = math.cos(math.radians(lean_deg))

    def at_ground(x: float) -> Point:
        return x, ground / cos + slope * x

    foot_left, foot_right, top_left, top_right = turned([at_ground(0), at_ground(width), left, right], lean_deg)
    x0, x1, y0 = foot_left[0] - 46, foot_right[0] + 46, ground - 24
    left_side: Outline = [top_left, foot_left, (x0, ground), (x0, y0)]
    right_side: Outline = [(x1, y0), (x1, ground), foot_right, top_right]
    middle, jamb, slit = 0.5 * width, 22.0, 3.0
    tilt = (right[1] - left[1]) / width

    def door(side: float) -> Outline:
        """One side of the way in, from the crown of its arch down to the sill."""
        spring = at_ground(middle)[1] + 46
        arch = [
            (middle + side * 10, spring + 24, S),
            (middle + side * 18, spring + 14, S),
            (middle + side * jamb, spring),
        ]
        return turned([*arch, at_ground(middle + side * jamb)], lean_deg)

    apex = (middle, at_ground(middle)[1] + 76)
    door_left, door_right = door(-1.0), door(1.0)
    if not doorway:
        (tip,) = turned([apex], lean_deg)
        arch = [(door_left[-1][0], y0), *reversed(door_left), tip, *door_right, (door_right[-1][0], y0)]
        return {"footing": [*left_side, *arch, *right_side]}
    sill = 0.5 * (door_left[-1][0] + door_right[-1][0])

    def jaw(side: float, jambs: Outline) -> Outline:
        x = middle + side * slit
        gap = turned([(x, left[1] + tilt * x), (x, apex[1] - 3)], lean_deg)
        return [*gap, *jambs, (sill + side * slit, ground), (sill + side * slit, y0)]

    return {
        "footing_left": [*left_side, *reversed(jaw(-1.0, door_left))],
        "footing_right": [*right_side, *jaw(1.0, door_right)],
    }


def deer() -> Drawing:
    """A stag: the belly is a keystone between rump and chest, the neck stands on back and chest."""
    return {
        "legs_hind": [
            (66, 158), (128, 148), (160, 146), (152, 112, S), (146, 70, S), (150, 22, S), (158, 0), (130, 0),
            (128, 40, S), (124, 76, S), (114, 96, S), (104, 70, S), (98, 30, S), (104, 0), (76, 0), (74, 40, S),
            (80, 72, S), (62, 112, S),
        ],
        "legs_fore": [
            (228, 146), (256, 148), (336, 158), (326, 112, S), (312, 70, S), (314, 22, S), (320, 0), (292, 0),
            (292, 40, S), (288, 80, S), (276, 104, S), (266, 80, S), (262, 30, S), (266, 0), (238, 0), (240, 30, S),
            (240, 80, S), (236, 112, S),
        ],
        "rump": [(66, 158), (128, 148), (94, 206), (46, 212), (46, 184, S)],
        "chest": [(256, 148), (336, 158), (354, 186, S), (362, 222), (324, 239.48), (295, 252.82), (290, 206)],
        "belly": [
            (128, 148), (160, 146), (194, 154, S), (228, 146), (256, 148), (290, 206), (94, 206),
        ],
        "withers": [(238, 206), (290, 206), (295, 252.82), (262, 268), (250, 264, S), (238, 262)],
        "back": [(158, 206), (238, 206), (238, 262), (196, 256, S), (158, 260)],
        "croup": [(46, 212), (94, 206), (158, 206), (158, 260), (120, 263, S), (80, 260), (48, 244)],
        "nape": [(262, 268), (295, 252.82), (324, 239.48), (318, 345), (288, 352), (278, 310, S)],
        "throat": [(324, 239.48), (362, 222), (360, 262, S), (346, 300, S), (350, 338), (318, 345)],
        "head": [
            (288, 352), (318, 345), (350, 338), (376, 326, S), (396, 310), (410, 312, S), (414, 326), (388, 362, S),
            (358, 392), (318, 402), (278, 402), (252, 416, S), (228, 414), (244, 392, S), (276, 380), (286, 366, S),
        ],
        "antler_hind": [
            (278, 402), (318, 402), (318, 430), (308, 446, S), (304, 458), (324, 474, S), (332, 502), (312, 488, S),
            (296, 478), (296, 504, S), (306, 536), (282, 510, S), (276, 466), (262, 470, S), (250, 488), (250, 462, S),
            (270, 436),
        ],
        "antler_fore": [
            (318, 402), (358, 392), (358, 424), (376, 440, S), (384, 472), (368, 458, S), (354, 454), (358, 490, S),
            (346, 536), (340, 500, S), (336, 462), (330, 446, S), (318, 430),
        ],
        "tail": [(48, 244), (80, 260), (76, 280, S), (46, 296), (46, 270, S)],
    }  # fmt: skip


DRAWINGS = {
    "m": letter_m,
    "scarecrow": scarecrow,
    "stack": stack,
    "tree": tree,
    "leaning_tower_10": lambda: leaning_tower(10.0, doorway=True),
    "leaning_tower_20": lambda: leaning_tower(20.0, doorway=True),
    "leaning_tower_30": lambda: leaning_tower(30.0, doorway=False),
    "leaning_tower_support_free": lambda: leaning_tower(12.0, doorway=True),
    "deer": deer,
}


def exact(drawing: Drawing) -> Drawing:
    """Return the drawing on the first quadrant, rounded, with every corner that lies on a straight edge added to it."""
    low_x, low_y = (min(p[k] for outline in drawing.values() for p in outline) for k in (0, 1))
    moved = {
        name: [(round(p[0] - low_x, DIGITS), round(p[1] - low_y, DIGITS), *p[2:]) for p in outline]
        for name, outline in drawing.items()
    }
    corners = sorted({(p[0], p[1]) for outline in moved.values() for p in outline if len(p) == 2})
    result: Drawing = {}
    for name, outline in moved.items():
        result[name] = []
        for start, end in zip(outline, outline[1:] + outline[:1]):
            result[name].append(start)
            if len(start) == len(end) == 2:
                result[name].extend(_corners_between(start, end, corners))
    return result


def _corners_between(start: tuple[float, ...], end: tuple[float, ...], corners: list[Point]) -> list[Point]:
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    inside = []
    for x, y in corners:
        along = ((x - start[0]) * dx + (y - start[1]) * dy) / length
        off = ((x - start[0]) * dy - (y - start[1]) * dx) / length
        if abs(off) < 3 * 10**-DIGITS and 0.01 < along < length - 0.01:
            inside.append((along, (x, y)))
    return [point for _, point in sorted(inside)]


def path_data(outline: Outline, height: float) -> str:
    """Return the closed outline as SVG path data, y down; smooth points become cubic Béziers (Catmull–Rom)."""
    first = next(k for k, p in enumerate(outline) if len(p) == 2)
    ring = [*outline[first:], *outline[:first], outline[first]]

    def text(x: float, y: float) -> str:
        return f"{round(x + MARGIN_MM, DIGITS)} {round(height - MARGIN_MM - y, DIGITS)}"

    words = [f"M {text(*ring[0][:2])}"]
    for k in range(1, len(ring)):
        start, end = ring[k - 1], ring[k]
        if len(start) == len(end) == 2:
            if k < len(ring) - 1:
                words.append(f"L {text(*end[:2])}")
            continue
        before = ring[k - 2] if len(start) == 3 else start
        after = ring[k + 1] if len(end) == 3 else end
        c1 = (start[0] + (end[0] - before[0]) / 6, start[1] + (end[1] - before[1]) / 6)
        c2 = (end[0] - (after[0] - start[0]) / 6, end[1] - (after[1] - start[1]) / 6)
        words.append(f"C {text(*c1)} {text(*c2)} {text(*end[:2])}")
    return " ".join([*words, "Z"])


def svg(name: str, drawing: Drawing) -> str:
    """Return the drawing as an SVG document in millimetres, one closed path per part."""
    drawing = exact(drawing)
    width, height = (math.ceil(max(p[k] for o in drawing.values() for p in o) + 2 * MARGIN_MM) for k in (0, 1))
    palette = PALETTES["tower" if name.startswith("leaning_tower") else name]
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" '
        f'viewBox="0 0 {width} {height}">',
        f"  <title>{name.replace('_', ' ')}</title>",
        '  <g stroke="#333333" stroke-width="0.6" stroke-linejoin="round">',
    ]
    free = (part for part in drawing if part not in FIXED_PARTS)
    fills = {part: palette[k % len(palette)] for k, part in enumerate(free)}
    for part, outline in drawing.items():
        lines.append(f'    <path id="{part}" fill="{fills.get(part, GREY)}" d="{path_data(outline, height)}"/>')
    return "\n".join([*lines, "  </g>", "</svg>", ""])


FIXED_PARTS = {
    "foot_left", "foot_right", "body", "trunk", "ground", "footing", "footing_left", "footing_right",
    "legs_hind", "legs_fore",
}  # fmt: skip


def main(folder: Path) -> None:
    """Write every drawing to `folder`."""
    for name, draw in DRAWINGS.items():
        (folder / f"{name}.svg").write_text(svg(name, draw()), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
