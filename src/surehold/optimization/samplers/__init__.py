"""Markov chain Monte Carlo samplers of hyperparameters."""
