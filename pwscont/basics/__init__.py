"""Ground floor: arrays, errors, characters, tolerances, and what a run is allowed to cost."""
