"""A single thread for BLAS while matrices are small, where threadpoolctl is installed.

Threads that wait for each other cost more than the work on a matrix of a few hundred rows, and more
than products with a matrix of thousands of rows, which wait for memory.
"""

from __future__ import annotations

import os
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from importlib import import_module
from typing import Any

#: Environment variables that BLAS libraries and OpenMP read: any value that the user sets holds.
THREADS = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "OMP_NUM_THREADS",
)
#: Number of unknowns below which a product or a factorisation has a single thread anyway. Solving
#: for many right-hand sides, as steps along curves do, may have more.
LEAST_THREADED = 32
#: Most unknowns for which a single thread is faster: if matrices are factorised at every step, and
#: if matrices are only multiplied. Two threads took 1.5 to 5 times as long.
MOST_FACTORISED, MOST_MULTIPLIED = 2000, 6000


def few_threads(
    size: int, small: int = MOST_FACTORISED, few: int = LEAST_THREADED
) -> AbstractContextManager[Any]:
    """Let BLAS use a single thread for ``few`` to ``small`` unknowns, unless the user decides."""
    return one_thread() if few <= size <= small else nullcontext()


def one_thread() -> AbstractContextManager[Any]:
    """Let BLAS use a single thread, unless the user has set a number.

    Examples
    --------
    >>> from pwscont.extending import one_thread
    >>> with one_thread():
    ...     pass
    """
    decided = any(name in os.environ for name in THREADS)
    controller = None if decided else _controller()
    return controller.limit(limits=1, user_api="blas") if controller else nullcontext()


@cache
def _controller() -> Any | None:
    """Return threadpoolctl's controller, made once, for making looks through all libraries."""
    try:
        return import_module("threadpoolctl").ThreadpoolController()
    except ImportError:
        return None
