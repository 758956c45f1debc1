"""Friction by pair of materials, how stiff contacts are along themselves, and clamping declared between parts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import InputError, nearest, quoted

TANGENTIAL_RATIO = 1.0
"""k_t/k_n: between equal elastic bodies theory has 2(1 − ν)/(2 − ν), 0.7 to 1; rough faces have less."""


class Made(Protocol):
    """A part, as far as tables of friction see it."""

    @property
    def name(self) -> str:
        """Return its name."""

    @property
    def material(self) -> str:
        """Return its material; empty where none is given."""


class Friction(float):
    """A Coulomb coefficient that may differ from pair to pair of materials; as a number it is the largest.

    Attributes:
        table: ((material, material), coefficient), materials sorted; empty where one number holds for all.
        clamping: ((part, part), newtons): with what force parts press on each other before anything gives.
        tangential_ratio: k_t/k_n of every contact point; without friction it decides nothing.
    """

    table: tuple[tuple[tuple[str, str], float], ...]
    clamping: tuple[tuple[tuple[str, str], float], ...]
    tangential_ratio: float

    def __new__(
        cls,
        value: float = 0.0,
        table: Iterable[tuple[tuple[str, str], float]] = (),
        clamping: Iterable[tuple[tuple[str, str], float]] = (),
        tangential_ratio: float = TANGENTIAL_RATIO,
    ) -> Friction:
        """Return one coefficient for all, or those of `table`, with `clamping` and stiffness."""
        rows = tuple((_sorted(pair), float(mu)) for pair, mu in table)
        made = super().__new__(cls, max((mu for _, mu in rows), default=float(value)))
        made.table, made.clamping, made.tangential_ratio = rows, tuple(clamping), float(tangential_ratio)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make it again in another process."""
        sprung = (self.tangential_ratio,) if self.tangential_ratio != TANGENTIAL_RATIO else ()
        return Friction, (float(self), self.table, self.clamping, *sprung)

    def __eq__(self, other: object) -> bool:
        """Return whether both say the same; a plain number is one without table, clamping and stiffness."""
        return isinstance(other, int | float) and float(self) == float(other) and _more(self) == _more(other)

    def __ne__(self, other: object) -> bool:
        """Return whether they say different things; float has an answer of its own."""
        return not self == other

    def __hash__(self) -> int:
        """Return that of the number."""
        return hash(float(self))


def read_friction(data: Mapping[Any, Any], where: str, low: float, high: float) -> Friction:
    """Return the table {wood-steel: 0.3, …}. Raises InputError for keys that are no pair, and values out of range."""
    rows = []
    if not data:
        raise InputError(f"{where} is empty; give a number, or pairs of materials such as wood-wood: 0.4.")
    for key, value in data.items():
        first, _, second = (m.strip() for m in str(key).partition("-"))
        if not first or not second or "-" in second:
            raise InputError(f"{where}: '{key}' is no pair of materials; write two with a hyphen, such as wood-steel.")
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise InputError(f"{where}.{key} is {value!r}; give a number from {low:g} to {high:g}.")
        rows.append((_sorted((first, second)), float(value)))
    pairs = [pair for pair, _ in rows]
    for pair in pairs:
        if pairs.count(pair) > 1:
            raise InputError(f"{where} gives '{'-'.join(pair)}' twice; keep one.")
    return Friction(0.0, rows)


def tangential_ratio(friction: float) -> float:
    """Return k_t/k_n of contacts with this friction."""
    return friction.tangential_ratio if isinstance(friction, Friction) else TANGENTIAL_RATIO


def sprung(friction: float, ratio: float) -> float:
    """Return the same friction between contacts of k_t/k_n = `ratio`."""
    if ratio == tangential_ratio(friction):
        return friction
    return Friction(friction, _rows(friction), friction.clamping if isinstance(friction, Friction) else (), ratio)


def require_materials(friction: float, parts: Sequence[Made], where: str) -> None:
    """Raise InputError where a table names a material that no part has, or parts have none that it could name."""
    known = {p.material for p in parts if p.material}
    for pair, _ in _rows(friction):
        for material in pair:
            if known and material not in known:
                raise InputError(f"{where}: no part is of '{material}'; {nearest(material, known)}")
    bare = [p.name for p in parts if not p.material] if _rows(friction) else []
    if bare:
        raise InputError(
            f"{where} tells friction by material, but {quoted(bare)} {'has' if len(bare) == 1 else 'have'} none; "
            f"add material: {_rows(friction)[0][0][0]}, or parts: {{{bare[0]}: {{material: …}}}}."
        )


def between(friction: float, parts: Sequence[Made], pairs: IntArray) -> float | Array:
    """Return the coefficient, or (C,) that of every pair of parts `pairs` (C, 2) where there is a table.

    Raises InputError for two materials that touch and that the table does not name.
    """
    table = dict(_rows(friction))
    if not table:
        return float(friction)
    met, which = np.unique(pairs, axis=0, return_inverse=True)
    found = np.empty(len(met))
    for k, (i, j) in enumerate(met):
        pair = _sorted((parts[i].material, parts[j].material))
        if pair not in table:
            raise InputError(
                f"friction: '{'-'.join(pair)}' is missing, but '{parts[i].name}' and '{parts[j].name}' touch; "
                f"{nearest('-'.join(pair), ['-'.join(p) for p in table])}"
            )
        found[k] = table[pair]
    return np.asarray(found[which.ravel()])


def clamped(friction: float, parts: Sequence[Made], touching: IntArray) -> dict[tuple[int, int], float]:
    """Return newtons by pair of part indices, of those declared between parts.

    `touching` (C, 2) are all pairs of the assembly that touch. Raises InputError for parts that do not exist or touch.
    """
    names = [p.name for p in parts]
    found: dict[tuple[int, int], float] = {}
    for pair, force in friction.clamping if isinstance(friction, Friction) else ():
        for name in pair:
            if name not in names:
                raise InputError(f"clamping: there is no part '{name}'; {nearest(name, names)}")
        i, j = sorted(names.index(n) for n in pair)
        if not ((touching == (i, j)) | (touching == (j, i))).all(axis=1).any():
            beside = sorted({names[k] for row in touching if i in row for k in row if k != i})
            raise InputError(
                f"clamping: '{pair[0]}' and '{pair[1]}' do not touch, so nothing can clamp them together; "
                f"'{names[i]}' touches {quoted(beside)}."
            )
        found[i, j] = found.get((i, j), 0.0) + force
    return found


def _rows(friction: float) -> tuple[tuple[tuple[str, str], float], ...]:
    return friction.table if isinstance(friction, Friction) else ()


def _more(friction: object) -> tuple[object, object, float]:
    if not isinstance(friction, Friction):
        return (), (), TANGENTIAL_RATIO
    return friction.table, friction.clamping, friction.tangential_ratio if friction else TANGENTIAL_RATIO


def _sorted(pair: tuple[str, str]) -> tuple[str, str]:
    return (pair[0], pair[1]) if pair[0] <= pair[1] else (pair[1], pair[0])
