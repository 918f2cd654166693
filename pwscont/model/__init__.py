"""Floor 1: the system that a user writes, and the smooth selections it is made of."""
