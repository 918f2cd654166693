"""The result of a study: a table of rows, and forms of the table for other programs."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np
import numpy.typing as npt

from pwscont import BranchGraph, InvalidInputError, MissingPackageError, UnknownNameError
from pwscont.extending import card, named, write_file
from pwscont.studies.case import StudyRow, graph_file
from pwscont.studies.problem import FIXED, Grid, Setting
from pwscont.studies.store import Store

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INSTALL = "pip install {0}, or pip install '.[study]' in a checkout of pwscont"


@final
class StudyResult:
    """The rows of a study, read from the store at each access.

    Parameters
    ----------
    store : Store
    graphs : Path, optional
        The directory of the graphs.
    interrupted : bool
        Whether Ctrl-C ended the study.

    Attributes
    ----------
    over : dict of str to tuple
        The values of each setting.
    measures : list of str
        The names of the measures.
    provenance : dict
        The problem, the settings, the measures, and the versions of the computing packages.
    interrupted : bool
        Whether Ctrl-C ended the study.

    Examples
    --------
    >>> from pwscont import LCP, Study
    >>> def case(coupling):
    ...     return LCP([[1, coupling], [coupling, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0)
    >>> result = Study(case, {"coupling": [0.5, 2.0]}, ["max-count"]).run()
    >>> result.column("max-count").tolist(), result.is_finished
    ([1, 3], True)
    """

    def __init__(self, store: Store, graphs: Path | None = None, interrupted: bool = False) -> None:
        if store.about is None:
            raise store.refusal("it holds no study")
        self._store, self._graphs = store, graphs
        self.provenance: dict[str, Any] = store.about
        self._grid = Grid(self.provenance["over"])
        self.over = self._grid.values
        self.measures = list(self.provenance["measure"])
        self.interrupted = interrupted

    @classmethod
    def open(cls, path: str | Path, graphs: str | Path | None = None) -> StudyResult:
        """Return the result in the store of a study, finished or not.

        Raises
        ------
        InvalidInputError
            If there is no store.
        """
        if not Path(path).exists():
            raise InvalidInputError(f"there is no store {path}")
        return cls(Store(path), None if graphs is None else Path(graphs))

    def close(self) -> None:
        """Close the store, which unlocks the file for other processes."""
        self._store.close()

    def __len__(self) -> int:
        """Return the number of rows, which is the number of finished cases."""
        return len(self._store)

    def __iter__(self) -> Iterator[StudyRow]:
        """Yield the rows in the order of the cases, row by row from the store."""
        return iter(self._store)

    @property
    def total(self) -> int:
        """The number of all cases."""
        return len(self._grid)

    @property
    def is_finished(self) -> bool:
        """Whether there is a row for every case."""
        return len(self) == self.total

    def failures(self) -> list[StudyRow]:
        """Return the rows with a failure."""
        return [row for row in self if row.failure]

    def __repr__(self) -> str:
        return named(self, *(f"{name}: {words}" for name, words in self._told()))

    def _repr_html_(self) -> str:
        return card("StudyResult", self._told())

    def _told(self) -> list[tuple[str, str]]:
        rows = f"{len(self)} of {self.total}"
        kinds = Counter("failed" if row.failure else row.proven for row in self)
        told = [("rows", rows), ("failed", str(kinds["failed"])), ("unproven", str(kinds[False]))]
        return [*told, ("over", ", ".join(self.over)), ("measure", ", ".join(self.measures))]

    def column(self, name: str) -> Any:
        """Return a column of the table over the settings.

        Parameters
        ----------
        name : str
            A measure, or ``proven``, ``guarantee``, ``seconds``, ``failure``.

        Returns
        -------
        numpy.ma.MaskedArray
            One axis for each setting, in the order of :attr:`over`; masked at cases without row or
            value. An array of numbers, or of objects if some values are no numbers.

        Raises
        ------
        UnknownNameError
            If there is no such column.
        """
        if name not in (known := [*self.measures, *FIXED[1:]]):
            raise UnknownNameError(f"there is no column {name!r}; columns are {', '.join(known)}")
        values = np.full(self.total, None, dtype=object)
        for row in self:
            values[row.case] = row.values[name] if name in row.values else getattr(row, name)
        masked = np.ma.masked_array(values, [value is None for value in values])
        return _typed(masked).reshape(self._grid.shape)

    def graph(self, **settings: Setting) -> BranchGraph:
        """Return the graph of a case of a study that kept graphs; the graph has no system.

        Raises
        ------
        InvalidInputError
            If graphs were not kept, or there is no such case.
        GraphFileError
            If the file of the graph is missing or damaged.
        """
        if self._graphs is None:
            raise InvalidInputError("no graphs were kept: run(graphs=directory) does")
        for row in self:
            if row.settings == settings:
                return BranchGraph.load(graph_file(self._graphs, row.case))
        raise InvalidInputError(f"no finished case has the settings {settings}")

    def plot(self, name: str | None = None, figure: Figure | None = None) -> Figure:
        """Draw a measure: a line over one setting, a map over two, several maps over three.

        Parameters
        ----------
        name : str, optional
            Default the first measure.
        figure : matplotlib.figure.Figure, optional
            The figure to draw into; default a new figure of pyplot, which notebooks and
            ``plt.show()`` show.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        UnknownNameError
            If there is no such measure.
        InvalidInputError
            If the values of the measure are no numbers, or more than three settings vary.
        """
        from pwscont.studies.pictures import draw_study  # noqa: PLC0415  only where asked for

        return draw_study(name or self.measures[0], self.over, self.column, figure)

    # -- for other programs --------------------------------------------------------------

    def to_dataframe(self) -> Any:
        """Return a pandas data frame: a row for each case, with settings, values and guarantee.

        Raises
        ------
        MissingPackageError
            If pandas is not installed.
        """
        pandas = _imported("pandas", "to_dataframe")
        return pandas.DataFrame(map(self._record, self), columns=self._columns())

    def to_xarray(self) -> Any:
        """Return an xarray Dataset over the settings.

        Missing values are nan, as is usual in xarray; values that are no numbers are texts.

        Raises
        ------
        MissingPackageError
            If xarray is not installed.
        """
        xarray = _imported("xarray", "to_xarray")
        names = [*self.measures, *FIXED[1:]]
        variables = {name: (list(self.over), _filled(self.column(name))) for name in names}
        coordinates = {name: list(values) for name, values in self.over.items()}
        kept = {name: self.provenance[name] for name in ("problem", "measure", "versions")}
        told = {name: json.dumps(what, ensure_ascii=False) for name, what in kept.items()}
        return xarray.Dataset(variables, coordinates, told)

    def write_netcdf(self, path: str | Path) -> None:
        """Write the Dataset of :meth:`to_xarray` to a NetCDF file (version 3); errors as there."""
        self.to_xarray().to_netcdf(path, engine="scipy")

    def write_csv(self, path: str | Path) -> None:
        """Write a CSV file with a line for each case, as a whole or not at all.

        Raises
        ------
        InvalidInputError
            If the file cannot be written.
        """
        try:
            # undecodable bytes of file names, which the command line accepts, become escapes
            write_file(path, self._lines().encode("utf-8", "backslashreplace"))
        except OSError as error:
            raise InvalidInputError(f"cannot write {path}: {error.strerror or error}") from error

    def _lines(self) -> str:
        """Return a line for each case, and the names of the columns before."""
        text = StringIO()
        writer = csv.DictWriter(text, self._columns())
        writer.writeheader()
        for row in self:
            writer.writerow({k: _text(value) for k, value in self._record(row).items()})
        return text.getvalue()

    def _columns(self) -> list[str]:
        return [FIXED[0], *self.over, *self.measures, *FIXED[1:]]

    def _record(self, row: StudyRow) -> dict[str, Any]:
        told = {name: getattr(row, name) for name in FIXED}
        return told | dict(row.settings) | dict(row.values)


def _typed(values: Any) -> Any:
    """Return a masked array of bool, int or float if all values fit, else the objects unchanged."""
    kinds = {type(value) for value in values.compressed()}
    fitting: Any = {bool: {bool}, int: {int}, float: {int, float}}
    kind = next((kind for kind, fits in fitting.items() if kinds <= fits), None)
    if kind is None or not kinds:
        return values
    empty = np.ma.masked_array(np.zeros(values.shape, dtype=kind), values.mask)
    empty[~values.mask] = values.compressed().tolist()
    return empty


def _filled(values: Any) -> npt.NDArray[Any]:
    """Return an array for xarray: nan for missing numbers, objects as texts."""
    if values.dtype == object:
        texts = [str(_text(value)) for value in values.filled(None).ravel()]
        return np.array(texts).reshape(values.shape)
    if not values.mask.any():
        return np.asarray(values)
    return np.asarray(values.astype(float).filled(np.nan))


def _text(value: Any) -> Any:
    """Return the text for a value in a file: nothing for None, JSON for several numbers."""
    if value is None:
        return ""
    return json.dumps(value) if isinstance(value, tuple) else value


def _imported(package: str, what: str) -> Any:
    try:
        return import_module(package)
    except ImportError as error:
        words = f"{what} needs {package}: {INSTALL.format(package)}"
        raise MissingPackageError(words) from error
