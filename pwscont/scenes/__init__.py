"""Named problems, ready to run: scenes, tables and pictures."""
