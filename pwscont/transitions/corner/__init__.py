"""Corners: where several interfaces meet, every way on."""
