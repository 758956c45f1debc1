"""Tables of keys → reference tables and JSON Schemas: used by docs/generate.py."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from mocca_robot.config.keys import Key, section
from mocca_robot.files.fields import MOST_ROWS

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_NUMBER = {"type": "number"}
_KINDS: dict[str, dict[str, Any]] = {
    "number": _NUMBER,
    "integer": {"type": "integer"},
    "degrees": {"type": ["number", "null"]},
    "length": {"type": ["number", "string"]},
    "length_or_share": {"type": ["number", "string"]},
    "boolean": {"type": "boolean"},
    "name": {"type": ["string", "integer"], "maxLength": 100},
    "text": {"type": "string"},
    "names": {"type": ["string", "integer", "array"]},
    "goals": {"type": ["string", "object", "array"]},
    "loads": {"type": "array", "items": {"type": "object"}},
    "mapping": {"type": "object"},
    "friction": {"type": ["number", "object"]},
    "entries": {"type": "array"},
    "axis": {"type": ["string", "array"]},
    "force": {"type": "string"},
}


def reference(keys: Sequence[Key], titles: dict[str, str]) -> str:
    """Return one table per section of `keys`; `titles` are headings by section, 'Section `x`' where there is none."""
    out = []
    for prefix in dict.fromkeys(k.name.rpartition(".")[0] for k in keys):
        title = titles.get(prefix, f"Section `{prefix}`")
        out.append(f"## {title}\n\n| key | kind | default | unit | meaning |\n|---|---|---|---|---|")
        for key in section(keys, prefix).values():
            known = f" One of {', '.join(f'`{k}`' for k in key.known)}." if key.known else ""
            meaning = f"{_cell(key.description)}{known}{_limits(key)}"
            out.append(f"| `{key.name}` | {key.kind} | {_default(key)} | {key.unit} | {meaning} |")
        out.append("")
    return "\n".join(out)


def _default(key: Key) -> str:
    if key.required:
        return "**required**"
    if key.default is None or key.default == {}:
        return "not set"
    return f"`{_plain(key.default)}`"


def _limits(key: Key) -> str:
    signs = (("≥", key.low), (">", key.above), ("≤", key.high), ("<", key.below))
    said = [f"{sign} {limit:g}" for sign, limit in signs if limit is not None and key.kind != "integer"]
    said += [f"{sign} {limit}" for sign, limit in signs if limit is not None and key.kind == "integer"]
    return f" Limits: {', '.join(said)}." if said else ""


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_plain(v) for v in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _cell(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip().replace("|", "\\|").replace("<", "&lt;")


def schema(keys: Sequence[Key], title: str, description: str, *, empty: bool = False) -> dict[str, Any]:
    """Return the JSON Schema of a whole file; see `mapping_rule`."""
    return {"$schema": DIALECT, "title": title, "description": description, **mapping_rule(keys, "", empty=empty)}


def mapping_rule(keys: Sequence[Key], prefix: str, *, empty: bool = False) -> dict[str, Any]:
    """Return the rule of one section: its keys and no others, each with its rule; sections inside it likewise.

    With `empty`, keys that may be left out may be left empty, too.
    """
    inside = section(keys, prefix)
    rules = {}
    for name, key in inside.items():
        rules[name] = {"description": f"{key.description} Unit: {key.unit}." if key.unit else key.description}
        inner = f"{prefix}.{name}" if prefix else name
        if key.kind == "mapping" and section(keys, inner):
            rules[name] |= mapping_rule(keys, inner, empty=empty)
        elif key.kind == "mapping" and section(keys, f"{inner}.NAME"):
            rules[name] |= {"type": "object", "additionalProperties": mapping_rule(keys, f"{inner}.NAME", empty=empty)}
        elif empty and not key.required:
            rules[name] |= {"anyOf": [_rule(key), {"type": "null"}]}
        else:
            rules[name] |= _rule(key)
    required = [name for name, key in inside.items() if key.required]
    more = {"required": required} if required else {}
    return {"type": "object", "additionalProperties": False, "properties": rules, **more}


def _rule(key: Key) -> dict[str, Any]:
    vector = {"type": "array", "items": _NUMBER, "minItems": key.size, "maxItems": key.size}
    if key.kind == "choice":
        return {"enum": list(key.known)}
    if key.kind == "choices":
        one = {"enum": list(key.known)}
        return {"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]}
    if key.kind == "vector":
        return vector if key.size else {"type": ["number", "array"]}
    if key.kind == "box":
        return {"type": "array", "items": vector, "minItems": 2, "maxItems": 2}
    if key.kind == "height field":
        row = {"type": "array", "items": _NUMBER, "minItems": 1, "maxItems": MOST_ROWS}
        return {"type": "array", "items": row, "maxItems": MOST_ROWS}
    if key.kind == "places":
        three = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}
        return {"anyOf": [three, {"type": "array", "items": three, "minItems": 1}]}
    if key.kind == "turns":
        return {"anyOf": [{"const": "auto"}, _NUMBER, {"type": "array", "items": _NUMBER, "minItems": 1}]}
    if key.kind == "values":
        return _values_rule()
    limits = (("minimum", key.low), ("maximum", key.high), ("exclusiveMinimum", key.above))
    limits += (("exclusiveMaximum", key.below),)
    rule = _KINDS[key.kind] | {word: limit for word, limit in limits if limit is not None}
    return {"anyOf": [rule, {"enum": list(key.known)}]} if key.known else rule


def _values_rule() -> dict[str, Any]:
    from sim.studies.study import FREE_SECTIONS, MAX_POINTS, plain_keys

    span = {
        "type": "object",
        "additionalProperties": False,
        "required": ["from", "to", "count"],
        "properties": {
            "from": _NUMBER,
            "to": _NUMBER,
            "count": {"type": "integer", "minimum": 2, "maximum": MAX_POINTS},
            "spacing": {"enum": ["linear", "log"]},
        },
    }
    free = {"pattern": rf"^({'|'.join(FREE_SECTIONS)})(\.|$)"}
    return {
        "type": "object",
        "minProperties": 1,
        "propertyNames": {"anyOf": [{"enum": plain_keys()}, free]},
        "additionalProperties": {"anyOf": [{"type": "array", "minItems": 1}, span]},
    }


def cell_schema() -> dict[str, Any]:
    """Return the JSON Schema of cell files; which keys a gripper has depends on its kind."""
    from planners.robot.cell_keys import CELL_KEYS, GRIPPER_KEYS, LIMIT_KEYS

    found = schema(
        (*CELL_KEYS, *LIMIT_KEYS),
        "mocca-robot cell",
        "A YAML file that describes a robot cell; reading it checks more than this schema can say.",
        empty=True,
    )
    found["properties"]["gripper"] |= {
        "if": {"properties": {"kind": {"const": "suction"}}, "required": ["kind"]},
        "then": mapping_rule(GRIPPER_KEYS["suction"], "gripper", empty=True),
        "else": mapping_rule(GRIPPER_KEYS["parallel"], "gripper", empty=True),
    }
    return found


def text(data: dict[str, Any]) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(data, indent=1, ensure_ascii=False) + "\n"
