"""Proofs: all solutions of a formula in a box; counts and pieces of systems with exact data.

Imported when asked for. Theorems and premises stand on the page "Proofs" of the manual.
"""
