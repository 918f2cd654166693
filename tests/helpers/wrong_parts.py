"""Parts that break their contract, for several files of tests."""

from pwscont import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    trace,
)


class Bent(PiecewiseSystem):
    """z + z^2 / 4 = 0.4 alpha + 0.0125: z = 1/2 at alpha = 1.375, z = 0.3 at alpha = 0.775."""

    size = 1
    half, third = 1.375, 0.775

    def test_functions(self, z, alpha):
        return z - 5.0

    def residual(self, z, alpha, character):
        return z + 0.25 * z**2 - 0.4 * alpha - 0.0125


class Straight(PiecewiseLinearSystem):
    """z = 0.4 alpha - 0.05: z = 1/2 at alpha = 1.375, z = 0.3 at alpha = 0.875."""

    size = 1
    half, third = 1.375, 0.875

    def test_functions(self, z, alpha):
        return z - 5.0

    def residual(self, z, alpha, character):
        return z - 0.4 * alpha + 0.05


class Lines(SlicewiseLinearSystem):
    """z = alpha."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 5.0

    def residual(self, z, alpha, character):
        return z - alpha


def through(system, events, start=1.0, **options):
    return trace(system, ([0.0], start), (0.0, 2.0), events=events, **options)
