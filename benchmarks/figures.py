"""Figures of several benchmarks in one file of data, for the manual's tables and pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def store(path: Path, **parts: Any) -> None:
    """Put figures into a file of data; numbers get four digits."""
    data = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    data |= json.loads(json.dumps(parts), parse_float=lambda word: float(f"{float(word):.4g}"))
    lines = (f'  "{key}": {_compact(value)}' for key, value in data.items())
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def _compact(value: Any) -> str:
    if not isinstance(value, list):
        return json.dumps(value)
    return "[\n" + ",\n".join(f"    {json.dumps(entry)}" for entry in value) + "\n  ]"
