"""Families of systems, loci of special points in the plane of two parameters, regions."""
