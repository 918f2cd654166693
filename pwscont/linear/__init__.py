"""Linear algebra with matrices of every structure; begin with factor.py, then factorise.py."""
