"""A view in the browser: the branch diagram and its solutions in one file."""
