"""Tables as text."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np


def lines(table: Mapping[str, Any]) -> tuple[str, list[str]]:
    """The text of a scene file, and for each of its lines what the user has given there."""
    found: list[str] = []
    labels: list[str] = []

    def add(line: str, label: str) -> None:
        found.append(line)
        labels.append(label)

    for key, value in table.items():
        name = json.dumps(str(key))
        if not isinstance(value, list):
            add(f"{name} = {value_of(key, value)}", key)
            continue
        add(f"{name} = [", f"{key}s")
        for number, entry in enumerate(value):
            label = f"{key}s[{number}]"
            add(f"    {value_of(label, entry)},", label)
        add("]", f"{key}s")
    return "\n".join(found), labels


def value_of(name: str, value: Any) -> str:
    """A value in TOML."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        number = float(value)
        return repr(number) if math.isfinite(number) else str(number)
    if isinstance(value, (str, os.PathLike)):
        text = os.fspath(value)
        if isinstance(text, str) and text.isprintable():
            return json.dumps(text, ensure_ascii=False)
        raise ValueError(f"{name} is {value!r}; expected printable text")
    if isinstance(value, Mapping):
        entries = (f"{json.dumps(str(key))} = {value_of(f'{name}.{key}', inner)}" for key, inner in value.items())
        return "{ " + ", ".join(entries) + " }"
    try:
        values = list(value)
    except TypeError:
        raise ValueError(f"{name} is {value!r}; expected numbers, text or a list") from None
    return "[" + ", ".join(value_of(name, inner) for inner in values) + "]"
