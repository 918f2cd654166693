"""The system that a user writes, the selections of the system, and the checks of systems."""
