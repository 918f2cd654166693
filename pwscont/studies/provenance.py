"""The versions of the programs on which the numbers of a study depend."""

from __future__ import annotations

from importlib.metadata import version
from platform import python_version

#: Packages whose versions may change the last digits.
PACKAGES = ("pwscont", "numpy", "scipy")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that compute."""
    return {"python": python_version()} | {name: version(name) for name in PACKAGES}
