"""Write the pages of the documentation that are made from the code: `python docs/generate.py` (or `make docs`).

cli.md comes from the argument parsers, config.md, cells.md and the JSON Schemas of YAML files from their tables of
keys, api.md from the docstrings of the public names, changelog.md from CHANGELOG.md, the picture of the house from the
code's imports (docs/house.py), the gallery from what docs/gallery.py measured. A test compares them with what the code
says.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import inspect
import re
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
NOTICE = "<!-- Written by docs/generate.py from the code; edit that instead. -->\n"

PACKAGES = ("mocca_robot", "planners", "sim", "sim.studies")
"""Where people import from; the `__all__` of each is what they may rely on."""


def public_names() -> dict[str, dict[str, Any]]:
    """Return every public name with its value, by the package to import it from, then by the module that defines it."""
    found: dict[str, dict[str, Any]] = {}
    for package in PACKAGES:
        values = {name: getattr(import_module(package), name) for name in import_module(package).__all__}
        found[package] = dict(sorted(values.items(), key=lambda entry: (entry[1].__module__, entry[0])))
    return found


def pages() -> dict[str, str]:
    """Return every generated file: path relative to docs/ → content."""
    return {
        "cli.md": cli_page(),
        "config.md": config_page(),
        "api.md": api_page(),
        "changelog.md": NOTICE + (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        "cells.md": cell_page(),
        "assets/house.svg": _module("house").picture(),
        **schemas(),
        **_module("gallery_pages").pages(),
    }


def _module(name: str) -> ModuleType:
    """Return a module that lies beside this file."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def commands() -> dict[str, tuple[str, argparse.ArgumentParser]]:
    """Return command → (one line of help, its parser); 'config show' is a command of its own."""
    from mocca_robot.cli.parser import build_parser

    found: dict[str, tuple[str, argparse.ArgumentParser]] = {}

    def collect(parser: argparse.ArgumentParser, prefix: str) -> None:
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                lines = {a.dest: a.help or "" for a in action._choices_actions}
                for name, inner in action.choices.items():
                    found[f"{prefix}{name}"] = (lines.get(name, ""), inner)
                    collect(inner, f"{prefix}{name} ")

    collect(build_parser(), "")
    return found


def cli_page() -> str:
    """Return the reference of the command line."""
    from mocca_robot.cli.parser import EPILOG

    out = [NOTICE, "# Commands\n", _sentence(EPILOG) + "\n"]
    listed = commands()
    out.append("| command | what it does |\n|---|---|")
    out += [f"| [`{name}`](#{name.replace(' ', '-')}) | {_cell(line)} |" for name, (line, _) in listed.items()]
    for name, (line, parser) in listed.items():
        out.append(f"\n## {name}\n")
        out.append(_sentence(parser.description or line) + "\n")
        rows = [
            _option(a) for a in parser._actions if not isinstance(a, argparse._HelpAction | argparse._SubParsersAction)
        ]
        if rows:
            out.append("| argument | meaning |\n|---|---|")
            out += rows
    return "\n".join(out).rstrip() + "\n"


def _option(action: argparse.Action) -> str:
    value = "" if action.nargs == 0 else str(action.metavar or action.dest.upper())
    if action.option_strings:
        shown = ", ".join(f"`{o} {value}`" if value and not action.choices else f"`{o}`" for o in action.option_strings)
    else:
        shown = f"`{action.metavar or action.dest}`" + (" (may be left out)" if action.nargs == "?" else "")
    text = (action.help or "").replace("%%", "%").replace("%(default)s", str(action.default))
    if action.choices:
        text = f"{text}; one of {', '.join(f'`{c}`' for c in action.choices)}"
    return f"| {shown} | {_cell(text)}{' **Required.**' if action.option_strings and action.required else ''} |"


def config_page() -> str:
    """Return the reference of configuration keys."""
    from mocca_robot.config.schema import KEYS

    out = [
        NOTICE,
        "# Configuration keys\n",
        "A configuration is a YAML file of plain values. Any key can also be set on the command line: "
        "`--set alpha_deg=10 --set joints.margin=0.1`. Unknown keys are refused, with the nearest known one. Lengths "
        "with the unit *units* are in the file's own `units`; a text such as `3 mm` says its unit itself. "
        "[A JSON Schema](schemas/config.schema.json) lets editors complete and check keys.\n",
    ]
    out.append(_module("key_tables").reference(KEYS, {"": "Top level"}))
    return "\n".join(out).rstrip() + "\n"


def cell_page() -> str:
    """Return the reference of cell files."""
    from planners.robot.cell_keys import CELL_KEYS, GRIPPER_KEYS, LIMIT_KEYS

    tables = _module("key_tables")
    shared = [k for k in GRIPPER_KEYS["parallel"] if k in GRIPPER_KEYS["suction"]]
    out = [
        NOTICE,
        "# Cell files\n",
        "A YAML file of plain values says which arm, gripper, table and tray there are, and where to build: "
        "`configs/cells/` holds three. Metres, degrees, kilograms in the frame of the robot's base, z up. Unknown keys "
        "are refused, with the nearest known one. [A JSON Schema](schemas/cell.schema.json) lets editors complete and "
        "check keys.\n",
        tables.reference(CELL_KEYS, {"": "Top level"}),
        tables.reference(shared, {"gripper": "Section `gripper`: both kinds"}),
    ]
    for kind, words in (("parallel", "two fingers"), ("suction", "a suction cup")):
        own = [k for k in GRIPPER_KEYS[kind] if k not in shared]
        out.append(tables.reference(own, {"gripper": f"Section `gripper`: `{kind}`, {words}"}))
    out.append(tables.reference(LIMIT_KEYS, {}))
    return "\n".join(out).rstrip() + "\n"


def schemas() -> dict[str, str]:
    """Return the JSON Schemas that come from tables of keys: path relative to docs/ → content."""
    from mocca_robot.config.schema import KEYS
    from sim.studies.study import STUDY_KEYS

    tables = _module("key_tables")
    more = "reading it checks more than this schema can say."
    found = {
        "config": tables.schema(KEYS, "mocca-robot configuration", f"A YAML file that says what to design; {more}"),
        "study-file": tables.schema(STUDY_KEYS, "mocca-robot study", f"A YAML file that says what to vary; {more}"),
        "cell": tables.cell_schema(),
    }
    return {f"schemas/{name}.schema.json": tables.text(data) for name, data in found.items()}


def api_page() -> str:
    """Return the reference of public names, from their docstrings."""
    out = [
        NOTICE,
        "# Python\n",
        "Metres, radians, newtons, kilograms; y is up for flat assemblies, z for solid ones. Arrays are numpy arrays, "
        "read-only where they are stored. What is not listed here may change without notice.\n",
    ]
    for package, names in public_names().items():
        out.append(f"## from {package} import …\n\n{_first_line(import_module(package))}\n")
        for name, value in names.items():
            out.append(f"### {name}\n\n```text\n{_signature(name, value)}\n```\n\n{_docstring(value)}\n")
    return "\n".join(out).rstrip() + "\n"


def _signature(name: str, value: Any) -> str:
    if inspect.isclass(value):
        if issubclass(value, Exception):
            return f"class {name}({value.__bases__[0].__name__})"
        if not dataclasses.is_dataclass(value):
            return f"class {name}"
        fields = [f"{f.name}: {_type(f.type)}{_default(f)}" for f in dataclasses.fields(value)]
        return f"{name}(" + "".join(f"\n    {f}," for f in fields) + ("\n)" if fields else ")")
    parameters = []
    keyword_only = False
    for p in inspect.signature(value).parameters.values():
        if p.kind is p.KEYWORD_ONLY and not keyword_only:
            parameters.append("*")
            keyword_only = True
        default = "" if p.default is p.empty else f" = {_short(p.default)}"
        stars = "*" if p.kind is p.VAR_POSITIONAL else "**" if p.kind is p.VAR_KEYWORD else ""
        parameters.append(f"{stars}{p.name}: {_type(p.annotation)}{default}")
    returned = _type(inspect.signature(value).return_annotation)
    line = f"{name}({', '.join(parameters)}) -> {returned}"
    if len(line) > 100:
        line = f"{name}(" + "".join(f"\n    {p}," for p in parameters) + f"\n) -> {returned}"
    return line


def _type(annotation: Any) -> str:
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))


def _default(field: dataclasses.Field[Any]) -> str:
    if field.default is not dataclasses.MISSING:
        return f" = {_short(field.default)}"
    return " = …" if field.default_factory is not dataclasses.MISSING else ""


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    text = repr(value)
    return text if len(text) <= 60 and " at 0x" not in text and "\n" not in text else "…"


def _docstring(value: Any) -> str:
    text = inspect.cleandoc(value.__doc__ or "")
    if not text:
        raise SystemExit(f"{value!r} is public and has no docstring.")
    first, _, rest = text.partition("\n\n")
    parts = [_escaped(_paragraph(first))]
    for block in rest.split("\n\n") if rest else []:
        head, _, body = block.partition("\n")
        if head.rstrip() in ("Attributes:", "Args:"):
            parts.append("\n".join(_entries(body)))
        else:
            parts.append(_escaped(_paragraph(block)))
    return "\n\n".join(p for p in parts if p)


def _entries(body: str) -> list[str]:
    """Return a list item per 'name: meaning' of an indented block; deeper lines continue the one before."""
    lines = inspect.cleandoc("x\n" + body).splitlines()[1:]
    indent = min((len(line) - len(line.lstrip()) for line in lines if line.strip()), default=0)
    items: list[str] = []
    for line in lines:
        text = line[indent:]
        if text.startswith(" ") and items:
            items[-1] += " " + text.strip()
        elif text.strip():
            name, colon, meaning = text.partition(":")
            items.append(f"- `{name}`:{_escaped(meaning)}" if colon else f"- {_escaped(text)}")
    return items


def _first_line(module: ModuleType) -> str:
    return _escaped(_paragraph((inspect.getdoc(module) or "").split("\n\n")[0]))


def _paragraph(text: str) -> str:
    return re.sub(r"\s+", " ", text.replace("``", "`")).strip()


def _sentence(text: str) -> str:
    text = _paragraph(text)
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def _escaped(text: str) -> str:
    """Return text whose stars, brackets and angles stay what they are, outside of code spans."""
    pieces = re.split(r"(`[^`]*`)", text)
    return "".join(p if p.startswith("`") else re.sub(r"([*_<>\[\]])", r"\\\1", p) for p in pieces)


def _cell(text: str) -> str:
    return _paragraph(text).replace("|", "\\|").replace("<", "&lt;")


def main() -> int:
    """Return 0 after writing every generated page."""
    for name, content in pages().items():
        (ROOT / "docs" / name).write_text(content, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
