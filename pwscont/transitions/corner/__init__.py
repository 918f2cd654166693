"""Corners, where several interfaces meet; the way in is ``tangent_cone`` in cone.py."""
