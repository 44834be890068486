"""surehold: find, in few trials, the optimum that still holds when the input shakes."""
