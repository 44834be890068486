"""What an optimizer requires of its trials and of its answer, besides a good value: the models of all of that.

    may be commanded   `allowed`, see `constraints.input`
    within limits      further outputs, see `constraints.outcome`; each has a Gaussian process of its own
    safe               in safe mode, see `Requirements.admission`

A trial is feasible, and may become the answer, where an execution there keeps all outputs within their limits with the
probability `level`: over the input noise and what the models do not know. Without either, what was told decides. Noise
of observations does not count: no input can lessen it by where it is.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from surehold.defaults import ANCHORS, APART, FAILURE_POWER, SUCCESS_SHARE
from surehold.errors import InputError, SureholdError
from surehold.optimization.box import Box
from surehold.optimization.constraints.admission import Admission, Likelihood, Requirement
from surehold.optimization.constraints.feasibility import Succeeds, SuccessModel
from surehold.optimization.constraints.input import Region
from surehold.optimization.constraints.outcome import Within, execution_probability
from surehold.optimization.lattice import Lattice
from surehold.optimization.limits import Limit
from surehold.optimization.maximizer.holes import largest_holes
from surehold.optimization.maximizer.multistart import multistart
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.output_models import OutputModels
from surehold.optimization.recommendation import Recommendation, execution_at
from surehold.optimization.response_model import expected_places
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.gaussian_process.observations import NoiseName
from surehold.optimization.trials import Trials, same

__all__ = ["Requirements"]


class Requirements:
    """See above.

    Parameters
    ----------
    region
        Inputs that may be commanded; None: all of the box.
    limits
        Of further outputs, watched ones included.
    level
        Probability with which the answer has to keep all limits.
    safety
        Probability with which every trial has to keep them, after the initial points; None: trials may break them.
    straying
        The input noise of the trials themselves; None if they reach what is commanded.
    noise
        Observation noise of the outputs: "none" or "inferred".
    failures
        Up to how many trials it is learnt where they fail.
    """

    def __init__(
        self,
        box: Box,
        region: Region | None,
        limits: tuple[Limit, ...],
        *,
        level: float,
        safety: float | None,
        ranking: Ranking,
        straying: InputNoise | None,
        noise: NoiseName,
        lattice: Lattice | None,
        seed: int,
        failures: float = 0,
    ):
        self.failures: Final = failures
        self.region: Final = region
        self.limits: Final = limits
        self.level: Final = level
        self.safety: Final = safety
        self._box: Final = box
        self._ranking: Final = ranking
        self._straying: Final = straying
        self._success: tuple[int, SuccessModel] | None = None
        self._allowed: list[bool] = []
        self._outputs: Final = OutputModels(
            box, limits, cautious=safety is not None, straying=straying, noise=noise, lattice=lattice, seed=seed
        )

    def forget(self) -> None:
        """Drop what was learnt: the trials are others from now on."""
        self._outputs.forget()
        self._success = None
        self._allowed = []

    # --- which trials are feasible --------------------------------------------------------------------------------

    def probability(self, trials: Trials, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the probability (q,) that one execution at U (q, d) keeps all limits."""
        return execution_probability(self._outputs.required(trials), self._ranking.accurate, U)

    def feasibility(self, trials: Trials) -> NDArray[np.float64]:
        """Return the probability (t,) that one execution where each trial was keeps all limits; 0 if not allowed.

        Where inputs and observations are exact, what was told decides.
        """
        places, told = trials.places, self._outputs.told(trials)
        found = np.ones(len(trials))
        known = np.isfinite(told).all(axis=1) & (self._ranking.exact_inputs and not self._ranking.noisy)
        if known.any():
            found[known] = self._outputs.missed(trials)[known].max(axis=1, initial=-np.inf) <= 0.0
        if not known.all() and self._outputs.limited:
            found[~known] = self.probability(trials, places[~known])
        found[~self._allowed_at(trials)] = 0.0
        if self.safety is not None and self._outputs.unmeasured(trials):
            found[:] = 0.0
        return found

    def _allowed_at(self, trials: Trials) -> NDArray[np.bool_]:
        """Tell where trials were made at allowed inputs, (t,): asked once of each, for a function may take its time."""
        if self.region is None:
            return np.ones(len(trials), dtype=bool)
        new = trials.places[len(self._allowed) :]
        if len(new):
            self._allowed += self.region.contains(new).tolist()
        return np.array(self._allowed, dtype=bool)

    @property
    def _enough(self) -> float:
        """The share of the perturbations that has to keep all limits: `level`, and half of one more where there is one.

        A search for the best value ends where the next perturbation is about to break a limit, and up to there, half of
        what lies between the two, executions break it already.
        """
        weights = self._ranking.accurate.quadrature.weights
        half = 0.0 if len(weights) == 1 else 0.5 * float(weights.max())
        return max(self.level, min(self.level + half, 1.0 - half))

    @property
    def _sought(self) -> float:
        """The share of executions that has to keep all limits where a trial is sought that may be the answer.

        Perturbations that keep them are whole ones: where `_enough` asks for 61.3 of 64, it takes 62, which do from a
        share of about 61.5 on; the search goes where it is 61.75.
        """
        n = len(self._ranking.accurate.quadrature.weights)
        return self.level if n == 1 else max(self._enough, (np.ceil(self._enough * n) - 0.25) / n)

    def feasible(self, trials: Trials) -> NDArray[np.bool_]:
        """Tell which trials may become the answer, (t,)."""
        found = trials.eligible & (self.feasibility(trials) >= self._enough)
        model = self._where_it_fails(trials)
        if model is None or self._ranking.exact_inputs or not found.any():
            return found
        share = np.exp(Succeeds(model, self._ranking.accurate).log_probability(trials.places[found])[0])
        found[found] = share >= min(self.level, SUCCESS_SHARE * share.max())
        return found

    def model_failures(self, trials: Trials) -> bool:
        """Tell whether failed trials teach where trials fail, and nothing of the response."""
        successful = trials.successful
        return len(trials) <= self.failures and bool(successful.any()) and not successful.all()

    def _where_it_fails(self, trials: Trials) -> SuccessModel | None:
        if not self.model_failures(trials):
            return None
        if self._success is None or self._success[0] != len(trials):
            places = expected_places(trials, self._straying, self._box)
            self._success = (len(trials), SuccessModel(places, trials.successful))
        return self._success[1]

    def shortfall(self, trials: Trials) -> str:
        """Return in words that nothing feasible is known, and what came nearest; empty where something is."""
        if unmeasured := self._outputs.unmeasured(trials):
            names = " and ".join(unmeasured)
            return f"none of {len(trials)} trials has measured {names}: whether limits are kept there is not known."
        if self.feasible(trials).any():
            return ""
        limited, missed = self._outputs.limited, self._outputs.missed(trials)
        measured = trials.successful & np.isfinite(missed).all(axis=1) & (len(limited) > 0)
        start = f"no feasible trial in {len(trials)}"
        if not measured.any():
            return f"{start}."
        nearest = int(np.argmin(np.where(measured, self._outputs.beyond(trials), np.inf)))
        parts = [
            f"missed {limit.name} by {amount:.3g}"
            for limit, amount in zip(limited, missed[nearest], strict=True)
            if amount > 0.0
        ]
        if parts:
            return f"{start}; the nearest {' and '.join(parts)}."
        share = float(self.feasibility(trials)[trials.eligible].max(initial=0.0))
        return f"{start}: of the likeliest, {share:.0%} of executions keep all limits, of {self.level:.0%} asked for."

    def nearest(self, trials: Trials) -> History:
        """Return the trial that is likeliest to be feasible, or misses least, as the only one: for want of a better.

        Raises InputError if no allowed trial has given a value.
        """
        share = np.where(trials.eligible, self.feasibility(trials), -1.0)
        if not (trials.eligible & self._allowed_at(trials)).any():
            where = "an allowed input" if trials.kept.any() else "the values of fixed variables"
            raise InputError(f"no trial at {where} has given a value yet; ask for one, and tell its outcome.")
        best = share >= share.max() - 1e-12
        if best.sum() > 1:  # all certainly infeasible: the one that misses least
            beyond = self._outputs.beyond(trials)
            best = np.arange(len(best)) == int(np.argmin(np.where(best & np.isfinite(beyond), beyond, np.inf)))
        none = np.empty((0, self._box.dimension))
        return History(trials.places[best], trials.modelled[best], none, none)

    def described(
        self, answer: Recommendation, trials: Trials, u: NDArray[np.float64], reached: Perturbations, sign: float
    ) -> Recommendation:
        """Return the answer at u (d,) with what is known of its outputs and of its feasibility."""
        if self.region is None and not self.limits and not self.model_failures(trials):
            return answer
        posteriors = self._outputs.all(trials)
        outputs = {name: execution_at(posterior, reached, u) for name, posterior in posteriors.items()}
        tried = np.flatnonzero(trials.eligible & same(u, trials.places)) if self._ranking.exact_inputs else []
        if len(tried):  # what was told there says more than the model, where observations are exact
            share = float(self.feasibility(trials)[tried].max())
        else:
            share = float(execution_probability(self._outputs.required(trials), reached, u[None, :])[0])
        if self._outputs.unmeasured(trials):  # nothing is known: no promise is made
            share = 0.0
        highest = int(np.nanargmax(trials.values))
        refused = answer.refused
        if not self.feasible(trials)[highest]:
            refused = self._why_refused(trials, highest, sign)
        return replace(answer, feasible=share, infeasible=self.shortfall(trials), outputs=outputs, refused=refused)

    def _why_refused(self, trials: Trials, k: int, sign: float) -> str:
        what = "highest" if sign > 0.0 else "lowest"
        start = f"The {what} observed trial gave {sign * trials.values[k]:.4g}, but "
        missed = zip(self._outputs.limited, self._outputs.missed(trials)[k], strict=True)
        parts = [f"{limit.name} by {m:.3g}" for limit, m in missed if m > 0.0]
        if parts:
            return f"{start}missed {' and '.join(parts)}."
        if not self._allowed_at(trials)[k]:
            return f"{start}is not allowed."
        if not trials.eligible[k]:
            return start + trials.why_no_answer(k)
        if (model := self._where_it_fails(trials)) is not None and not self._ranking.exact_inputs:
            share = float(
                np.exp(Succeeds(model, self._ranking.accurate).log_probability(trials.places[k : k + 1])[0][0])
            )
            if share < self.level:
                shown = np.floor(1e3 * share) / 10.0  # rounded up it could be what is asked for
                return (
                    f"{start}only {shown:g} % of its executions are expected to succeed, and {100.0 * self.level:g} % "
                    "are asked for."
                )
        share = float(self.probability(trials, trials.places[k : k + 1])[0])
        if share >= self.level:
            few = f"too few to be sure of the {100.0 * self.level:.4g}% asked for"
            return f"{start}{share:.1%} of its executions are expected to keep all limits, {few}."
        return f"{start}only {share:.0%} of its executions are expected to keep all limits."

    # --- where to search ------------------------------------------------------------------------------------------

    def admission(self, trials: Trials) -> Admission | None:
        """Return what the search for the next trial has to respect.

        In safe mode, after SafeOpt (Sui et al. 2015), only inputs can be tried where a trial keeps all limits with the
        probability `safety` by every particle of the models. That holds as far as one particle is right: length-scales
        are learnt from few trials and no bound on the outputs' smoothness is assumed, so that there is no proof, and of
        many trials the share 1 - safety may fail. What cannot be reached through safe inputs is never found.
        """
        outputs = self._outputs.required(trials)
        fails = self._where_it_fails(trials)
        if self.region is None and not outputs and fails is None:
            return None
        share = 1.0 - (1.0 - self._sought) / max(len(self._outputs.limited), 1)
        ranking = self._ranking
        perturbations = Perturbations(exact(self._box.dimension)) if ranking.exact_inputs else ranking.coarse
        within: tuple[Requirement, ...] = tuple(
            Within(posterior, limit, perturbations, float(ndtri(share))) for posterior, limit in outputs
        )
        if fails is not None:
            within = (*within, Succeeds(fails, perturbations, FAILURE_POWER))
        safety = self.safety
        if safety is None:
            return Admission(self.region, within)
        reached = ranking.accurate if self._straying is not None else Perturbations(exact(self._box.dimension))

        def safe(U: NDArray[np.float64]) -> NDArray[np.bool_]:
            return execution_probability(outputs, reached, U, cautious=True) >= safety

        return Admission(self.region, within, safe)

    def most_probable(self, trials: Trials, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points of the cube (c, d), best first, that are likely to be feasible: for want of a feasible trial.

        Raises SureholdError in safe mode, where that means that nothing is known to be safe.
        """
        if self.safety is not None:
            raise SureholdError(
                f"nothing is known to be safe: {self.shortfall(trials)} Give initial_points= that keep all limits."
            )
        anchors = trials.places[np.argsort(-self.feasibility(trials), kind="stable")[:ANCHORS]]
        admission = self.admission(trials) or Admission()
        found = multistart(Likelihood(), Likelihood(), self._box.dimension, anchors, rng, None, admission)
        if not len(trials.pending) or not len(found):
            return found
        far = np.linalg.norm(found[:, None] - trials.pending, axis=2).min(axis=1)
        logs = admission.log_probability(found)[0] + np.log(-np.expm1(-0.5 * (far / APART) ** 2) + 1e-300)
        return found[np.argsort(-logs, kind="stable")]

    def strict(self, trials: Trials) -> Admission | None:
        """Return what an answer has to respect that was never tried; None for nothing."""
        outputs, model = self._outputs.required(trials), self._where_it_fails(trials)
        if self.region is None and not outputs and model is None:
            return None
        succeeds = None if model is None else Succeeds(model, self._ranking.accurate)
        least = -np.inf
        if succeeds is not None:
            best = succeeds.log_probability(trials.places[trials.eligible])[0].max()
            least = float(np.minimum(np.log(self.level), np.log(SUCCESS_SHARE) + best))

        def feasible(U: NDArray[np.float64]) -> NDArray[np.bool_]:
            found = execution_probability(outputs, self._ranking.accurate, U) >= self._enough
            return found if succeeds is None else found & (succeeds.log_probability(U)[0] >= least)

        return Admission(self.region, (), feasible if outputs or succeeds is not None else None)

    def initial(self, design: NDArray[np.float64], first: NDArray[np.float64], rng: Any) -> NDArray[np.float64]:
        """Return an initial design (n, d) whose points are allowed; `first` (k, d) come before it."""
        return design if self.region is None else self.region.design(design, first, rng)

    def otherwise(self, trials: Trials, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return a point (d,) to try where no candidate is left: a random one; in safe mode the safest tried one."""
        if self.safety is not None and len(trials):
            return trials.places[int(np.argmax(np.where(trials.eligible, self.feasibility(trials), -1.0)))]
        if self.safety is not None:
            if not len(trials.pending):
                raise SureholdError("nothing is known to be safe yet; ask for the initial points first.")
            return trials.pending[0]  # one of the initial points, which are trusted
        points = np.concatenate([trials.places, trials.pending])
        # nothing has succeeded: where nothing has been tried
        if self.failures and len(points) and not trials.successful.any():
            holes = largest_holes(points, rng, self.admission(trials))
            if len(holes):
                return holes[0]
        return rng.random(self._box.dimension) if self.region is None else self.region.draw(1, rng)[0]
