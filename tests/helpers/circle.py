"""A curve of which everything is known."""

from pwscont import PiecewiseSystem


class Circle(PiecewiseSystem):
    """z^2 + alpha^2 = 1, with a kink that changes nothing at z = 1/2."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 0.5

    def residual(self, z, alpha, character):
        return z**2 + alpha**2 - 1.0
