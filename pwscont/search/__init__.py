"""Floor 5: where tracing can start, found without being told."""

from pwscont.search.search import EndPoints, Search

__all__ = ["EndPoints", "Search"]
