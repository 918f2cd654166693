"""Special points: the ends of smooth pieces, and the rays that leave from there."""
