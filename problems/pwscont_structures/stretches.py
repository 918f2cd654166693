"""Lists of numbers in words."""

from __future__ import annotations

from pwscont.extending import Indices


def stretches(numbers: Indices) -> str:
    """Return ascending numbers with stretches in short: ``3-7, 12``."""
    runs: list[list[int]] = []
    for number in numbers.tolist():
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs)
