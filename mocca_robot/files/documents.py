"""Text files → plain data, with every way in which a file can be broken turned into one InputError.

Nothing a file says can run code, reach another file or grow without bound: sizes are limited before parsing,
YAML knows only plain values (no tags, no aliases), JSON only finite numbers.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from mocca_robot.errors import InputError

MAX_YAML_BYTES = 512 * 1024
MAX_TEXT_BYTES = 64 * 1024 * 1024


def existing_path(path: Path) -> Path:
    """Return `path` if something is there; raises InputError naming files beside it that are spelt alike."""
    import difflib

    try:
        found = path.exists()
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        raise InputError(f"'{path}' is not a usable file name ({error}).") from None
    if found:
        return path
    try:
        beside = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
    except OSError:
        beside = []
    close = difflib.get_close_matches(path.name, beside, n=1, cutoff=0.6)
    hint = f"did you mean '{path.parent / close[0]}'?" if close else f"the folder is '{path.parent}'; check the name."
    raise InputError(f"'{path}' does not exist; {hint}")


def read_text(path: Path, limit: int = MAX_TEXT_BYTES) -> str:
    """Return the UTF-8 text of a regular file of at most `limit` bytes; raises InputError otherwise."""
    existing_path(path)
    if path.is_dir():
        raise InputError(f"'{path}' is a folder; name a file in it.")
    if not path.is_file():
        raise InputError(f"'{path}' is not a regular file; copy its content into one.")
    try:
        size = path.stat().st_size
        if size > limit:
            raise InputError(f"'{path}' has {size / 1e6:.4g} MB; at most {limit / 1e6:.4g} MB are read. Simplify it.")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}; check its permissions.") from None
    if not content.strip():
        raise InputError(f"'{path}' is empty.")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"'{path}' is stored as UTF-16; save it as UTF-8.")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"'{path}' is not UTF-8 text (byte {error.start} is 0x{content[error.start]:02x}); "
            "it is binary or in another encoding. Save it as UTF-8."
        ) from None
    if "\0" in text:
        raise InputError(f"'{path}' is binary (it holds NUL characters), not text.")
    return text


def decoded(content: bytes) -> tuple[str, str]:
    """Return the text in `content`, and a note where it is not UTF-8, else ''.

    What is neither UTF-8 nor UTF-16 is read as Western European (Windows-1252), which takes any byte.
    """
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace"), "text in UTF-16"
    try:
        return content.decode("utf-8-sig"), ""
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
        return text, "names that are not UTF-8 read as Western European (Windows-1252)"


def parse_json(text: str, where: str) -> Any:
    """Return the plain data of a JSON text; NaN and repeated keys are errors.

    Raises InputError with line and column.
    """

    def refuse_constant(name: str) -> float:
        raise InputError(f"{where} holds the number {name}; every number must be finite.")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in pairs:
            if key in found:
                raise InputError(f"{where} has the key '{key}' twice in one object; keep one of them.")
            found[key] = value
        return found

    try:
        return json.loads(text, parse_constant=refuse_constant, object_pairs_hook=unique)
    except json.JSONDecodeError as error:
        cut = error.pos >= len(text.rstrip()) or error.msg.startswith("Unterminated")
        hint = "the file ends too early: it is truncated" if cut else error.msg
        raise InputError(f"{where} is not valid JSON at line {error.lineno}, column {error.colno}: {hint}.") from None
    except RecursionError:
        raise InputError(f"{where} is nested too deeply to be an assembly or a design.") from None
    except ValueError as error:  # integers of thousands of digits
        raise InputError(f"{where} holds a number that cannot be used: {error}.") from None


def parse_yaml(text: str, where: str) -> Any:
    """Return the plain data of a YAML text, as YAML 1.2 has it.

    'no', '01' and '12:30' stay text, 1e-3 is a number. Raises InputError for broken YAML, tags,
    aliases and repeated keys.
    """
    import yaml

    loader = None
    try:
        loader = _plain_loader()(text)
        return loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise InputError(f"{where} is not usable YAML{place}: {error.problem or error.context}.") from None
    except yaml.YAMLError as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{where} is not usable YAML: {reason}; the file may be damaged.") from None
    except RecursionError:
        raise InputError(f"{where} is nested too deeply to be a configuration.") from None
    except ValueError as error:
        raise InputError(f"{where} holds a number that cannot be used: {error}.") from None
    finally:
        if loader is not None:
            loader.dispose()


def yaml_text(value: Any) -> str:
    """Return plain data as YAML on one line that `parse_yaml` reads back: words bare, everything else as JSON."""
    if isinstance(value, list):
        return f"[{', '.join(map(yaml_text, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{yaml_text(k)}: {yaml_text(v)}" for k, v in value.items()) + "}"
    bare = isinstance(value, str) and re.fullmatch(r"[A-Za-z_][A-Za-z0-9_./-]*", value)
    if bare and value.lower() not in ("true", "false", "null", "yes", "no", "on", "off"):
        return str(value)
    return json.dumps(value, ensure_ascii=False)


def yaml_key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Return the line, from 1, of every key of a YAML text that `parse_yaml` has read: path of keys → line."""
    import yaml

    found: dict[tuple[str, ...], int] = {}

    def walk(node: Any, path: tuple[str, ...]) -> None:
        for key, value in node.value if isinstance(node, yaml.MappingNode) else ():
            found[(*path, key.value)] = key.start_mark.line + 1
            walk(value, (*path, key.value))

    walk(yaml.compose(text, Loader=_plain_loader()), ())
    return found


def _plain_loader() -> Any:
    import yaml

    class PlainLoader(yaml.SafeLoader):
        """SafeLoader without tags, aliases, merge keys, dates and the surprises of YAML 1.1."""

        yaml_implicit_resolvers: dict[Any, Any] = {}  # noqa: RUF012  (the way PyYAML is configured)
        yaml_constructors = {  # noqa: RUF012
            tag: make
            for tag, make in yaml.SafeLoader.yaml_constructors.items()
            if tag in {f"tag:yaml.org,2002:{name}" for name in ("null", "bool", "int", "float", "str", "seq", "map")}
        }

        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                event = self.peek_event()  # type: ignore[no-untyped-call]
                raise yaml.composer.ComposerError(
                    None, None, f"the alias '*{event.anchor}' is not read here; write the value out", event.start_mark
                )
            return super().compose_node(parent, index)

        def construct_object(self, node: Any, deep: bool = False) -> Any:
            if node.tag not in self.yaml_constructors:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the tag '{node.tag}' is not read here; use plain values", node.start_mark
                )
            if isinstance(node, yaml.MappingNode):
                keys: set[str] = set()
                for key, _ in node.value:
                    if not isinstance(key, yaml.ScalarNode):
                        raise yaml.constructor.ConstructorError(None, None, "a key must be plain text", key.start_mark)
                    if key.value in keys:
                        raise yaml.constructor.ConstructorError(
                            None, None, f"the key '{key.value}' appears twice; keep one", key.start_mark
                        )
                    keys.add(key.value)
                    key.tag = "tag:yaml.org,2002:str"  # a part may be called 1
            return super().construct_object(node, deep)

    for name, pattern, first in (
        ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
        ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
        ("int", r"[-+]?(?:0|[1-9][0-9]*)", "-+0123456789"),
        (
            "float",
            r"[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+|[0-9]+(?=[eE]))(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
            "-+.0123456789",
        ),
    ):
        PlainLoader.add_implicit_resolver(f"tag:yaml.org,2002:{name}", re.compile(rf"^(?:{pattern})$"), list(first))
    return PlainLoader
