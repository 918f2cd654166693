"""A smooth curve: metric, Newton, predictors, correctors, step sizes."""
