"""All solutions of systems that are affine in z, by a search over all cells."""
