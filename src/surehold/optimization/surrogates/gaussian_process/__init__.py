"""Gaussian processes with sampled hyperparameters."""
