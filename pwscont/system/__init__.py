"""Floor 1: what a user writes, its selections, and the checks of it."""
