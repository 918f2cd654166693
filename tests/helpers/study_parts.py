"""What tests of studies share."""

import os
from pathlib import Path

from pwscont import (
    FirstFold,
    MaxCount,
    NonUnique,
)

COUNTS = {"most": MaxCount(), "first": FirstFold(), "where": NonUnique()}


def numbers(result):
    """Return all rows without their seconds, and close the store."""
    rows = [row.numbers for row in result]
    result.close()
    return rows


def with_tests():
    """Return the environment of a process that can import the problems of this file."""
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    return os.environ | {"PYTHONPATH": path}
