"""The keys of a configuration as the page needs them to make its fields: kind, unit, limits, meaning."""

from __future__ import annotations

from typing import Any

from mocca_robot.config.schema import KEYS
from mocca_robot.files.fields import UNITS_M


def keys_data() -> list[dict[str, Any]]:
    """Return every key; its description is plain text."""
    return [
        {
            "name": key.name,
            "kind": key.kind,
            "default": key.default,
            "unit": key.unit,
            "about": key.description.replace("`", ""),
            "low": key.low if key.low is not None else key.above,
            "high": key.high if key.high is not None else key.below,
            "known": list(key.known) if key.name != "units" else list(UNITS_M),
        }
        for key in KEYS
    ]
