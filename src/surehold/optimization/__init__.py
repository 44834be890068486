"""The optimizer: surrogates and their inference, criteria, robustness to input noise, ask and tell. Knows no robot."""
