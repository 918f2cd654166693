"""Random curved systems with independent truth, and a judge, for ``curved_sweep.py``."""
