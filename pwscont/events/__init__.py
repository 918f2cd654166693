"""Events: zeros of functions that a user names; imported if a run has events."""
