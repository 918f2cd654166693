"""What a user writes, its selections, and the checks of it."""
