"""Run a peer's program in a Python of its own: that for which the peers' packages are installed."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

#: The Python for which the peers' packages are installed.
PYTHON = os.environ.get("PEER_PYTHON", "/usr/bin/python3")
HERE = Path(__file__).parent
LONGEST = 600.0  # seconds


def ask(program: str, problem: dict[str, Any]) -> dict[str, Any]:
    """Return what a program answers; {"missing": why} if there is no answer."""
    if not Path(PYTHON).exists():
        return {"missing": f"not on this machine: no {PYTHON}"}
    try:
        run = _run([PYTHON, "-I", str(HERE / program)], json.dumps(problem))
    except subprocess.TimeoutExpired:
        return {"missing": f"no answer within {LONGEST:g} s"}
    if run.returncode:
        said = " ".join(run.stderr.strip().splitlines()[-1:])
        return {"missing": f"{program} failed with status {run.returncode}: {said or 'no message'}"}
    answer: dict[str, Any] = json.loads(run.stdout.strip().splitlines()[-1])
    return answer


def _run(command: list[str], text: str) -> subprocess.CompletedProcess[str]:
    # for such small matrices more than one thread costs a hundred times the work
    one_thread = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        command,
        input=text,
        capture_output=True,
        text=True,
        check=False,
        env=one_thread,
        timeout=LONGEST,
    )
