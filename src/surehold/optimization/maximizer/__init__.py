"""Finding the highest point of an acquisition function over the unit cube."""
