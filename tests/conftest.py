"""Which cases of a sweep are quick, how many threads a test has, and what tests leave behind."""

import os
import signal
import sys
from collections import Counter
from zlib import crc32

import pytest

if "PYTEST_XDIST_WORKER" in os.environ:
    # the workers have a core each: threads of BLAS that wait for one another take thirty times
    # as long where several workers, or any other program, want the same core
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # a shell lets what it runs in the background ignore Ctrl-C, and so all that this begins
    signal.signal(signal.SIGINT, signal.default_int_handler)

from sweeps import Wanted


def pytest_addoption(parser):
    """Add the option that takes a fixed part of all tests: long sweeps are sampled by it."""
    parser.addoption("--one-in", type=int, default=1, help="run about one in so many tests")


def pytest_configure(config):
    """Leave out the slow cases of sweeps where only quick ones are asked for."""
    Wanted.slow = config.option.markexpr != "not slow"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items, config):
    """Mark as slow all cases of a test marked ``sweep(k)`` but the first, the (k + 1)th, ...

    Cases that are slow anyway do not count: a run that leaves them out has the same quick ones.
    With ``--one-in N`` the tests are sampled by their names: every machine runs the same ones.
    """
    seen = Counter()
    for item in items:
        mark = item.get_closest_marker("sweep")
        if mark is None or item.get_closest_marker("slow"):
            continue
        if seen[item.function] % mark.args[0]:
            item.add_marker(pytest.mark.slow)
        seen[item.function] += 1
    one_in = config.getoption("--one-in")
    items[:] = [item for item in items if crc32(item.nodeid.encode()) % one_in == 0]


@pytest.fixture(autouse=True)
def _no_figure_stays_open():
    """Close what a test leaves open in pyplot, which all tests of a process share."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")
