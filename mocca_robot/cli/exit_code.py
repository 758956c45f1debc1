"""What the exit status of a command says."""

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit status of `mocca-robot`; scripts depend on these numbers."""

    POSITIVE = 0
    """Every verdict is positive; what was asked for is done."""
    NEGATIVE = 1
    """A negative verdict, with its evidence."""
    UNUSABLE = 2
    """The input, or the machine, cannot be used as it is."""
    INTERNAL = 70
    """An error in mocca-robot itself."""
    INTERRUPTED = 130
    """Ctrl-C; what was finished is kept."""


def positive_if(holds: object) -> ExitCode:
    """Return POSITIVE where `holds` is true, else NEGATIVE."""
    return ExitCode.POSITIVE if holds else ExitCode.NEGATIVE
