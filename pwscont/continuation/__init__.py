"""The loops, trace and explore."""

from pwscont.continuation.explore import explore
from pwscont.continuation.trace import trace

__all__ = ["explore", "trace"]
