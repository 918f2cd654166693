"""The exceptions for faults of a caller, a file, a system or a start.

A numerical step that fails raises no exception: the step returns a
:class:`pwscont.basics.outcome.Failure`.
"""


class PwscontError(Exception):
    """Base of every error that pwscont raises on purpose.

    Examples
    --------
    >>> from pwscont import LCP, PwscontError, explore
    >>> try:
    ...     explore(LCP([[1]], q=[0], d=[1]), (1.0, 0.0))
    ... except PwscontError as error:
    ...     print(type(error).__name__)
    InvalidInputError
    """


class InvalidInputError(PwscontError, ValueError):
    """An argument does not fit; the message names the argument and says what would fit.

    Examples
    --------
    >>> from pwscont import InvalidInputError, Limits
    >>> try:
    ...     Limits(pieces=0)
    ... except InvalidInputError as error:
    ...     print(error)
    pieces must be a positive whole number, got 0
    """


class InvalidSystemError(PwscontError, ValueError):
    """A user's system breaks the contract; the message names the method and the point.

    Examples
    --------
    >>> from pwscont import InvalidSystemError, Switched, explore
    >>> try:
    ...     explore(Switched(2, lambda z, t, sw: z[:1]), (0.0, 1.0))
    ... except InvalidSystemError as error:
    ...     print(type(error).__name__)
    InvalidSystemError
    """


class UnknownNameError(PwscontError, KeyError):
    """An unknown name; the message lists known names and suggests similar names.

    Examples
    --------
    >>> from pwscont import LCP, UnknownNameError, enumerate_solutions
    >>> (solution,) = enumerate_solutions(LCP([[1]], q=[0], d=[1]), 1.0)
    >>> try:
    ...     solution["z"]
    ... except UnknownNameError as error:
    ...     print(error)
    there is no 'z'; names are z[0]
    """

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""  # a KeyError would show the repr


class MissingPackageError(PwscontError, ImportError):
    """Something was asked for that needs a package which is not installed.

    Examples
    --------
    >>> from pwscont import MissingPackageError
    >>> issubclass(MissingPackageError, ImportError)
    True
    """


class StartNotFoundError(PwscontError, RuntimeError):
    """No solution was found near a start; the message says what to try.

    Examples
    --------
    >>> from pwscont import StartNotFoundError, Switched, trace
    >>> try:
    ...     trace(Switched(1, lambda z, t, sw: z**2 + 1 + t**2), ([0.0], 0.0), (-1.0, 1.0))
    ... except StartNotFoundError as error:
    ...     print(type(error).__name__)
    StartNotFoundError
    """


class GraphFileError(PwscontError, ValueError):
    """A file is no saved branch graph, is damaged, or cannot be read or written.

    Examples
    --------
    >>> from pwscont import BranchGraph, GraphFileError
    >>> try:
    ...     BranchGraph.load("there is no such file.npz")
    ... except GraphFileError as error:
    ...     print(type(error).__name__)
    GraphFileError
    """


class SystemNeededError(PwscontError, RuntimeError):
    """A graph read from a file was asked for what only the graph's system can tell.

    Examples
    --------
    >>> from pwscont import PwscontError, SystemNeededError
    >>> issubclass(SystemNeededError, PwscontError)  # a loaded graph has no system unless given one
    True
    """


class SceneNotFoundError(PwscontError, LookupError):
    """No installed package registers a scene of that name.

    Examples
    --------
    >>> from pwscont import SceneNotFoundError, Study
    >>> try:
    ...     Study("wegde", {"friction": [0.5]}, ["max-count"])
    ... except SceneNotFoundError as error:
    ...     print(str(error).split("; ")[-1])
    see 'pwscont scenes'
    """
