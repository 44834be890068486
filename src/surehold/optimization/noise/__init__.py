"""The input noise: how far the reached input strays from the commanded one, and averages over it."""
