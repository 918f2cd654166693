"""Top floor: the command line, which alone knows all others."""
