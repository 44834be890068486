"""surehold's sampler for OptunaHub: it lives in the package surehold, `pip install 'surehold[study]'`."""

from surehold import InputNoise, Sampler

__all__ = ["InputNoise", "SureholdSampler"]

SureholdSampler = Sampler
