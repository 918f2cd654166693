"""Options with several values, which a scene's name may follow.

``run --at 1 2 fig7`` is read as ``run --at 1 --at 2 fig7``: the arguments after an option belong to
the option as long as they have the form of its values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence


def _is_number(argument: str) -> bool:
    try:
        float(argument)
    except ValueError:
        return False
    return True


def _is_setting(argument: str) -> bool:
    name, sign, _ = argument.partition("=")
    return bool(sign) and name.strip().isidentifier()


#: Options, and the form of their values.
FORMS: Mapping[str, Callable[[str], bool]] = {
    "--at": _is_number,
    "-s": _is_setting,
    "--set": _is_setting,
}


def spread(arguments: Sequence[str]) -> Iterator[str]:
    """Yield the arguments with an option before each of its values."""
    option, first = "", True
    for argument in arguments:
        if option and FORMS[option](argument):
            yield from (_as_value(argument),) if first else (option, _as_value(argument))
            first = False
        else:
            option, first = argument if argument in FORMS else "", True
            yield _as_value(argument)


def _as_value(argument: str) -> str:
    """Return an argument, a negative number with a space in front, which no option has."""
    return f" {argument}" if _is_number(argument) and float(argument) < 0.0 else argument
