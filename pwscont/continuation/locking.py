"""Locks on files: they end with the process that holds them, however it ends."""

from __future__ import annotations

import sys
from io import FileIO

#: Windows locks bytes, which others cannot read then: one far beyond the end of any file.
FAR = 2**62


def lock(file: FileIO) -> bool:
    """Lock an open file until it is closed; returns False if it is locked already.

    Raises
    ------
    OSError
        If the file system knows no locks.
    """
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415  only there

        file.seek(FAR)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        return True
    import fcntl  # noqa: PLC0415  not on Windows

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
