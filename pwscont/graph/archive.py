"""Files of graphs: arrays and a header in one archive, written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from pwscont.basics.errors import GraphFileError


def write_archive(path: str | Path, header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a header, as JSON, and arrays by name.

    Raises
    ------
    GraphFileError
        If the file cannot be written.
    """
    content = BytesIO()
    named: dict[str, Any] = {"header": np.array(json.dumps(header)), **arrays}
    # not compressed: digits are random, and compressing them takes ten times as long as all else
    np.savez(content, **named)
    try:
        replace_file(Path(path), content.getbuffer())
    except (OSError, TypeError, ValueError) as error:  # the last two: no path of a file
        why = getattr(error, "strerror", None) or error
        raise GraphFileError(f"cannot write {path}: {why}") from error


def read_archive(path: str | Path, kind: str, names: Sequence[str]) -> tuple[Any, dict[str, Any]]:
    """Read the header and the arrays with these names; ``kind`` names the file in errors.

    Raises
    ------
    GraphFileError
        If the file cannot be read, is damaged, or is something else.
    """
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


def replace_file(target: Path, content: memoryview) -> None:
    """Write a file that appears whole or not at all, and leaves nothing else behind."""
    temporary = target.with_name(target.name + ".part")
    try:
        temporary.write_bytes(content)
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
