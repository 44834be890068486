"""Where a commanded input may end up: a quadrature of the input noise, and the rule at the border of the box.

Legend
    U        queries in the unit cube, (q, d)
    offsets  perturbations xi_i, (s, d), or (q, s, d) where the border makes them differ from query to query
    weights  w_i, (s,), summing to 1
    g(x)     outcome under the input noise, E f(x + noise), about sum_i w_i f(x + xi_i)      [UO, thesis (3.21)]
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import QUASI_RANDOM_EXPONENT
from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.kinds import Root
from surehold.optimization.noise.pairing import under_conditions
from surehold.optimization.noise.quadratures import QUADRATURES, Quadrature, exact, quadrature
from surehold.optimization.surrogates.gaussian_process.closed_form import closed_form
from surehold.optimization.surrogates.protocol import Moments, Posterior

__all__ = ["BORDERS", "Allowed", "Perturbations"]

BORDERS: Final = ("extend", "clip", "keep")
_BISECTED: Final = 1e-3  # of a perturbation: how near to the border of what is allowed it is drawn back

Allowed = Callable[[NDArray[np.float64]], NDArray[np.bool_]]


@dataclass(frozen=True)
class Perturbations:
    """Weighted perturbations of an input, and what happens to those that leave the box.

    The rule at the border: "extend" lets the model be evaluated outside the box; "clip" moves a coordinate that left
    back to the border; "keep" gives it its noise-free value, as the thesis scores its runs. Where not all of the box is
    `allowed`, "clip" draws the whole point back towards the commanded one, and "keep" gives it that one.
    """

    quadrature: Quadrature
    """of the noise itself; of standard normal variables where `root` scales them"""
    border: str = "extend"
    root: Root | None = None
    """for noise that varies: points (q, d) -> roots of the covariances there, (q, d, d)"""
    covariance: NDArray[np.float64] | None = None
    """(d, d) where outcomes are computed in closed form; the quadrature then serves everything else"""
    held: NDArray[np.bool_] | None = None
    """uncontrolled variables (d,): their "offsets" are the values that they take, whatever the query's"""
    allowed: Allowed | None = None
    """tells which points (k, d) of the cube may be commanded; the border rules "clip" and "keep" hold there, too"""

    def __post_init__(self) -> None:
        if self.border not in BORDERS:
            raise unknown_name("border rule", self.border, BORDERS)

    @classmethod
    def of(
        cls,
        noise: InputNoise | None,
        box: Box,
        rule: str,
        border: str = "extend",
        *,
        k: float = 1.0,
        exponent: int = QUASI_RANDOM_EXPONENT,
        allowed: Allowed | None = None,
    ) -> "Perturbations":
        """Return the perturbations of an input noise by a quadrature rule; None is no noise.

        Raises
        ------
        InputError
            For an unknown rule, also where there is no noise, and for a rule that does not fit the noise.
        """
        if rule not in (*QUADRATURES, "closed_form"):
            raise unknown_name("quadrature", rule, (*QUADRATURES, "closed_form"))
        allowed = None if border == "extend" else allowed
        if box.uncontrolled is not None:
            if rule == "closed_form":
                raise InputError("the quadrature 'closed_form' knows no uncontrolled variables; choose another one.")
            points, root = (
                (exact(box.dimension), None) if noise is None else noise.kind.quadrature(box, rule, k, exponent)
            )
            return cls(
                under_conditions(points, box.uncontrolled, rule, exponent),
                border,
                root,
                None,
                box.uncontrolled.held,
                allowed,
            )
        if noise is None:
            return cls(exact(box.dimension), border)
        if rule == "closed_form":
            if not noise.kind.gaussian or border != "extend":
                raise InputError(
                    "the quadrature 'closed_form' is for Gaussian noise that is the same everywhere and the border "
                    "rule 'extend'; choose another quadrature."
                )
            covariance = noise.unit_covariance(box)
            return cls(quadrature("quasi_monte_carlo", covariance), border, None, covariance)
        points, root = noise.kind.quadrature(box, rule, k, exponent)
        return cls(points, border, root, allowed=allowed)

    @property
    def unknown_slopes(self) -> bool:
        """Whether a user's function of the query moves the points, so that gradients by the query leave that out."""
        return self.root is not None or self.allowed is not None

    def around(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the perturbed points (q, s, d) of U (q, d)."""
        offsets, _ = self._at(U)
        return U[:, None, :] + offsets

    def with_slopes(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Return the perturbed points (q, s, d), and their derivatives by the query's coordinates (None: 1)."""
        offsets, slopes = self._at(U)
        return U[:, None, :] + offsets, slopes

    def outcome(self, posterior: Posterior, U: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of g at U (q, d) under each particle."""
        if self.covariance is not None:
            return closed_form(posterior, U, self.covariance, gradient)
        offsets, slopes = self._at(U)
        return posterior.average(U, offsets, self.quadrature.weights, gradient, slopes)

    def spread(
        self, posterior: Posterior, U: NDArray[np.float64], gradient: bool = False
    ) -> tuple[Moments, NDArray[np.float64] | None]:
        """Return the moments of f at all perturbed points, query by query: (m, q s); and slopes (q, s, d)."""
        offsets, slopes = self._at(U)
        points = U[:, None, :] + offsets
        return posterior.moments(points.reshape(-1, U.shape[1]), gradient), slopes

    def _at(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Return offsets, and the derivative of each perturbed coordinate by the query's (None: 1 everywhere)."""
        offsets = self.quadrature.offsets
        free = None
        if self.root is not None and self.held is None:
            offsets = np.einsum("qde,se->qsd", self.root(U), offsets)
        if self.held is not None:
            if self.root is not None:  # noise that varies is that under the condition
                places = np.where(self.held, offsets, U[:, None, :])
                roots = self.root(places.reshape(-1, U.shape[1])).reshape(*places.shape, U.shape[1])
                offsets = np.einsum("qsde,se->qsd", roots, np.where(self.held, 0.0, offsets))
            offsets = np.where(self.held, self.quadrature.offsets - U[:, None, :], offsets)
            free = np.broadcast_to(np.where(self.held, 0.0, 1.0), offsets.shape)
        if self.border == "extend":
            return offsets, free
        points = U[:, None, :] + offsets
        inside = (points >= 0.0) & (points <= 1.0)
        if self.allowed is not None:
            return self._drawn_back(U, np.where(inside, offsets, 0.0) if self.border == "keep" else offsets), free
        if inside.all():
            return offsets, free
        if self.border == "keep":
            return np.where(inside, offsets, 0.0), free
        slopes = inside.astype(np.float64)
        return np.clip(points, 0.0, 1.0) - U[:, None, :], slopes if free is None else slopes * free

    def _drawn_back(self, U: NDArray[np.float64], offsets: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return offsets (q, s, d) whose points are allowed: "keep": none; "clip": on the way there, by bisection."""
        points = np.clip(U[:, None, :] + offsets, 0.0, 1.0)
        offsets = (points - U[:, None, :]).reshape(-1, U.shape[1])
        start = np.repeat(U, points.shape[1], axis=0)
        good = np.ones(len(start), dtype=bool) if self.allowed is None else self.allowed(start + offsets)
        share = good.astype(np.float64)
        if self.border == "clip" and self.allowed is not None:
            bad, step = np.flatnonzero(~good), 0.5
            while step > _BISECTED:
                further = share[bad] + step
                share[bad] = np.where(self.allowed(start[bad] + further[:, None] * offsets[bad]), further, share[bad])
                step *= 0.5
        return (share[:, None] * offsets).reshape(points.shape)
