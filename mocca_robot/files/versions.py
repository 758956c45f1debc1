"""Versions of the file formats: which one this program writes, and how older documents become that one.

A format's steps are pure functions, document → document, each to the next version. A change that a reader cannot tell
by itself (a key with another meaning, unit or name) adds one; keys that may be left out need none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from mocca_robot.errors import InputError
from mocca_robot.files import fields

Step = Callable[[Mapping[str, Any]], dict[str, Any]]


def numbered(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document without version as version 1, which it is: there was none before."""
    return {**document, "version": 1}


@dataclass(frozen=True)
class Format:
    """A file format.

    Attributes:
        name: the value of the key 'format'.
        steps: from the oldest version that is read to the present one.
        oldest: that version; 0 stands for documents that do not say theirs.
        remedy: what to do about one that cannot be read.
        by_hand: a YAML file that people write: it says no format, and its first version needs no number.
    """

    name: str
    steps: tuple[Step, ...] = (numbered,)
    oldest: int = 0
    remedy: str = "export the file again"
    by_hand: bool = False

    @property
    def version(self) -> int:
        """Return the version that this program writes."""
        return self.oldest + len(self.steps)

    def current(self, document: Mapping[str, Any], where: str) -> tuple[dict[str, Any], tuple[str, ...]]:
        """Return `document` in the present version, and a note when it was in another.

        Raises InputError for another format, a version that is newer, none or too old; `where` names the file.
        """
        found = document.get("format")
        if found != self.name and not self.by_hand:
            raise InputError(f'{where} has "format": {fields.shown(found)}; it must be "{self.name}".')
        unsaid = 1 if self.by_hand else 0
        number = fields.integer(document["version"], f"{where}: version", 1, 10**6) if "version" in document else unsaid
        if number > self.version:
            raise InputError(
                f"{where} has version {number} of {self.name}; this program reads up to version {self.version}. "
                f"Upgrade mocca-robot, or {self.remedy} with this one."
            )
        said = f"version {number}" if "version" in document else 'no "version"'
        if number < self.oldest:
            raise InputError(f"{where} has {said}; {self.name} is read from version {self.oldest}: {self.remedy}.")
        result = dict(document)
        for step in self.steps[number - self.oldest :]:
            result = step(result)
        note = f"{where} has {said}; it was read as version {self.version} of {self.name}."
        return result, () if number == self.version else (note,)


ASSEMBLY = Format("mocca-robot/assembly")
DESIGN = Format("mocca-robot/design", remedy="design again")
SIMULATION = Format("mocca-robot/simulation", remedy="simulate again")
REHEARSAL = Format("mocca-robot/rehearsal", remedy="rehearse again")
STRENGTH = Format("mocca-robot/strength", (), 1, "ask for the strength again")
STUDY = Format("mocca-robot/study", remedy="run the study again")
# What moves a robot says exactly what it is: nothing about these two is taken for granted.
PLAN = Format("mocca-robot/plan", (), 1, "plan again")
JOURNAL = Format("mocca-robot/journal", (), 1, "begin another journal")
# Where an interrupted design stood is gone on with exactly or not at all.
PROGRESS = Format("mocca-robot/design-progress", (), 1, "design from the start")
CONFIG = Format("mocca-robot/config", (), 1, "write the file again, as `mocca-robot new` does,", by_hand=True)
STUDY_FILE = Format("mocca-robot/study-file", (), 1, "write the study again", by_hand=True)
CELL = Format("mocca-robot/cell", (), 1, "write the cell again, like those in configs/cells,", by_hand=True)
