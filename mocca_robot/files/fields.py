"""Plain data → typed values, each check with a message that names the place, the value, the limit and the remedy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.errors import InputError, nearest
from mocca_robot.tolerances import EXACT

UNIT_LENGTH = 1e-15
"""A vector whose length differs from 1 by less is left as it was written."""

UNITS_M: Mapping[str, float] = {
    "um": 1e-6,
    "mm": 1e-3,
    "cm": 1e-2,
    "m": 1.0,
    "in": 0.0254,
    "ft": 0.3048,
    "pt": 0.0254 / 72,
    "px": 0.0254 / 96,
}
"""Metres per unit. px is the CSS pixel that SVG uses."""

MAX_NAME = 100
MAX_TEXT = 4000
LARGEST = 1e12
"""In any unit, a coordinate beyond it is a slip: products of such numbers leave the range of floating point."""
LARGEST_M = 1e6
"""Coordinates and lengths beyond a thousand kilometres leave a millimetre fewer digits than contacts need."""


def shown(value: object) -> str:
    """Return `value` as it appears in a message, as one writes it in a file: at most 60 characters."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # integers of thousands of digits
        text = f"<{type(value).__name__}>"
    return text if len(text) <= 60 else text[:57] + "…"


def mapping(value: object, where: str, known: Iterable[str] | None = None) -> dict[str, Any]:
    """Return `value` as a dict; raises InputError when it is none or has a key that is not in `known`."""
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a mapping (key: value), not {shown(value)}.")
    if known is not None:
        names = list(known)
        for key in value:
            if key not in names:
                raise InputError(f"{where} has the unknown key {shown(key)}; {nearest(str(key), names)}")
    return value


def number(
    value: object,
    where: str,
    low: float | None = None,
    high: float | None = None,
    *,
    above: float | None = None,
    below: float | None = None,
) -> float:
    """Return `value` as a finite float with low ≤ value ≤ high and above < value < below."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        hint = "write a plain number"
        if isinstance(value, str) and value.count(",") == 1:
            hint = f"use a decimal point: {value.replace(',', '.')[:20]}"
        raise InputError(f"{where} must be a number, not {shown(value)}; {hint}.")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise InputError(f"{where} is {shown(value)}; it must be a finite number.")
    limits = [f"at least {low:g}"] if low is not None else []
    limits += [f"more than {above:g}"] if above is not None else []
    limits += [f"at most {high:g}"] if high is not None else []
    limits += [f"less than {below:g}"] if below is not None else []
    if (
        (low is not None and result < low)
        or (above is not None and result <= above)
        or (high is not None and result > high)
        or (below is not None and result >= below)
    ):
        raise InputError(f"{where} is {result:g}; it must be {' and '.join(limits)}.")
    return result


def integer(value: object, where: str, low: int, high: int) -> int:
    """Return `value` as an int within [low, high]."""
    if isinstance(value, bool) or not isinstance(value, int | float) or value != value or value % 1 != 0:
        raise InputError(f"{where} must be a whole number, not {shown(value)}.")
    return int(number(value, where, low, high))


def boolean(value: object, where: str) -> bool:
    """Return `value` if it is true or false."""
    if not isinstance(value, bool):
        raise InputError(f"{where} must be true or false, not {shown(value)}.")
    return value


def part_name(value: object, where: str) -> str:
    """Return a usable name: text of 1 to 100 printable characters (whole numbers become text)."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 10**18:
        value = str(value)
    if not isinstance(value, str):
        raise InputError(f"{where} must be a name (text), not {shown(value)}.")
    if not value.strip() or len(value) > MAX_NAME or not value.isprintable():
        raise InputError(
            f"{where} is {shown(value)}; a name has 1 to {MAX_NAME} printable characters. Rename it in the file."
        )
    return value


def text(value: object, where: str) -> str:
    """Return a text of 1 to 4000 printable characters, such as a path."""
    if not isinstance(value, str) or not value.strip() or len(value) > MAX_TEXT or not value.isprintable():
        raise InputError(f"{where} must be a text of 1 to {MAX_TEXT} printable characters, not {shown(value)}.")
    return value


def names(value: object, where: str) -> tuple[str, ...]:
    """Return a name or a list of names as a tuple without repeats."""
    listed = value if isinstance(value, list) else [value]
    found = tuple(part_name(v, f"{where}[{k}]" if isinstance(value, list) else where) for k, v in enumerate(listed))
    for name in found:
        if found.count(name) > 1:
            raise InputError(f"{where} names '{name}' {found.count(name)} times; name it once.")
    return found


def known_name(name: str, known: Sequence[str], where: str) -> str:
    """Return `name` if it is among `known`; raises InputError with the nearest otherwise."""
    if name not in known:
        raise InputError(f"{where} names '{name}', which is no part; {nearest(name, known)}")
    return name


def choice(value: object, known: Sequence[str], where: str) -> str:
    """Return `value` if it is one of the texts in `known`."""
    if not isinstance(value, str) or value not in known:
        raise InputError(f"{where} is {shown(value)}; {nearest(str(value)[:60], known)}")
    return value


def length(value: object, unit_m: float, where: str, low: float | None = 0.0, *, above: float | None = None) -> float:
    """Return a length in metres from a number (in units of `unit_m`) or a text with a unit such as '3 mm'.

    Raises InputError beyond `LARGEST_M`, too.
    """
    if isinstance(value, str):
        amount, unit = value.strip().rstrip("abcdefghijklmnopqrstuvwxyz").strip(), ""
        unit = value.strip()[len(amount) :].strip()
        if not unit:
            raise InputError(f"{where} is the text {shown(value)}; write a number, or a number and a unit as '3 mm'.")
        unit_m = UNITS_M[choice(unit, tuple(UNITS_M), f"the unit of {where}")]
        try:
            value = float(amount)
        except ValueError:
            raise InputError(f"{where} is {shown(value)}; write a number and a unit, as '3 mm' or '0.5 in'.") from None
    metres = number(value, where, low, above=above) * unit_m
    if abs(metres) > LARGEST_M:
        raise InputError(f"{where} is {metres:.3g} m; give at most {LARGEST_M:g} m.")
    return metres


class Share(float):
    """A share of something's size, where a length may stand as well."""


def length_or_share(value: object, unit_m: float, where: str) -> float:
    """Return a length in metres as `length` does, or a Share from a text such as '0.02 %'."""
    if isinstance(value, str) and value.strip().endswith("%"):
        try:
            share = float(value.strip()[:-1]) / 100.0
        except ValueError:
            raise InputError(
                f"{where} is {shown(value)}; write a length as '0.2 mm', or a share as '0.02 %'."
            ) from None
        return Share(number(share, where, 0.0, 0.05))
    return length(value, unit_m, where)


def vector(value: object, where: str, sizes: Sequence[int] = (2, 3)) -> Array:
    """Return a list of finite numbers as an array (n,), n among `sizes`."""
    if not isinstance(value, list) or len(value) not in sizes:
        counts = " or ".join(str(s) for s in sizes)
        raise InputError(f"{where} must be a list of {counts} numbers, not {shown(value)}.")
    return read_only([number(v, f"{where}[{k}]") for k, v in enumerate(value)])


def direction(value: object, where: str, sizes: Sequence[int] = (2, 3)) -> Array:
    """Return a unit vector (n,) from any nonzero vector; one that is a unit vector already stays bit for bit."""
    raw = vector(value, where, sizes)
    norm = float(np.linalg.norm(raw))
    if not EXACT < norm < 1e12:
        raise InputError(f"{where} is {shown(value)}; a direction needs a usable length, for example [0, -1].")
    return raw if abs(norm - 1.0) < UNIT_LENGTH else read_only(raw / norm)


def box(value: object, where: str, size: int) -> Array:
    """Return the (2, size) corners of a box, low and high; raises InputError with what is wrong about them."""
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{where} must be two corners, [low, high], not {shown(value)}.")
    low, high = (vector(v, f"{where}[{k}]", (size,)) for k, v in enumerate(value))
    if not (low < high).all():
        raise InputError(f"{where} is {shown(value)}; the low corner must lie below the high one on every axis.")
    return read_only([low, high])


MOST_ROWS = 12


def height_field(value: object, where: str) -> tuple[tuple[float, ...], ...]:
    """Return rows of heights, all of one length, as shares of the largest height, −1 to 1.

    Raises InputError for what is no height field: points in place of heights, rows of several lengths, no height.
    """
    if value == []:
        return ()
    example = "[[0.5, 1, 0.5], [0.5, 1, 0.5]]"
    if not isinstance(value, list) or not value or not all(isinstance(row, list) and row for row in value):
        raise InputError(f"{where} must be rows of heights such as {example}, not {shown(value)}.")
    if any(isinstance(entry, list) for row in value for entry in row):
        raise InputError(
            f"{where} has points in the place of heights; a height field has one height above every place: {example}."
        )
    lengths = sorted({len(row) for row in value})
    if len(lengths) > 1:
        raise InputError(f"{where} has rows of {lengths[0]} and of {lengths[-1]} heights; give every row as many.")
    if max(len(value), lengths[0]) > MOST_ROWS:
        raise InputError(f"{where} is {len(value)} × {lengths[0]} heights; give at most {MOST_ROWS} along each side.")
    rows = [[number(h, f"{where}[{j}][{k}]") for k, h in enumerate(row)] for j, row in enumerate(value)]
    largest = max(abs(h) for row in rows for h in row)
    if largest == 0.0:
        raise InputError(f"{where} is flat; give at least one height other than 0, or [] for none.")
    return tuple(tuple(h / largest for h in row) for row in rows)
