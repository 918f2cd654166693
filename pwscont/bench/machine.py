"""The machine of the measurements, in general words."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from typing import Any

import numpy as np

#: Variables that limit the threads of the usual BLAS libraries.
LIMITS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


def machine() -> dict[str, Any]:
    """Return platform, cores, versions and what is known about BLAS."""
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return {
        "system": platform.system(),
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in ("pwscont", "numpy", "scipy", "networkx")},
        "blas": f"{blas.get('name', 'unknown')} {blas.get('version', '')}".strip(),
        "blas_threads": _blas_threads(),
    }


def _blas_threads() -> str:
    """Return the limit that the environment sets; the matrices here are too small for threads."""
    found = [f"{name}={os.environ[name]}" for name in LIMITS if name in os.environ]
    return ", ".join(found) or "not limited"
