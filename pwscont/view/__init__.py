"""A view in the browser: the branch diagram and the solutions in one file."""
