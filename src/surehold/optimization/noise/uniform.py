"""Bounded input noise: equally likely anywhere within half-widths of the commanded input."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.box import Box
from surehold.optimization.noise.gaussian import in_order
from surehold.optimization.noise.kinds import Root, root_of
from surehold.optimization.noise.quadratures import Quadrature, quadrature

__all__ = ["Uniform"]


@dataclass(frozen=True, repr=False)
class Uniform:
    """Independent uniform noise."""

    deviations: Mapping[str, float]
    """{name: half-width / sqrt(3)}, the standard deviations, in the box's units; 0 for exact variables"""
    gaussian, bounded, varies = False, True, False

    def unit_covariance(self, box: Box, x: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the covariance (d, d)."""
        return np.diag((in_order(self.deviations, box) / box.widths) ** 2)

    def unit_mean(self, box: Box) -> NDArray[np.float64]:
        """Return the mean (d,), which is 0."""
        return np.zeros(box.dimension)

    def draws(self, box: Box, u: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return n draws (n, d)."""
        standard = rng.uniform(-(3.0**0.5), 3.0**0.5, (n, box.dimension))
        return standard @ root_of(self.unit_covariance(box)).T

    def quadrature(self, box: Box, rule: str, k: float, exponent: int) -> tuple[Quadrature, Root | None]:
        """Return the quadrature of a rule."""
        return quadrature(rule, self.unit_covariance(box), k, bounded=True, exponent=exponent), None

    def __repr__(self) -> str:
        half_widths = {name: round(3.0**0.5 * value, 12) for name, value in self.deviations.items()}
        return f"InputNoise.uniform({half_widths})"
