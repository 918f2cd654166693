"""Checks that a user runs on a class of their own, outside of any run."""
