"""The exceptions for faults of a caller, a file, a system or a start.

Failures of a numerical step are not exceptions: they are values, see
:mod:`pwscont.basics.outcome`.
"""


class PwscontError(Exception):
    """Base of every error that pwscont raises on purpose."""


class InvalidInputError(PwscontError, ValueError):
    """An argument does not fit; the message names it and says what would."""


class InvalidSystemError(PwscontError, ValueError):
    """A user's system breaks its contract; the message names the method and the point."""


class UnknownNameError(PwscontError, KeyError):
    """A name that nothing has; the message lists the names there are, and close ones."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""  # a KeyError would show the repr


class MissingPackageError(PwscontError, ImportError):
    """Something was asked for that needs a package which is not installed."""


class StartNotFoundError(PwscontError, RuntimeError):
    """No solution was found near a start; the message says what to try."""


class GraphFileError(PwscontError, ValueError):
    """A file is no saved branch graph, is damaged, or cannot be read or written."""


class SystemNeededError(PwscontError, RuntimeError):
    """A graph read from a file was asked for what only its system can tell."""


class BrokenSceneError(PwscontError, RuntimeError):
    """A package offers a scene that cannot be made, or one whose name is taken."""


class SceneNotFoundError(PwscontError, LookupError):
    """No installed package registers a scene of that name."""
