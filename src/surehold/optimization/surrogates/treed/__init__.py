"""Treed Gaussian processes: one process a leaf, for responses whose smoothness changes over the space."""
