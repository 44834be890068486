"""Answers among the inputs that were tried and anywhere in the box: `python -m benchmarks.answers [part ...]`.

    family      regret [%] after half and all of the trials on landscapes of `benchmarks.generated_family`, training
                set: one to three variables (seeds 0 to 119), four to six (0 to 79)
    polynomial  regret of the polynomial of Bertsimas (`nes-polynomial`: noise 0.6, 55 trials), seeds 100 to 123; the
                optimizer takes the function to go on outside the box (default), or is told that inputs are clipped
    grasps      mug, bottle, glass and drill in two variables, 100 trials of which 40 are initial, noise of 3 % of the
                box, seeds 30 to 35: mean of 1,000 executions with the noise and of the worst tenth, by epsilon
    worst       the lowest outcome among the perturbed points, which risk="worst" maximizes, on RKHS and GM (60 trials,
                seeds 100 to 109), and the highest one on a grid

Both answers are of the same trials. Printed are the means with standard errors, the difference paired by run, and how
many runs end within 1 %.
"""

import numpy as np
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.arguments import chosen
from benchmarks.generated_landscapes import BUDGETS, TRAINING, landscape
from benchmarks.robust_grasps import METHODS, NOISE, REQUERIES, TAIL, searched
from benchmarks.search_variants import begun, regret
from surehold.optimization.noise.perturbations import Perturbations
from surehold.problems.named import named_function, robust_problem

WHERE = ("observed", "box")
GRID = {1: 8001, 2: 201}  # points a side


def compared(label, tried, anywhere, enough=None, worse=1.0):
    """Print two rows of numbers, one a run; `worse` is -1 where higher numbers are better."""
    tried, anywhere = np.array(tried), np.array(anywhere)
    gaps = anywhere - tried
    cells = [f"{v.mean():.4g} ({v.std(ddof=1) / len(v) ** 0.5:.2g})" for v in (tried, anywhere, gaps)]
    within = "" if enough is None else f"; within 1 %: {(tried <= enough).sum()}, {(anywhere <= enough).sum()}"
    print(
        f"{label}: {len(tried)} runs; tried {cells[0]}, in the box {cells[1]}, difference {cells[2]}, "
        f"at worst {worse * (worse * gaps).max():+.3g}{within}",
        flush=True,
    )


def family():
    for first, last, dimensions in ((0, 120, (1, 2, 3)), (0, 80, (4, 5, 6))):
        rows = {(share, where): [] for share in ("half", "all") for where in WHERE}
        for seed in TRAINING[first:last]:
            if landscape(seed).dimension not in dimensions:
                continue
            problem, design, (optimizer,) = begun(seed, "two_scales")
            budget = BUDGETS[problem.dimension]
            for i in range(budget):
                x = np.clip(design.pop(0) if design else optimizer.ask(), 0.0, 1.0)
                optimizer.tell(x, problem(x))
                if i + 1 in (budget // 2, budget):
                    for where in WHERE:
                        answer = optimizer.recommend(where).x
                        rows["all" if i + 1 == budget else "half", where].append(regret(problem, answer))
        for share in ("half", "all"):
            compared(f"{dimensions} variables, {share} of the trials", *(rows[share, where] for where in WHERE), 1.0)


def polynomial():
    problem = robust_problem("nes-polynomial")
    for border in ("extend", "clip"):
        rows = {where: [] for where in WHERE}
        for seed in range(100, 124):
            optimizer = sh.Optimizer(
                problem.function.box, input_noise=problem.noise, n_initial=problem.initial, seed=seed, border=border
            )
            for _ in range(problem.trials):
                x = optimizer.ask()
                optimizer.tell(x, problem.function(x))
            for where in WHERE:
                answer = optimizer.recommend(where).x
                rows[where].append(problem.optimum.value - float(problem.value(answer)[0]))
        compared(f"polynomial, border {border}", *(rows[where] for where in WHERE), 0.01 * abs(problem.optimum.value))


def grasps():
    for name in ("mug", "bottle", "glass", "drill"):
        told, rated = (sh.problems.GraspProblem(name, variables=("dx", "dy"), quality=q) for q in ("", "epsilon"))
        rows = {(score, where): [] for score in ("mean", "worst tenth") for where in WHERE}
        for seed in range(30, 36):
            optimizer = searched(told, 100, 40, seed, METHODS["robust"])
            for where in WHERE:
                x = optimizer.recommend(where).x
                values = np.sort(sh.problems.robust_score(rated, x, NOISE, n=REQUERIES, seed=12345).values)
                rows["mean", where].append(values.mean())
                rows["worst tenth", where].append(values[: round(TAIL * REQUERIES)].mean())
        for score in ("mean", "worst tenth"):
            compared(f"{name}, {score}", *(rows[score, where] for where in WHERE), worse=-1.0)


def worst():
    for name, noise in (("rkhs", 0.01), ("rkhs", 0.02), ("gm", 0.05)):
        function, strays = named_function(name), sh.InputNoise.unit(noise)
        box = function.box
        points = Perturbations.of(strays, box, "quasi_monte_carlo")

        def lowest(u, function=function, points=points, box=box):
            return function(box.from_unit(points.around(u).reshape(-1, box.dimension))).reshape(len(u), -1).min(axis=1)

        side = np.linspace(0.0, 1.0, GRID[box.dimension])
        grid = np.stack(np.meshgrid(*[side] * box.dimension), axis=-1).reshape(-1, box.dimension)
        rows = {where: [] for where in WHERE}
        for seed in range(100, 110):
            result = sh.maximize(function, box, 60, input_noise=strays, risk="worst", seed=seed)
            for where in WHERE:
                rows[where].append(lowest(box.to_unit(result.optimizer.recommend(where).x)[None])[0])
        best = f"best on a grid {lowest(grid).max():.4g}"
        compared(f"{name}, noise {noise}, {best}", *(rows[where] for where in WHERE), worse=-1.0)


if __name__ == "__main__":
    parts = {"family": family, "polynomial": polynomial, "grasps": grasps, "worst": worst}
    with threadpool_limits(1):
        for part in chosen(__doc__, parts, name="part"):
            parts[part]()
