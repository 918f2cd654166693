"""Floor 7: scenes, tables, pictures and the command line."""
