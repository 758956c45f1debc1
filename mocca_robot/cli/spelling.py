"""Unknown commands and options on the command line: the nearest known one goes into the message."""

from __future__ import annotations

import argparse
import difflib
import re
import sys
from typing import NoReturn


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors name what was probably meant."""

    def error(self, message: str) -> NoReturn:
        """Leave with status 2 after usage, message and, for unknown words, the nearest known one."""
        hints = [hint for word in _unknown(message) if (hint := self._nearest(word))]
        super().error(f"{message}{''.join(f' (did you mean {h}?)' for h in hints)}")

    def _nearest(self, word: str) -> str:
        known = _words(self, sys.argv[1:])
        close = difflib.get_close_matches(word.partition("=")[0], known, n=1, cutoff=0.6)
        return close[0] if close else ""


def _unknown(message: str) -> list[str]:
    """Return the words that argparse does not know, from its message."""
    if found := re.search(r"unrecognized arguments: (.*)", message):
        return [w for w in found[1].split() if w.startswith("--")]
    found = re.search(r"invalid choice: '([^']*)'", message)
    return [found[1]] if found else []


def _words(parser: argparse.ArgumentParser, given: list[str]) -> list[str]:
    """Return every option and choice of a parser and of those of its commands that were `given`."""
    words: list[str] = []
    for action in parser._actions:
        words += action.option_strings
        choices = action.choices or ()
        words += [str(c) for c in choices]
        if isinstance(action, argparse._SubParsersAction):
            for name in given:
                if name in action.choices:
                    words += _words(action.choices[name], given)
    return words
