"""Checks that an argument is an object of the class that is meant."""

from __future__ import annotations

from collections.abc import Collection
from importlib import import_module
from typing import Any

from pwscont.basics.errors import InvalidInputError, MissingPackageError
from pwscont.basics.printing import short, with_article


def checked_kind(name: str, value: object, kind: type, *, is_needed: bool = False) -> None:
    """Refuse an argument of another kind, such as a class where an instance is meant.

    None is refused only if the argument ``is_needed``.

    Raises
    ------
    InvalidInputError
        The message begins with ``name``.

    Examples
    --------
    >>> from pwscont import InvalidInputError, StepSize
    >>> from pwscont.extending import checked_kind
    >>> try:
    ...     checked_kind("step_size", 0.1, StepSize)
    ... except InvalidInputError as error:
    ...     print(error)
    step_size must be a StepSize, got 0.1
    """
    if (value is not None or is_needed) and not isinstance(value, kind):
        forgotten = isinstance(value, type) and issubclass(value, kind)
        hint = "; call it to make one" if forgotten else ""
        raise InvalidInputError(
            f"{name} must be {with_article(kind.__name__)}, got {short(repr(value))}{hint}"
        )


def wrong_result(
    owner: object, method: str, wanted: str, got: object, check: str = ""
) -> InvalidInputError:
    """Return the error about what a method returned; ``check`` names a function that checks all."""
    more = f"; {check} tells what else is wrong" if check else ""
    return InvalidInputError(
        f"{type(owner).__name__}.{method} must return {wanted}, got {got!r}{more}"
    )


def check_callable(name: str, value: object, signature: str) -> None:
    """Refuse an argument that is no function; ``signature`` names the arguments in the message."""
    if not callable(value):
        raise InvalidInputError(f"{name} must be a function of {signature}, got {value!r}")


def pandas_for(rows: str, tables: Collection[str]) -> Any:
    """Return pandas for a data frame, or refuse ``rows`` if they name none of the tables."""
    if rows not in tables:
        raise InvalidInputError(f"rows must be one of {', '.join(tables)}, got {rows!r}")
    try:
        return import_module("pandas")
    except ImportError as error:
        raise MissingPackageError("to_dataframe needs pandas: pip install pandas") from error
