"""Every constant that decides which trial an optimizer asks for next: value, unit, reason, and what chose it.

Behind each value stands the command that measured it, or the honest words "never measured". Where a command measures
the whole rather than this value against others, it says so. Tolerances that only guard against overflow and rounding
stay in the module that needs them.

Three more stand beside the compiled functions that use them, because Numba's cache notices changes of that file only:
`WIDE` and `NARROW` of `surrogates.local_global.density`, the widths of its two parts in box widths, and `_NU` of
`samplers.elliptical_slice`, the degrees of freedom of its proposals. None of them was measured against other values.

"Box widths" are widths of the unit cube, in which the optimizer works; "particles" are the equally likely settings of
the surrogate's hyperparameters.
"""

from math import log
from typing import Final

# --- initial design ---------------------------------------------------------------------------------------------------

#: Trials of the initial design for each variable, and their least number. With 2 d + 1 trials in place of 5 d runs end
#: as well: docs/results/where-it-fails.md. Never measured against other numbers.
DESIGN_PER_VARIABLE: Final = 5
DESIGN_LEAST: Final = 6
#: The most trials of the initial design: so many, and one more for so many variables each. It counts from five
#: variables on: a model of 100 variables learns which of them matter from 40 trials better than from 500, most of which
#: are lost. surehold campaign run high-dimension
DESIGN_MOST: Final = 20
DESIGN_VARIABLES_PER_MORE: Final = 5
#: Of so many trials of the initial design all but one keep the values that `Optimizer(guess=)` names.
#: python -m benchmarks.guess, and benchmarks.robust_grasps --methods guess; other numbers were never measured.
GUESS_TURN: Final = 3

# --- which tried inputs are the best ones -----------------------------------------------------------------------------

#: Best tried inputs around which the maximizer lays candidates. One may sit on a hill that is not the highest.
#: Never measured.
ANCHORS: Final = 3
#: Inputs, the best by the coarse ranking, that are ranked again with all particles and the accurate quadrature, or by a
#: corrected risk measure with a part of them. The coarse ranking need only place the best input among the first 16.
#: Never measured on its own; what a quadrature's ranking loses: python -m benchmarks.quadrature_error.
SHORTLIST: Final = 16
#: Of more tried inputs than this only those with the highest values are ranked by their outcome, and no risk measure is
#: corrected: an ask takes the same time whether there are a thousand or ten thousand. Never measured against other
#: numbers; python -m benchmarks.growth.
CONTENDERS: Final = 400
#: The coarse ranking, and the choice of the ascents' starts, use every (m // 3)-th of the m particles: numbers 0, 3, 6
#: and 9 of the default 10, which are four; so does the whole search for a risk measure but the worst case: with four
#: that lacks 4.6 (3.8) points more of StableOpt's best value (30 seeds of surehold campaign run robust-published).
SCREENING_DIVISOR: Final = 3

# --- which improvements are worth a trial -----------------------------------------------------------------------------

#: Improvement that does not count where observations and inputs are exact, in mean absolute deviations of the outputs.
#: Without it what is left of the model's variance beside the incumbent, the nugget's, draws trial after trial to the
#: same hill. Never measured on its own; the whole: python -m benchmarks.best_observed.
MARGIN: Final = 1e-3
#: The same for an outcome averaged over input noise, of which more variance is left: with 0.001 the broad hill of GM
#: holds 4 of 30 runs under a noise of 0.02, with 0.01 none.
#: python -m benchmarks.robust_regret --problems "gm 0.02" "gm 0.01" --methods default --seeds 30
MARGIN_UNDER_NOISE: Final = 1e-2
#: Every third trial counts any improvement, so that a smooth top is still found to many digits. It is due on the same
#: trials as COVERING_PERIOD: while the search is stalled those trials cover, and none polishes. Never measured.
POLISH_PERIOD: Final = 3

# --- insurance against a model that is too smooth ---------------------------------------------------------------------

#: Trials without a new best one after which the search counts as stalled. Never measured.
COVERING_PATIENCE: Final = 3
#: While it is stalled, every third trial goes to the largest hole; see POLISH_PERIOD. Never measured.
COVERING_PERIOD: Final = 3
#: Points of a Sobol sequence among which the center of the largest hole is sought. Never measured.
HOLE_CANDIDATES: Final = 1024
#: A hole may reach beyond the cube by this share of its radius; without a limit the corners, which are farthest from
#: everything and seldom where the answer is, would be filled first. Never measured.
HOLE_BEYOND: Final = 0.5

# --- acquisition functions --------------------------------------------------------------------------------------------

#: Standard deviations that the upper confidence bounds add, where `Optimizer(kappa=)` says nothing. Customary.
#: Never measured.
KAPPA: Final = 2.0
#: How much more the variance reduction counts that a trial at the candidate itself brings than one beside it: it may
#: become the answer, and in several dimensions some sigma point always tells a little more. With 1, needles in 3 and 5
#: dimensions take twice the trials.
#: python -m benchmarks.robust_regret --problems needle-3 needle-5 --methods default "no where to look"
AT_THE_PLACE: Final = 3.0
#: Share of a sigma point's offset at which a trial beside the candidate is considered, besides the whole offset. Never
#: measured.
LOOK_BETWEEN: Final = 0.5
#: Joint draws of each particle in the improvement of a risk measure. Common random numbers make it smooth in the query.
#: Never measured; the measures as a whole: surehold campaign run risk-measures.
RISK_DRAWS: Final = 16
#: Standard deviations of the upper confidence bound by which Thompson sampling chooses the points of its joint draw.
#: A draw's maximum elsewhere is improbable. Never measured.
PLAUSIBLE: Final = 3.0
#: Points of that joint draw, perturbed ones included: its cost grows with their cube. Never measured.
JOINT_POINTS: Final = 512

# --- quadratures of the input noise -----------------------------------------------------------------------------------

#: Quasi-random points, as a power of two, by which outcomes are averaged; and those in a box of so few variables, where
#: an ask takes 1.5 times as long with twice as many. What a rule alone loses: python -m benchmarks.rule_regret.
QUASI_RANDOM_EXPONENT: Final = 5
QUASI_RANDOM_EXPONENT_OF_FEW: Final = 6
FEW_VARIABLES: Final = 3
#: The same by which candidates are screened, those that climb being chosen among them. By sigma points, which it was
#: before, places that the model held for better were never tried: docs/results/where-it-fails.md; surehold campaign run
#: robust-published --only "NES polynomial,surehold robust". With 2**6 it ends no nearer there.
SCREENING_EXPONENT: Final = 4
#: Scramblings of which the points with the least discrepancy are taken. Never measured against other numbers; the rule
#: as it comes out: python -m benchmarks.rule_regret.
SCRAMBLINGS: Final = 64
#: Representative conditions, of uncontrolled variables, by which candidates are screened. Never measured.
COARSE_CONDITIONS: Final = 8
#: Quasi-random points, as a power of two, for the last climb of an answer anywhere in the box, and for the description
#: of answers: quantiles need more points than means. What is lost by the rule alone: python -m benchmarks.rule_regret.
OUTCOME_EXPONENT: Final = 7
#: The same for the mean of executions that is stated in a box of few variables, where a sure model would leave the
#: error of the average as the largest one. With 2**7, the stated 95 % interval covers .48 of 60 runs in one variable.
#: python -m benchmarks.calibration --rows "input noise"
MEAN_EXPONENT_OF_FEW: Final = 9
#: The same for the correction of a risk measure, and in a box of few variables. What is lost by the rule alone:
#: python -m benchmarks.rule_regret; with and without the correction: python -m benchmarks.risk_regret.
CORRECTION_EXPONENT: Final = 7
CORRECTION_EXPONENT_OF_FEW: Final = 9

# --- the maximizer of the acquisition function ------------------------------------------------------------------------

#: Candidates from a Sobol sequence over the cube. Never measured on its own; the whole: python -m
#: benchmarks.suggestion_time (time), python -m benchmarks.best_observed (result).
CANDIDATES: Final = 256
#: Standard deviations of the perturbed copies of each anchor, in box widths, and copies of each: a narrow peak is found
#: from its flank, hardly by chance. Never measured on their own.
COPY_SCALES: Final = (0.1, 0.03, 0.01, 0.003)
COPIES: Final = 8
#: Gradient ascents from the best candidates, and the least distance between two of their starts, in box widths.
#: Never measured on their own.
STARTS: Final = 4
START_DISTANCE: Final = 0.02
#: Candidates shared out among the regions of a tree, and regions of which each sends its best candidate to an ascent,
#: besides the best ones wherever they are. Never measured on their own.
CANDIDATES_IN_REGIONS: Final = 512
STARTS_IN_REGIONS: Final = 6
#: Coordinate exchange, where a sum of more than FEW_VARIABLES variables is learnt: places along each, rounds, and
#: points of a round at most, which leaves variables out where they are many. Never measured on their own; what the
#: exchange gains: python -m benchmarks.default_parts separable --without exchange.
EXCHANGE_PLACES: Final = 32
EXCHANGE_ROUNDS: Final = 4
EXCHANGE_POINTS: Final = 512
#: Evaluations, with gradient, of one ascent. Never measured on its own.
ASCENT_EVALUATIONS: Final = 40
#: Evaluations of the ascent by a corrected risk measure, which begins at the best trial by it. Never measured.
LAST_EVALUATIONS: Final = 10
#: Length of an ascent's first step and of its longest one later, in box widths. Never measured.
ASCENT_FIRST_STEP: Final = 0.05
ASCENT_LONGEST_STEP: Final = 0.25
#: Share of the gain promised by the slope that a step must bring, and the factor that shortens one that does not: the
#: sufficient decrease of Nocedal and Wright 2006, section 3.1. Never measured.
ASCENT_SUFFICIENT: Final = 1e-4
ASCENT_SHORTEN: Final = 0.25
#: An ascent ends when a step is shorter, in box widths, or gains less than this share of the values'
#: spread, of 1 + |value| where that is a logarithm. Never measured.
ASCENT_PRECISION: Final = 1e-8
#: Where inputs are constrained, ascents stop at the border; the best one is followed by a random search: rounds, points
#: in each, the first step in box widths, and the factor that shortens it after a round without success. Never measured.
SETTLING_ROUNDS: Final = 14
SETTLING_COPIES: Final = 24
SETTLING_FIRST: Final = 0.03
SETTLING_SHORTEN: Final = 0.4
#: Step of central differences, in box widths: near the fourth root of the rounding error, for values that come from a
#: factorization are good to about 1e-12. Never measured.
DIFFERENCE_STEP: Final = 1e-4

# --- surrogates: Gaussian process -------------------------------------------------------------------------------------

#: Prior of a length-scale: its median is 0.2 sqrt(d) box widths, with this standard deviation of the logarithm. The
#: factor sqrt(d) keeps the correlation of two random points the same for any number of variables. Never measured on its
#: own; the whole: python -m benchmarks.best_observed.
LENGTH_SCALE_MEDIAN: Final = 0.2
LENGTH_SCALE_DEVIATION: Final = 1.0
#: Mean and standard deviation of the logarithms of signal and noise variance, in squared standard deviations of the
#: outputs; the noise is 0.1 of these in the median. Never measured.
SIGNAL_VARIANCE_PRIOR: Final = (0.0, 1.5)
NOISE_VARIANCE_PRIOR: Final = (log(1e-2), 3.0)
#: Two scales: logarithm of the proportion of long to short length-scales, and log(w / (1 - w)) of the short part's
#: share w of the signal variance: mean and standard deviation. Never measured against other values; the whole, on
#: grasps and where there is one scale: python -m benchmarks.model_error --surrogates gp two_scales, and
#: python -m benchmarks.smooth_regret --methods default gp.
PROPORTION_PRIOR: Final = (log(8.0), 0.7)
SHARE_PRIOR: Final = (log(0.1), 1.5)
#: Logarithm of the odds of the smooth model against any other one before the trials. By evidence alone few trials of a
#: rough function are too often called smooth, and the model is then sure of what it does not know: stated intervals of
#: the mean covered 0.93 in place of 0.95, which -4 gives, too: python -m benchmarks.calibration --first-seed 10000
#: --runs 240 --rows "input noise" --dimensions 2. In regret nothing is gained, and GM under little noise loses: python
#: -m benchmarks.default_parts smooth --without odds --first 30, and robust.
SMOOTH_ODDS: Final = -2.0
#: The smooth model is none if a length-scale is below this, in box widths, and below the mean gap of the trials along
#: that variable, 1/n: it would be white noise there. Without this limit the largest error of the model on forty grasps
#: was 0.64 in place of 0.53: python -m benchmarks.model_error. On 117 landscapes it matters in eight runs, whose
#: answers are as near or nearer with it: python -m benchmarks.default_parts landscapes --without least. Never measured
#: against other numbers.
SMOOTH_LEAST: Final = 0.02
#: Variables up to which a sum of processes of one variable each is one of the models. Of many, a hundred trials do not
#: tell one-dimensional functions: on Styblinski-Tang in 50 one run came to 1,176, those of the process of one scale to
#: 1,171 (28) (surehold campaign run high-dimension), and in 100 outcomes under noise take three times as long.
#: python -m benchmarks.default_parts separable, and landscapes.
ADDITIVE_UP_TO: Final = 30
#: The same as SHARE_PRIOR, of the process of all variables beside that sum: it may be next to nothing. Of 30 sums and
#: products, which chose it, the regret with SHARE_PRIOR in its place was 2.2 % in place of 1.0 %:
#: python -m benchmarks.default_parts separable --first 0 --count 30
INTERACTION_PRIOR: Final = (log(0.1), 3.0)
#: Prior variance of the constant mean of two scales, in squared standard deviations of the outputs: trials crowd where
#: the response is good, so that their mean is far from that of the box. With 1 in place of 0 the median error on twelve
#: grasp runs was 0.26 in place of 0.29, before there was the smooth model: python -m benchmarks.model_error --seeds
#: 0 1 2.
CONSTANT_MEAN_VARIANCE: Final = 1.0
#: Nugget, as a fraction of the signal variance: small, for observations are exact unless `noise` says otherwise.
#: Never measured.
NUGGET: Final = 1e-10
#: Particles; sweeps before the first one and from one to the next. The chain starts at the mode and moves by the
#: curvature there, so that few sweeps are enough. Time: python -m benchmarks.suggestion_time. The answer from the same
#: trials by 60 particles is no better (docs/results/where-it-fails.md); effect on the search: never measured.
PARTICLES: Final = 10
BURN_IN: Final = 4
THIN: Final = 2
#: First guess of a slice's width of the coordinate-wise sampler, in logarithms: the thesis'. Never measured.
SLICE_WIDTH: Final = 6.0
#: Common length-scales at which the search for the mode may start, and how far it may go, in standard deviations of the
#: prior. Never measured.
MODE_STARTS: Final = (-2.0, -1.0, 0.0, 1.0)
MODE_REACH: Final = 6.0
#: Logarithm of the noise variance, in squared standard deviations of the outputs, where it starts once more: half of
#: what there is. What this does: python -m benchmarks.inferred_noise.
MODE_NOISE_START: Final = log(0.5)
#: Where L-BFGS-B ends: the mode guides a sampler, and within 1e-3 of the top is enough. Never measured.
MODE_TOLERANCES: Final = {"maxiter": 50, "ftol": 1e-5, "gtol": 1e-2}
#: Step of the differences of gradients that give the curvature at the mode, in logarithms. Never measured.
CURVATURE_STEP: Final = 0.05
#: Of more hyperparameters the curvature is taken along so many directions, in which it is largest, and as the same in
#: all others, its mean over so many random ones. In 1,000 variables standard deviations are right to 8 %, the log
#: evidences of two models against each other to 2, in a fifteenth of the time: python -m benchmarks.curvature.
MANY_HYPERPARAMETERS: Final = 150
DETERMINED: Final = 16
UNDETERMINED_PROBES: Final = 8
#: Hyperparameters are learnt again when the trials have grown by 1/16 of their number, or when a later trial misses its
#: prediction by so many standard deviations. Time: python -m benchmarks.suggestion_time. Effect on the result: never
#: measured.
RELEARNT_DIVISOR: Final = 16
SURPRISE: Final = 4.0
#: Trials up to which a process takes all of them together: its cost grows with their cube. Beyond, hyperparameters are
#: learnt from about so many of them. Time: python -m benchmarks.growth. The switch is late, for it loses precision:
#: made at 300 or 600 trials, regrets after 40 more are 2.1 and 3.4 times as large in 6 exact variables (0.33 +- 0.16
#: and 0.53 +- 0.31 decades); in 3 variables under noise both stay below 1e-3: python -m benchmarks.switch
MANY: Final = 800
MANY_LEARNT: Final = 200
#: Trials that a query is then answered from: the nearest of all, of every eighth, of every 64th. So many in up to ten
#: variables; d / 10 times as many in more, which have more slopes to learn, up to three times.
#: python -m benchmarks.growth; python -m benchmarks.neighbors
NEIGHBORS: Final = (36, 12, 8)
NEIGHBORS_VARIABLES: Final = 10
MOST_TIMES_NEIGHBORS: Final = 3.0
#: Of an average, a point is answered from the trials near the query where it lies within this fraction of the distance
#: of the farthest one of the nearest; the others share neighborhoods of their own, a quarter as many as there are
#: points, from the fewest to the most. Time: python -m benchmarks.growth.
WITHIN_REACH: Final = 0.5
FEWEST_NEIGHBORHOODS: Final = 4
MOST_NEIGHBORHOODS: Final = 15
#: Observation noise that varies: median length-scale of its logarithm over sqrt(d) box widths, standard deviation of
#: that in logarithms, prior of its variance; rounds, the change of the logarithm that ends them, and the largest step
#: at one observation. Never measured.
VARYING_NOISE_LENGTH_SCALE: Final = 0.5
VARYING_NOISE_LENGTH_SCALE_DEVIATION: Final = 0.7
VARYING_NOISE_VARIANCE_PRIOR: Final = (0.0, 1.0)
VARYING_NOISE_STEPS: Final = 20
VARYING_NOISE_CONVERGED: Final = 0.02
VARYING_NOISE_LONGEST_STEP: Final = 2.0
#: Rounds of learning where trials stray under the input noise: slopes, and from the third round on what averaging takes
#: off, are those of the round before. Two bend after the noise where surrogate="gp"; with three, four, five the stated
#: mean is .017 (.005), .002 (.004) and .009 (.004) too low where CURVATURE_WEIGHT is 2: python -m
#: benchmarks.calibration --rows straying --first-seed 10000 --runs 90 --dimensions 1 2.
SLOPE_ROUNDS: Final = 4
#: Of a mean a z + b z^2 along the input noise z, the noise of a trial that strays counts as a^2 and so many b^2. Its
#: variance has 2, by which the stated mean is too low where noise is wide (straying .1); with 0, which it was, the
#: intervals are too narrow where it is not. Chosen with python -m benchmarks.calibration --rows straying "straying .1"
#: --first-seed 10000 --dimensions 1 2.
CURVATURE_WEIGHT: Final = 1.0

# --- diagnosis of the model -------------------------------------------------------------------------------------------

#: Points of a Sobol sequence that tell which share of the box is nearest to each trial; a power of two. Never measured.
DIAGNOSIS_POINTS: Final = 1024
#: Trials below which nothing is said against a model: there is too little to tell by. Never measured.
DIAGNOSIS_LEAST: Final = 10
#: Share of trials left out within their 95 % intervals below which a model counts as too sure. Never measured against
#: other values; the shares themselves: python -m benchmarks.model_error.
POOR_COVERAGE: Final = 0.8

# --- surrogates: tree and mixture -------------------------------------------------------------------------------------

#: Smallest number of trials in a leaf of the tree. The thesis has 8 to 20, by problem.
#: surehold campaign run partition-rule
MIN_LEAF: Final = 15
#: No split lies nearer to the border of a leaf's box than this, in box widths (the thesis), or than the input noise's
#: standard deviation, of which no more than 0.49 counts: half of the box would leave no place for a split. Never
#: measured.
LEAF_MARGIN: Final = 0.01
WIDEST_LEAF_MARGIN: Final = 0.49
#: Smallest leaves among which the evidence chooses, and trials up to which no split at all is a choice: its cost grows
#: with their cube. surehold campaign run partition-rule
LEAF_SIZES: Final = (8, 10, 15, 20, 30, 50)
UNDIVIDED: Final = 300
#: Sweeps before the first particle of the local-global process, whose chain starts at no mode. Never measured.
LOCAL_GLOBAL_BURN_IN: Final = 5

# --- the trust region, an option --------------------------------------------------------------------------------------

#: First, largest and smallest side of the box, in box widths; successes in a row after which it doubles, failures (d
#: where that is more) after which it halves; and the share of |best value| by which a trial must exceed it to count as
#: a success: the values of Eriksson et al. 2019 (TuRBO-1), for one trial at a time. Never measured here.
TRUST_FIRST: Final = 0.8
TRUST_LARGEST: Final = 1.6
TRUST_SMALLEST: Final = 0.5**7
TRUST_SUCCESSES: Final = 3
TRUST_FAILURES: Final = 4
TRUST_IMPROVEMENT: Final = 1e-3

# --- the thesis presets -----------------------------------------------------------------------------------------------

#: Evaluations of DIRECT for each variable, and the divisor that gives those of the polish along the gradient, which the
#: thesis does not describe: as in the original program. Never measured.
THESIS_EVALUATIONS: Final = 500
THESIS_POLISH_DIVISOR: Final = 10
#: Starts around the incumbent, and their standard deviation in box widths: as in the original program. Never measured.
THESIS_LOCAL_TRIALS: Final = 5
THESIS_LOCAL_SCALE: Final = 0.05
#: How often a trial may be repeated where observations are exact. The original repeats a point twenty times before it
#: jumps to a random one, which cost it whole runs. Never measured against other numbers.
THESIS_REPEATS: Final = 2

# --- the record of trials ---------------------------------------------------------------------------------------------

#: A rig rounds to its resolution: what is told within so many box widths, in every variable, of a pending trial is it.
#: Never measured.
ROUNDED: Final = 0.01
#: Box widths, in some variable, between trials that are under way at the same time: robots at one place at one time
#: learn one thing. Never measured.
SEPARATION: Final = 1e-3
#: Ranges of all other values by which an outlier lies below them. Wild readings of -30 and -100 among values of [0, 1]
#: spoil no run of 20 with it; a smaller one would take true low values for outliers. Never measured otherwise.
OUTLIER_DISTANCE: Final = 5.0

#: Trials of which it is judged whether deep values are compressed in the search; of fewer the median says little. Never
#: measured on its own; the whole: python -m benchmarks.smooth_regret.
LOW_TAIL_FROM: Final = 7

# --- constraints ------------------------------------------------------------------------------------------------------

#: Points of a Sobol sequence tested for the first allowed inputs: at most so many where all constraints are linear, and
#: where a user's function has to be called for each; and allowed ones after which the search ends. A region of one part
#: in 100,000 of the box, or in 16,000, is found by chance in two of three cases. Never measured.
REGION_SEARCH: Final = 2**17
REGION_SEARCH_CALLS: Final = 2**14
REGION_KNOWN: Final = 256
#: While nothing feasible is known, trials at once keep so many box widths apart: the standard deviation of the hole
#: that a trial under way tears into the probability of being feasible. Never measured.
APART: Final = 0.1
#: Probability with which an answer has to keep the limits of further outputs, where `Optimizer(feasible=)` says
#: nothing. Customary. Never measured.
FEASIBLE: Final = 0.95
#: Random allowed points among which an initial design replaces those of its points that are not. Never measured.
REGION_POOL: Final = 256
#: Length-scales, over sqrt(d) box widths, and signal variances of the model of where trials fail, all combined and
#: weighed by their evidence. The largest variance is an edge without a gradual passage: with it the search comes within
#: 0.021 of an optimum on the edge of failure, without it 0.053 (medians, 6 training seeds).
#: python -m benchmarks.failures
FAILURE_LENGTHS: Final = (0.08, 0.16, 0.32, 0.64, 1.28)
FAILURE_SIGNALS: Final = (1.0, 10.0, 100.0, 1e3, 1e5)
#: The criterion is multiplied by this power of the probability to succeed. With the first power trials far out in what
#: fails are worth their small chance again and again: on the edge of failure 41.6 evaluations to 1 %, with the second
#: 21.8 (5 training seeds). python -m benchmarks.failures
FAILURE_POWER: Final = 2.0
#: Trials up to which failures are modelled where nothing is said: the model takes 0.8 s at 200 and 3 s from 400 on
#: (CPU, three variables); beyond, a failed trial counts as the lowest value. Timed once; otherwise never measured.
FAILURES_MODELLED: Final = 200
#: Under input noise a trial may become the answer where executions succeed with this share of the best probability
#: among trials, if they do not with `FEASIBLE`: few failures leave the model unsure everywhere. Never measured.
SUCCESS_SHARE: Final = 0.9

# --- success and failure ----------------------------------------------------------------------------------------------

#: Prior of the latent function behind success and failure, in probit units: mean and standard deviation of the
#: logarithm of its variance, and variance of its constant mean. Half of all places succeed by 16 to 84 % or are
#: clearer. Never measured against others.
SUCCESS_SIGNAL_PRIOR: Final = (0.7, 0.7)
SUCCESS_MEAN_VARIANCE: Final = 1.0
#: Successes and failures that the beta process counts before any trial: the uniform distribution. Never measured
#: against others.
BETA_PRIOR: Final = (1.0, 1.0)
#: States of the slice sampler that are dropped first: it starts at the prior, not at a mode. Never measured.
SUCCESS_BURN_IN: Final = 20
#: Joint draws by which the spread of a share of successes under the input noise is known. Never measured.
SUCCESS_DRAWS: Final = 64
#: Places that the probit model takes at most: beyond, trials near each other count as several executions at their mean,
#: and hyperparameters are learnt from `MANY_LEARNT` of them. An ask of 800 trials takes as long as one of 400.
#: python -m benchmarks.success_outcomes --problems "" --methods success --sizes 100,400,800,10000
SUCCESS_PLACES: Final = 400
#: A place whose probability of success is known to this standard deviation is settled: it is not tried again as long
#: as there are others. After the estimation bounds of Tesch et al. 2013. Never measured against others.
SETTLED: Final = 0.02
