"""Shapes from half views and from touch: `python -m benchmarks.unknown_shapes WHAT --rows FILE`.

WHAT is one of:
shape    distance of the true surface to the one believed [mm], mean and 95 %, of half views of 500, 2,000 and 5,000
         points with 0, 1 and 3 mm noise, and the share of true surface points in the believed 95 % interval, of what
         the camera saw and of what it did not, and the share of the believed surface in it. `--training` takes shapes
         that are not the shipped ones: the spread of mirrored shapes (surehold.grasping.shape.completion.SPREAD) was
         chosen on these
grasp    a grasp is planned on a half view (1,000 points, 1 mm): on 8 draws of the shape, on the mean surface alone, and
         on the cloud mirrored and believed; then it is queried 200 times on the true shape under input noise
draws    what a grasp planned on the mean surface is worth: in truth, there, and on draws of a process of that spread
         and length (surehold.grasping.shape.completion.DRAWN was chosen so on the training shapes); how far normals of
         draws and of the mean surface are off [degrees, medians]; and the logarithm of the joint density of 80 hidden
         places and their normals, for each place
touched  from a box, after 30 touches at random: the share of true surface points in the believed 95 % interval, of
         those within 10 mm of a contact and turned as it is, to 60 degrees (`touched`), of those as near that are
         turned farther, as the inner wall of a vessel is (`behind`), and of the others (`far`), and the share of the
         believed surface
explore  from a box: the true worth of the answer after 10, 20, 40, 50 and 80 trials
search   the same of optimization that learns no shape, and after 100 trials
guess    the same, of which two of three initial trials keep the default pose (`GraspProblem.guess`)
time     of an update of the shape in an exploration that has made 200 contacts

Every finished case is a line of the rows' file: a benchmark that is stopped goes on where it was. Cases are numbered by
`--views`, from `--first`; cameras look from the side or from above, 5 to 50 degrees.
"""

import argparse
import json
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial import KDTree
from threadpoolctl import threadpool_limits

import surehold as sh
from surehold.grasping.object.distance_field import distance_field_of
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.shipped import OBJECTS, shipped_object
from surehold.grasping.object.solids import RevolvedProfile, RoundedBox, triangles
from surehold.grasping.shape.completion import DRAWN, SPREAD, belief_of_cloud
from surehold.grasping.shape.implicit_surface import Observations
from surehold.grasping.shape.kernel import covariance
from surehold.grasping.shape.point_cloud import cleaned
from surehold.grasping.shape.views import camera_towards, half_view, hidden_mask, surface_points
from surehold.problems.grasp.default_poses import default_facet
from surehold.problems.grasp.exploration import Exploration, belief_of_box
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.grasp.touch import touch_trial
from surehold.problems.perturbation import perturbed_points

NOISE = sh.InputNoise.unit(0.03)
SEVEN = ("dx", "dy", "dz", "rx", "ry", "rz", "s1")
TRIALS, INITIAL = 30, 15
READ_OFF = (10, 20, 40, 50, 80)  # trials after which an exploration is asked for its answer


def solid_object(name, solids):
    vertices, faces, volume, center = triangles(solids)
    return GraspObject(name, vertices, faces, 1000.0 * volume, center, 0.5, solids)


def training_objects():
    """Return a carton, a can on a foot, a hammer, a jar and a bowl."""
    carton = RoundedBox((0.0, 0.0, 0.07), (0.045, 0.03, 0.07), 0.003)
    corners = ((0.0, 0.002), (0.034, 0.002), (0.034, 0.012), (0.02, 0.03), (0.03, 0.05), (0.03, 0.11), (0.0, 0.11))
    handle = RevolvedProfile(((0.0, 0.0), (0.016, 0.0), (0.012, 0.14), (0.0, 0.14)), 0.002)
    head = RoundedBox((0.0, 0.0, 0.15), (0.05, 0.017, 0.017), 0.004)
    wall = ((0.0, 0.0), (0.04, 0.0), (0.04, 0.09), (0.034, 0.09), (0.034, 0.006), (0.0, 0.006))
    angles = np.linspace(0.0, 0.475 * np.pi, 10)
    outer = [(0.07 * np.sin(a), 0.07 - 0.07 * np.cos(a)) for a in angles]
    inner = [(0.066 * np.sin(a), 0.07 - 0.066 * np.cos(a)) for a in angles[::-1]]
    return {
        "jar": solid_object("jar", (RevolvedProfile(wall, 0.001),)),
        "bowl": solid_object("bowl", (RevolvedProfile((*outer, *inner), 0.0008),)),
        "carton": solid_object("carton", (carton,)),
        "can": solid_object("can", (RevolvedProfile(corners, 0.002),)),
        "hammer": solid_object("hammer", (handle, head)),
    }


def view_of(obj, view, n, noise):
    rng = np.random.default_rng([view, 7])
    camera = camera_towards(obj, rng.uniform(0.0, 2.0 * np.pi), np.radians(rng.uniform(5.0, 50.0)))
    return camera, cleaned(half_view(obj, camera, n, noise, rng), camera=camera)


def shape(objects, args):
    for name, obj in objects.items():
        field = distance_field_of(obj)
        for n in args.points:
            for noise in args.noises:
                for view in range(args.first, args.first + args.views):
                    key = {
                        "object": name,
                        "n": n,
                        "noise": noise,
                        "view": view,
                        "spread": args.spread,
                        "length": args.length,
                    }
                    if known(args, key):
                        continue
                    camera, cloud = view_of(obj, view, n, 1e-3 * noise)
                    started = time.process_time()
                    belief = belief_of_cloud(cloud, spread=(args.spread, args.length))
                    mean, surface = belief.mean_object(), belief.surface
                    corners = mean.vertices[np.random.default_rng(0).integers(len(mean.vertices), size=1000)]
                    seconds = time.process_time() - started
                    places = surface_points(obj, 1000, np.random.default_rng(0))[0]
                    hidden = hidden_mask(field, places, camera)
                    away = 1e3 * np.abs(mean.distances.distance(places))
                    inside = np.abs(belief.surface.value(places)) < 1.96 * belief.surface.deviation(places)
                    row = {
                        "mean": away.mean(),
                        "tail": np.quantile(away, 0.95),
                        "seen": away[~hidden].mean(),
                        "hidden": away[hidden].mean(),
                        "covered seen": inside[~hidden].mean(),
                        "covered hidden": inside[hidden].mean(),
                        "covered believed": np.mean(
                            np.abs(field.distance(corners)) < 1.96 * surface.deviation(corners)
                        ),
                        "cpu": seconds,
                    }
                    write(args, key, row)
    table(args, ("object", "n", "noise", "spread", "length"))


def grasp(objects, args):
    for view in range(args.first, args.first + args.views):
        for name, obj in objects.items():
            key = {"object": name, "view": view}
            if known(args, key):
                continue
            _, cloud = view_of(obj, view, 1000, 0.001)
            belief = belief_of_cloud(cloud, name=name, mass=obj.mass, friction=obj.friction, cell=0.004)
            mean, *draws = belief.objects(8, np.random.default_rng(0))
            surface = belief.surface
            trusted = belief if surface.prior is surface.first else replace(belief, surface=surface.prior)
            problem = GraspProblem(mean, default_facet(obj), plan="shapes")
            real = problem.on(obj)
            row = {}
            for method, body in (
                ("robust", replace(mean, draws=tuple(draws))),
                ("mean surface", mean),
                ("mirrored", trusted.mean_object()),
            ):
                planned = problem.on(body)
                result = sh.maximize(planned, problem.box, TRIALS, input_noise=NOISE, n_initial=INITIAL, seed=view)
                row[method] = sh.problems.robust_score(real, result.recommendation.x, NOISE, n=200, seed=1).mean
            write(args, key, row)
    table(args, ("object",))
    rows = read(args)
    for other in ("mean surface", "mirrored"):
        gain = np.array([row["robust"] - row[other] for row in rows])
        print(f"robust - {other}: {gain.mean():+.4f} +- {gain.std(ddof=1) / np.sqrt(len(gain)):.4f}, {len(gain)} views")


def drawn(objects, args):
    for name, obj in objects.items():
        field = distance_field_of(obj)
        for view in range(args.first, args.first + args.views):
            key = {"object": name, "view": view, "spread": args.spread, "length": args.length}
            if known(args, key):
                continue
            camera, cloud = view_of(obj, view, 1000, 0.001)
            process = (args.spread, args.length)
            belief = belief_of_cloud(cloud, mass=obj.mass, friction=obj.friction, cell=0.004, drawn=process)
            mean, *draws = belief.objects(8, np.random.default_rng(0))
            row = believed(mean, draws, obj, view)
            for which, bodies in (("mean", [mean]), ("draws", draws)):
                off = [normals_off(body, field, camera) for body in bodies]
                row[f"{which}, seen"], row[f"{which}, hidden"] = np.mean(off, axis=0)
            places, normals = surface_points(obj, 1500, np.random.default_rng(0))
            hidden = hidden_mask(field, places, camera)
            row["density"] = joint_density(belief.shapes, *farthest(places[hidden], normals[hidden], 80))
            write(args, key, row)
    table(args, ("object", "spread", "length"))


def believed(mean, draws, obj, view):
    """Return what a grasp planned on the mean shape is worth under input noise: in truth, on that shape, on draws."""
    problem = GraspProblem(mean, default_facet(obj), plan="mean")
    x = sh.maximize(problem, problem.box, TRIALS, input_noise=NOISE, n_initial=INITIAL, seed=view).recommendation.x
    points = perturbed_points(x, problem.box, NOISE, 32, seed=3)
    true, on_mean, *on_draws = (
        np.mean([max(problem.on(body).grasp(point).quality, 0.0) for point in points]) for body in (obj, mean, *draws)
    )
    return {"true": true, "on the mean": on_mean, "on draws": np.mean(on_draws), "apart": np.std(on_draws)}


def normals_off(body, field, camera):
    """Return the medians of the angles between a body's normals and those of the true surface beside [degrees]."""
    corners = body.vertices[body.faces]
    made = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    places = corners.mean(axis=1)
    true = field.gradient(places)
    cosine = np.sum(made * true, axis=1) / (np.linalg.norm(made, axis=1) * np.linalg.norm(true, axis=1) + 1e-12)
    angles = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    hidden = hidden_mask(field, places - field.distance(places)[:, None] * true, camera)
    return np.median(angles[~hidden]), np.median(angles[hidden])


def farthest(places, normals, n):
    chosen = [0]
    while len(chosen) < n:
        gaps = np.linalg.norm(places[:, None] - places[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(gaps)))
    return places[chosen], normals[chosen]


def joint_density(surface, places, normals):
    """Return log p(f = 0 and gradient = normal at all places | observations) / places; felt to 0.5 mm and 0.15."""
    told, n = surface.observations, len(places)
    both = told + Observations(places, np.zeros(n), np.full(n, 5e-4), places, normals, np.full(n, 0.15))
    gram = covariance(both.points, both.slope_points, surface.std, surface.length)
    gram += np.diag(np.concatenate([both.noise, np.repeat(both.slope_noise, 3)]) ** 2 + (1e-6 * surface.std) ** 2)
    last = np.concatenate([np.arange(n) + len(told.points), np.arange(len(gram) - 3 * n, len(gram))])
    first = np.setdiff1d(np.arange(len(gram)), last)
    half = solve_triangular(np.linalg.cholesky(gram[np.ix_(first, first)]), gram[np.ix_(first, last)], lower=True)
    factor = np.linalg.cholesky(gram[np.ix_(last, last)] - half.T @ half)
    away = np.concatenate([-surface.value(places), (normals - surface.gradient(places)).ravel()])
    whitened = solve_triangular(factor, away, lower=True)
    return -(0.5 * whitened @ whitened + np.log(np.diag(factor)).sum() + 0.5 * len(away) * np.log(2.0 * np.pi)) / n


def touched(objects, args):
    for key, problem, belief in explored(objects, args):
        obj, rng = objects[key["object"]], np.random.default_rng([key["seed"], 11])
        run, real = Exploration(problem, belief, NOISE, seed=key["seed"]), problem.on(objects[key["object"]])
        for unit in rng.random((30, problem.box.dimension)):
            x = problem.box.from_unit(unit[None])[0]
            touch = touch_trial(real.simulator, problem.pose(x), problem.posture(x))
            run.tell(x, touch.grasp.quality, touch.observations)
        surface, mean = run.belief.surface, run.belief.mean_object()
        places, normals = surface_points(obj, 3000, np.random.default_rng(0))
        inside = np.abs(surface.value(places)) < 1.96 * surface.deviation(places)
        gap, contact = KDTree(surface.observations.slope_points).query(places)
        alike = np.sum(normals * surface.observations.slopes[contact], axis=1) > 0.5
        corners = surface_points(mean, 1000, np.random.default_rng(0))[0]
        off = np.abs(distance_field_of(obj).distance(corners))
        row = {
            "contacts": len(surface.observations.slopes),
            "touched": inside[(gap < 0.01) & alike].mean(),
            "behind": inside[(gap < 0.01) & ~alike].mean(),
            "far": inside[gap >= 0.01].mean(),
            "all": inside.mean(),
            "believed": np.mean(off < 1.96 * surface.deviation(corners)),
        }
        write(args, key, row)
    table(args, ("object",))


def explore(objects, args):
    for key, problem, belief in explored(objects, args):
        run = Exploration(problem, belief, NOISE, seed=key["seed"])
        real = problem.on(objects[key["object"]])
        row, cpu = {}, 0.0
        for k in range(args.until):
            started = time.process_time()
            x = run.ask()
            touch = touch_trial(real.simulator, problem.pose(x), problem.posture(x))
            run.tell(x, touch.grasp.quality, touch.observations)
            cpu += time.process_time() - started
            if k + 1 in READ_OFF:
                answer = run.recommend()
                row[f"explored {k + 1}"], row[f"believed {k + 1}"] = worth(real, answer.x), answer.mean
        write(args, key, row | {"contacts": len(run.belief.surface.observations.slopes), "cpu": cpu})
    table(args, ("object",))


def search(objects, args, guess=False):
    for key, problem, _ in explored(objects, args):
        real = problem.on(objects[key["object"]])
        known_before = problem.guess if guess else None
        optimizer = sh.Optimizer(problem.box, input_noise=NOISE, seed=key["seed"], n_initial=20, guess=known_before)
        row = {}
        for k in range(100):
            x = optimizer.ask()
            optimizer.tell(x, real(x))
            if k + 1 in (*READ_OFF, 100):
                row[f"no shape {k + 1}"] = worth(real, optimizer.recommend().x)
        write(args, key, row)
    table(args, ("object",))


def explored(objects, args):
    """Yield the cases that are not done: what names them, the problem in its seven variables, and a box."""
    for seed in range(args.first, args.first + args.views):
        for name, obj in objects.items():
            key = {"object": name, "seed": seed}
            if not known(args, key):
                belief = belief_of_box(obj)
                yield key, GraspProblem(belief.mean_object(), variables=SEVEN, quality="epsilon"), belief


def worth(real, x):
    return sh.problems.robust_score(real, x, NOISE, n=200, seed=1).mean


def timed(objects, args):
    for name, obj in objects.items():
        belief = belief_of_box(obj)
        problem = GraspProblem(belief.mean_object(), variables=SEVEN, quality="epsilon")
        real, run = problem.on(obj), Exploration(problem, belief, NOISE, seed=args.first)
        while len(run.belief.surface.observations.slopes) < 200:
            x = run.ask()
            touch = touch_trial(real.simulator, problem.pose(x), problem.posture(x))
            run.tell(x, touch.grasp.quality, touch.observations)
        times = []
        for _ in range(15):
            started = time.process_time()
            run.tell(x, 0.0, Observations())
            learnt = time.process_time()
            run.belief.mean_object()
            times.append((1e3 * (learnt - started), 1e3 * (time.process_time() - learnt)))
        (surface, shape), known = np.median(times, axis=0), run.belief.surface.observations
        memory = (run.belief.surface.factor.nbytes + run.belief.mean_object().distances.nodes.nbytes) / 2**20
        print(
            f"{name}: {len(run.X) - 15} touches, {len(known.slopes)} contacts, {len(known.points)} values, "
            f"{np.prod(run.belief.grid.shape)} nodes: surface {surface:.0f} ms, distances and mesh {shape:.0f} ms, "
            f"together {surface + shape:.0f} ms of CPU; factor and distances {memory:.0f} MiB"
        )


def read(args):
    return [json.loads(line) for line in Path(args.rows).read_text().splitlines()] if Path(args.rows).exists() else []


def known(args, key):
    return any(all(row.get(k) == v for k, v in key.items()) for row in read(args))


def write(args, key, row):
    with Path(args.rows).open("a") as file:
        file.write(json.dumps(key | {name: round(float(value), 5) for name, value in row.items()}) + "\n")


def table(args, names):
    rows = read(args)
    for group in dict.fromkeys(tuple(row[name] for name in names) for row in rows):
        mine = [row for row in rows if tuple(row[name] for name in names) == group]
        numbers = [key for key in mine[0] if key not in (*names, "view", "seed")]
        shown = []
        for key in numbers:
            values = np.array([row[key] for row in mine])
            error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
            shown.append(f"{key} {values.mean():.3g} +- {error:.2g}")
        print(*group, f"({len(mine)})", ", ".join(shown))


RUN = {
    "shape": shape,
    "grasp": grasp,
    "draws": drawn,
    "touched": touched,
    "explore": explore,
    "search": search,
    "guess": partial(search, guess=True),
    "time": timed,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=tuple(RUN))
    parser.add_argument("--rows", default="/dev/null")
    parser.add_argument("--views", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--objects", default=",".join(OBJECTS))
    parser.add_argument("--until", type=int, default=READ_OFF[-1], help="trials of an exploration")
    parser.add_argument("--training", action="store_true")
    parser.add_argument("--points", type=int, nargs="+", default=[500, 2000, 5000])
    parser.add_argument("--noises", type=float, nargs="+", default=[0.0, 1.0, 3.0])
    parser.add_argument("--spread", type=float, help="of the surface; for draws, of their process")
    parser.add_argument("--length", type=float)
    args = parser.parse_args()
    usual = DRAWN if args.what == "draws" else SPREAD
    args.spread, args.length = args.spread or usual[0], args.length or usual[1]
    objects = own = training_objects()
    if not args.training:
        objects = {name: own[name] if name in own else shipped_object(name) for name in args.objects.split(",")}
    with threadpool_limits(1):
        RUN[args.what](objects, args)


if __name__ == "__main__":
    main()
