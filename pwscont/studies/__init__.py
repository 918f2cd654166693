"""Many runs: sweeps over settings, what is measured of each, and where results are kept."""
