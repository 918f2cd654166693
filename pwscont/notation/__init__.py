"""Piecewise-smooth systems written as on paper: with max, min, abs, relu and clip."""
