"""One smooth curve: metric, Newton, predictors, correctors, step sizes."""
