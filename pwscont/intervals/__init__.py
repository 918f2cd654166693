"""Arithmetic of intervals with outward rounding, thousands at a time; imported when asked for."""
