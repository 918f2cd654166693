"""Floor 3: one smooth curve: metric, Newton, predictors, correctors, step sizes."""
