"""The finite element libraries, loaded when a body, a file or a picture needs a library."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from pwscont import MissingPackageError


def loaded(name: str) -> Any:
    """Return a module of scikit-fem or meshio.

    Raises
    ------
    MissingPackageError
        If the module is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingPackageError(
            f"finite element bodies need scikit-fem and meshio, and {name} cannot be imported: "
            "pip install scikit-fem meshio, or pip install '.[fem]' in a checkout of pwscont"
        ) from error
