"""Corners, where several interfaces meet: all rays that leave one."""
