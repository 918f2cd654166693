"""Linear algebra with matrices of every structure."""
