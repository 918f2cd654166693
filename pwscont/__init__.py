"""pwscont: continuation of piecewise-smooth systems through kinks and folds."""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # importing typing would delay the command line
if TYPE_CHECKING:
    from typing import Any

    from pwscont.public import *  # noqa: F403

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """Load numpy and all else with the first name used: threads are limited before."""
    return getattr(import_module("pwscont.public"), name)


def __dir__() -> list[str]:
    return [*import_module("pwscont.public").__all__, "__version__"]
