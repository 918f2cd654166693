# PYTHON_ARGCOMPLETE_OK
"""The commands ``pwscont`` and ``python -m pwscont``, with the steps before numpy is loaded.

- BLAS takes the number of its threads from the environment when it is loaded. The matrices here
  have a few hundred rows: threads that wait for each other cost ten times the work.
- Loading takes most of a second. Whoever interrupts it sees the program end, and no traceback.
"""

import os
import signal
from importlib import import_module


def main() -> int:
    """Run the command line; returns the exit status."""
    interruptible = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if interruptible:  # there is nothing to clean up yet: end as the system does it
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    variables = import_module("pwscont.linear.threads").THREADS
    if not any(name in os.environ for name in variables):
        os.environ |= dict.fromkeys(variables, "1")
    run = import_module("pwscont.commands.cli").main
    if interruptible:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    return int(run())


if __name__ == "__main__":
    raise SystemExit(main())
