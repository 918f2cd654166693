"""The end of ``--help``: examples, each run by a test, and the exit statuses."""

from __future__ import annotations

import argparse
from typing import Any

#: For each command, "" for the program itself: examples, each with its effect.
EXAMPLES: dict[str, dict[str, str]] = {
    "": {
        "pwscont scenes": "what is ready to run",
        "pwscont run example3 -o out": "branches and numbers of solutions, with picture and graph",
        "pwscont run fig7 --at 0.3": "all solutions at one value of the parameter, too",
    },
    "run": {
        "pwscont run fig7 --at -0.7 0.3": "solutions at two values of the parameter",
        "pwscont run block -s nodes=8 --at 0.7": "with a setting of the scene",
        "pwscont run example3 -o out": "write picture and graph into the directory out",
        "pwscont run fig7 --json": "for other programs",
        "pwscont run fig7 --html fig7.html": "a page to look at in a browser",
        "pwscont run example1 --explain": "say which parts the run is made of",
    },
    "view": {
        "pwscont view out/fig7.npz": "a page beside the graph that 'run fig7 -o out' wrote",
        "pwscont view out/fig7.npz -o fig7.html": "a page of another name",
    },
    "sweep": {
        "pwscont sweep wedge -s nodes=2 --over friction=0.5:2:4": "most solutions",
        "pwscont sweep wedge -s nodes=2 --over angle=10,20 --measure first-fold": "a fold",
        "pwscont sweep wedge -s nodes=2 --over friction=0.5,1 --over angle=9:40:2 -o out": "map",
    },
    "bench": {
        "pwscont bench --quick": "few problems, few runs",
        "pwscont bench fig13 -o out": "one problem; write picture and data, too",
    },
}

STATUS = """\
exit status:
  0    done, or the reader of the output has seen enough
  1    every case of a sweep failed
  2    wrong input, or files that cannot be read or written: standard error says which
  130  interrupted; with -o what is finished is kept, and --resume goes on"""


def with_examples(command: str, **more: Any) -> dict[str, Any]:
    """Return the arguments of a parser whose help ends with examples and exit statuses."""
    width = max(map(len, EXAMPLES[command]))
    lines = [f"  {line:<{width}}  {what}" for line, what in EXAMPLES[command].items()]
    epilog = "\n".join(["examples:", *lines, "", STATUS])
    return more | {"epilog": epilog, "formatter_class": argparse.RawDescriptionHelpFormatter}
