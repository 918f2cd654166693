"""Quasi-static contact with Coulomb friction: friction opposes the rate of slip."""
