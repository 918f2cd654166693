"""Parameters of long sweeps."""

import pytest


class Wanted:
    """Which cases the command asks for; those that it leaves out are not even made."""

    slow = True


def swept(quick, slow):
    """Return parameters for the quick tests, and those of the whole sweep, marked slow."""
    whole = [value if isinstance(value, tuple) else (value,) for value in slow if Wanted.slow]
    return [*quick, *(pytest.param(*value, marks=pytest.mark.slow) for value in whole)]
