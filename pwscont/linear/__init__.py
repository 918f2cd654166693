"""Floor 2: linear algebra with matrices of every structure."""
