"""Many runs: sweeps over settings, measures of each run, and the store of results."""
