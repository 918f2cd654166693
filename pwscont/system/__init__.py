"""The system that a user writes, its selections, and the checks of systems."""
