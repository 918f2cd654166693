"""All solutions of a formula in a box, proved by interval arithmetic; imported when asked for.

The theorem and its premises stand on the page "Proofs" of the manual.
"""
