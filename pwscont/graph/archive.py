"""Files of graphs: arrays and a header in one archive, written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from math import isfinite, isnan
from pathlib import Path
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import GraphFileError


def write_archive(path: str | Path, header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a header, as JSON, and arrays by name, or raise a GraphFileError.

    The file appears whole or not at all, and nothing else is left behind.
    """
    content = BytesIO()
    named: dict[str, Any] = {"header": np.array(json.dumps(header)), **arrays}
    # not compressed: digits are random, and compressing them takes ten times as long as all else
    np.savez(content, **named)
    try:
        temporary = Path(path).with_name(Path(path).name + ".part")
        try:
            temporary.write_bytes(content.getbuffer())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except (OSError, TypeError, ValueError) as error:  # the last two: no path of a file
        why = getattr(error, "strerror", None) or error
        raise GraphFileError(f"cannot write {path}: {why}") from error


def read_archive(path: str | Path, kind: str, names: Sequence[str]) -> tuple[Any, dict[str, Any]]:
    """Return the header and the arrays with these names, or raise a GraphFileError."""
    try:
        # opened here: numpy would leave an unreadable file open
        with Path(path).open("rb") as raw, np.load(raw, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in ("header", *names)}
        return json.loads(str(arrays.pop("header"))), arrays
    except OSError as error:
        raise GraphFileError(f"cannot read {path}: {error.strerror or error}") from error
    except Exception as error:  # a damaged zip fails in a dozen ways
        raise GraphFileError(f"{path} is not a {kind} file, or it is damaged") from error


def damaged(path: str | Path, kind: str, why: Exception) -> GraphFileError:
    """Return the error for a file whose content makes no sense."""
    return GraphFileError(f"{path} is not a {kind} file, or it is damaged: {why}")


def stacked(rows: Sequence[Any]) -> Any:
    """Return rows as one array; without rows an array of shape (0, 0)."""
    return np.vstack(rows) if len(rows) else np.empty((0, 0))


class DamagedError(Exception):
    """An entry of a file is missing or of the wrong type; the message names the entry."""


@final
@dataclass(frozen=True, slots=True)
class Fields:
    """A JSON object read from a file, named in messages; a wrong entry raises a DamagedError."""

    name: str
    data: Any

    def __post_init__(self) -> None:
        if not isinstance(self.data, dict):
            raise DamagedError(f"{self.name} is no JSON object")

    def has(self, key: str) -> bool:
        """Tell whether there is an entry, for entries that older files lack."""
        return key in self.data

    def entry(self, key: str) -> Any:
        """Return an entry of any type."""
        if key not in self.data:
            raise DamagedError(f"{self.name} has no {key}")
        return self.data[key]

    def integer(self, key: str, least: int) -> int:
        """Return a whole number that is not below ``least``."""
        return self._fitting(
            key, lambda v: type(v) is int and v >= least, f"a whole number from {least} on"
        )

    def number(self, key: str) -> float:
        """Return a number, which may be infinite."""
        return float(self._fitting(key, lambda v: is_number(v) and not isnan(v), "a number"))

    def finite(self, key: str) -> float:
        """Return a finite number."""
        self.number(key)
        return float(self._fitting(key, isfinite, "finite"))

    def finite_or_text(self, key: str) -> float | str:
        """Return a finite number, or a text."""
        return self.text(key) if isinstance(self.entry(key), str) else self.finite(key)

    def text(self, key: str) -> str:
        """Return a text."""
        return str(self._fitting(key, lambda v: isinstance(v, str), "a text"))

    def word(self, key: str) -> str:
        """Return a text that is not empty."""
        text = self.text(key)
        if not text:
            raise DamagedError(f"{key} of {self.name} must not be empty")
        return text

    def items(self, key: str, length: int | None = None) -> list[Any]:
        """Return a list."""
        what = "a list" if length is None else f"a list of {length}"
        return self._fitting(key, lambda v: isinstance(v, list) and length in (None, len(v)), what)

    def numbers(self, key: str) -> Array:
        """Return a list of numbers."""
        self._fitting(key, lambda v: isinstance(v, list), "a list")
        values = self._fitting(key, lambda v: all(map(is_number, v)), "a list of numbers")
        return np.array(values, dtype=float)

    def objects(self, key: str) -> list[Fields]:
        """Return a list of JSON objects, each named by the place in the list."""
        return [Fields(f"entry {i} of {key}", item) for i, item in enumerate(self.items(key))]

    def _fitting(self, key: str, fits: Callable[[Any], bool], what: str) -> Any:
        """Return an entry that fits; the words ``what`` say what would fit."""
        value = self.entry(key)
        if not fits(value):
            raise DamagedError(f"{key} of {self.name} must be {what}, got {str(value)[:40]}")
        return value


def is_number(value: Any) -> bool:
    """Tell whether a JSON value is a number that a float can hold."""
    try:
        return type(value) is float or (type(value) is int and isfinite(float(value)))
    except OverflowError:
        return False
