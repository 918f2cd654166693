"""How the files of an answer look: what a user asks for on the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "pdf", "svg")


@final
@dataclass(frozen=True, slots=True)
class Look:
    """Format and resolution of pictures, and what is drawn of bodies.

    Attributes
    ----------
    format : str
        One of ``png``, ``pdf`` and ``svg``.
    dpi : int
        Dots per inch.
    scale : float or None
        Factor by which displacements of bodies are enlarged; the default makes them visible.
    animate : bool
        Whether moving pictures are written, too.
    """

    format: str = "png"
    dpi: int = 150
    scale: float | None = None
    animate: bool = False

    def save(self, figure: Figure, directory: Path, name: str) -> Path:
        """Write a picture into an existing directory; return its file."""
        path = directory / f"{name}.{self.format}"
        figure.savefig(path, dpi=self.dpi)
        return path


DEFAULT_LOOK = Look()
