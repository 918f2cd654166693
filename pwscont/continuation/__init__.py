"""The loops, trace and explore."""

from pwscont.continuation.explore import explore, trace

__all__ = ["explore", "trace"]
