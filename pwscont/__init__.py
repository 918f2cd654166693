"""pwscont: continuation of piecewise-smooth systems through kinks and folds."""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # not from typing: the command line wants to be there at once
if TYPE_CHECKING:
    from typing import Any

    from pwscont.public import *  # noqa: F403

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """Load numpy and all else with the first name: the command line limits threads before."""
    return getattr(import_module("pwscont.public"), name)


def __dir__() -> list[str]:
    return [*import_module("pwscont.public").__all__, "__version__"]
