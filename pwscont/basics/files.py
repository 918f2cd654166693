"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from errno import EINVAL
from pathlib import Path


def write_file(path: str | Path, content: bytes | memoryview) -> None:
    """Write a file, which appears whole or not at all; nothing else is left behind.

    Raises
    ------
    OSError
        If the file cannot be written, or is a device: a device that is replaced is lost.
    TypeError, ValueError
        If ``path`` is no path of a file.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from pwscont.extending import write_file
    >>> with TemporaryDirectory() as directory:
    ...     write_file(Path(directory, "a"), b"whole")
    ...     Path(directory, "a").read_bytes()
    b'whole'
    """
    target = Path(path)
    if target.exists() and not (target.is_file() or target.is_dir()):
        raise OSError(EINVAL, "it is a device, not a file")
    temporary = target.with_name(target.name + ".part")
    try:
        temporary.write_bytes(content)
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
