"""`surehold grasp --cloud` and `surehold explore`: what a user types and gets."""

import asyncio
import json
import sys

import numpy as np
import pytest

from surehold.cli import run
from surehold.errors import InputError
from surehold.grasping.object.distance_field import distance_field_of
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.shape.views import camera_towards, half_view
from tests.grasping.hand_models import three_fingers


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bottle = shipped_object("bottle")
    camera = camera_towards(bottle, 0.5, 0.3)
    points = half_view(bottle, camera, 300, 0.001, np.random.default_rng(0))
    np.savetxt("bottle.xyz", 1000.0 * points)
    np.savez("bottle.npz", points=points, camera=camera)
    return tmp_path


def surehold(line):
    return run(line.split())


def test_a_grasp_of_a_cloud(here, capsys):
    line = "grasp --cloud bottle.npz --trials 6 --initial 5 --shapes 2 --noise 0.03 --out out"
    assert surehold(line) in (0, 3)  # 3: a grasp may be none in so few trials
    out = capsys.readouterr().out
    assert "bottle.npz: 300 points" in out
    assert "lost to the unknown shape" in out
    result = json.loads((here / "out" / "result.json").read_text())
    assert result["settings"]["object"] == "bottle"
    assert result["settings"]["quality"] == "epsilon"
    page = (here / "out" / "report.html").read_text()
    assert "surface, known" in page
    assert "surface, unknown" in page
    assert "quality (epsilon) over 2 shapes, hit exactly" in page


def test_touches_move_the_surface_of_a_cloud(here):
    from surehold.problems.grasp.from_cloud import belief_of_file
    from surehold.problems.grasp.options import checked_words

    far = {"point": [-0.03, -0.01, 0.05], "normal": [-0.95, -0.3, 0.0]}  # on the side that was not seen
    (here / "touches.json").write_text(json.dumps({"contacts": [far]}))
    place = np.array([far["point"]])
    words = checked_words({"object": "", "cloud": "bottle.npz"})
    plain, touched = (belief_of_file({**words, "contacts": c})[0].surface for c in ("", "touches.json"))
    assert abs(plain.value(place)[0]) > 0.001
    assert abs(touched.value(place)[0]) < 0.2 * abs(plain.value(place)[0])
    assert touched.deviation(place)[0] < 0.001 < plain.deviation(place)[0]
    (here / "touches.json").write_text(json.dumps({"contacts": [{"point": [30.0, 0, 50.0], "normal": [1, 0, 0]}]}))
    with pytest.raises(InputError, match="give meters"):
        belief_of_file({**words, "contacts": "touches.json"})


def test_an_exploration(here, capsys):
    assert surehold("explore bottle --trials 2 --out touched") == 0
    out = capsys.readouterr().out
    assert "After 2 touches" in out
    assert "The grasp it ends with: palm at (" in " ".join(out.split())
    found = json.loads((here / "touched" / "explore.json").read_text())
    assert len(found["trials"]["quality"]) == 2
    assert [row["touches"] for row in found["after"]] == ["0", "2"]
    assert found["after"][0]["best trial"] == "none yet"
    page = (here / "touched" / "explore.html").read_text()
    assert "true shape" in page
    assert "The grasp it ends with: palm at (" in page
    assert "What the touches taught" in page
    assert (here / "touched" / "shape.png").read_bytes().startswith(b"\x89PNG")


def test_an_exploration_without_a_grasp_that_holds_says_so(here, capsys):
    assert surehold("explore drill --trials 1 --seed 1 --out none") == 3
    assert "No grasp that holds on the true shape was found; give more --trials." in capsys.readouterr().out
    assert (here / "none" / "explore.html").exists()
    assert surehold("explore drill --trials 1 --seed 1 --goal shape --out shape") == 0


def test_no_exploration_replaces_another_and_one_that_cannot_start_leaves_nothing(here, capsys, monkeypatch):
    for _ in range(2):
        assert surehold("explore bottle --trials 1") == 0
    folders = ["explore-bottle-seed0", "explore-bottle-seed0-2"]
    assert sorted(path.name for path in (here / "runs").iterdir()) == folders
    first, second = (json.loads((here / "runs" / name / "explore.json").read_text()) for name in folders)
    assert first["trials"] == second["trials"]
    monkeypatch.setitem(sys.modules, "igl", None)
    assert surehold("explore bottle --trials 1") == 2
    assert "surehold[mesh]" in capsys.readouterr().err
    assert len(list((here / "runs").iterdir())) == 2


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("grasp", "no object is given"),
        ("grasp mug --cloud bottle.npz", "both object 'mug' and a cloud"),
        ("grasp mug --camera 0,0,0", "camera is for point clouds"),
        ("grasp mug --shapes 4", "shapes is for point clouds"),
        ("grasp mug --plan mean", "plan is for point clouds"),
        ("explore mug --plan mean", "No such option: --plan"),
        ("explore mug --start view --prior box", "prior is for point clouds"),
        ("grasp --cloud bottle.xyz", "--unit mm"),
        ("grasp --cloud bottle.xyz --unit mm --camera 0,0", "three numbers"),
        ("grasp --cloud bottle.xyz --unit furlong", "furlong"),
        ("grasp --cloud bottle.npz --normals", "holds no normals"),
        ("grasp --cloud bottle.npz --prior bx", "did you mean 'box'"),
        ("grasp --cloud bottle.npz --cloud-noise 1", "standard deviation above 0"),
        ("grasp --cloud bottle.npz --shapes -1", "shapes are -1"),
        ("grasp --cloud none.ply", "cannot be read"),
        ("explore mug --goal fun", "goal 'fun' is unknown"),
        ("explore mug --start half", "start 'half' is unknown"),
        ("explore mug --trials 0", "--trials is 0"),
        ("explore mug --seed -3", "--seed is -3; give a whole number of 0 or more."),
        ("explore mug --storage q.log", "--storage q.log is given, but no --study"),
        ("explore mug --noise none", "--noise is none"),
        ("explore mug --cloud bottle.npz", "leave --cloud out"),
        ("explore", "no object is given"),
        ("explore --study cup", "takes one of --box x,y,z and --cloud"),
        ("explore mug --box 0.1,0.1,0.1 --study cup", "and no object"),
        ("explore --box 0.1,0.1 --study cup", "three edges"),
        ("explore --box 80,60,120 --study cup", "in meters"),
        ("explore --box 0.1,0.1,0.1 --study cup --trials 7", "--trials is of an exploration in simulation"),
        ("explore --box 0.1,0.1,0.1 --study cup --start view", "--start is of an exploration in simulation"),
    ],
)
def test_bad_input_is_one_line(line, said, capsys):
    assert surehold(line) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def nothing(points, camera):
    return points[:0]


def not_numbers(points, camera):
    return np.full_like(points, np.nan)


def on_a_line(points, camera):
    return np.linspace(0.0, 0.1, 100)[:, None] * [1.0, 0.5, 0.0]


def two_objects(points, camera):
    return np.vstack([points, points + np.array([0.3, 0.0, 0.0])])


def millimeters(points, camera):
    return 1000.0 * points


def of_the_hand(points, camera):
    """The object, and more points that are a third as far from the camera."""
    return np.vstack([camera + 0.35 * (points - camera), points[:240]])


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (nothing, "holds no points; give a cloud"),
        (not_numbers, "has 0 finite points; give 20 or more"),
        (on_a_line, "a surface is needed: check the columns"),
        (two_objects, "give one of them"),
        (millimeters, "unit of its numbers: --unit mm"),
        (of_the_hand, "take out those of the hand that carries the camera"),
    ],
)
def test_a_cloud_of_which_nothing_can_be_made_is_refused_in_one_line(here, capsys, made, said):
    with np.load("bottle.npz") as file:
        np.savez("bad.npz", points=made(file["points"], file["camera"]), camera=file["camera"])
    assert surehold("grasp --cloud bad.npz --out out") == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (here / "out").exists()


def test_contacts_that_contradict_a_cloud_or_themselves_are_refused(here, capsys):
    def told(rows):
        (here / "touched.json").write_text(json.dumps({"contacts": rows}))
        assert surehold("grasp --cloud bottle.npz --contacts touched.json") == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        return error

    with np.load("bottle.npz") as file:
        place = file["points"][0].tolist()
    assert "normals 180 degrees" in told([{"point": place, "normal": [v, 0, 0]} for v in (1, -1)])
    assert "mm off the surface" in told([{"point": [0.0, 0.0, 0.6], "normal": [0, 0, 1]}])
    bottle = shipped_object("bottle")
    seen = camera_towards(bottle, 0.5, 0.3, 0.02)  # beside its axis, on the camera's side
    field = distance_field_of(bottle)
    outward = field.gradient(seen[None])[0]
    seen = seen - field.distance(seen[None])[0] * outward
    contact = {"point": seen.tolist(), "normal": (-outward).tolist()}
    assert "its normal points into the object" in told([contact])


def test_a_robot_tells_contacts_and_the_next_trial_follows_from_them(here, capsys):
    made = surehold("explore --box 0.06,0.06,0.2 --study cup --variables dx,dy --facet right-front --seed 3")
    assert made == 0
    assert "study tell cup" in capsys.readouterr().out

    def asked():
        capsys.readouterr()
        assert surehold("study ask cup --worker arm --json") == 0
        return json.loads(capsys.readouterr().out)

    first = asked()
    assert sorted(first["parameters"]) == ["dx", "dy"]
    assert len(first["pose"]["position"]) == 3
    rows = [{"point": [0.02, 0.0, z], "normal": [1.0, 0.0, 0.0]} for z in (-0.05, 0.0, 0.05)]  # 10 mm inside the box
    (here / "touched.json").write_text(json.dumps({"contacts": rows}))
    assert surehold("study tell cup 0 0.4 --contacts touched.json") == 0
    from surehold.studies.robot import RobotStudy

    study = RobotStudy.open("cup")
    surface = study._touched._told(study.trials(), study.settings.space).belief.surface
    assert np.abs(surface.value(np.array([[0.02, 0.0, 0.0]]))[0]) < 0.001
    with_contacts = asked()["parameters"]
    assert surehold("explore --box 0.06,0.06,0.2 --study same --variables dx,dy --facet right-front --seed 3") == 0
    assert surehold("study ask same --json") == 0
    assert surehold("study tell same 0 0.4") == 0
    without = RobotStudy.open("same").next()
    assert with_contacts != without
    # The same answer again is harmless, another one is refused.
    assert surehold("study tell cup 0 0.4 --contacts touched.json") == 0
    (here / "touched.json").write_text(json.dumps({"contacts": rows[:1]}))
    assert surehold("study tell cup 0 0.4 --contacts touched.json") == 2
    assert "with other contacts" in capsys.readouterr().err
    capsys.readouterr()
    assert surehold("study recommend cup --json") == 0
    assert json.loads(capsys.readouterr().out)["trial"] == 0


def test_the_answer_is_a_trial_that_held_and_the_report_has_the_same(here, capsys):
    assert surehold("explore --box 0.08,0.08,0.12 --study cup --variables dx,dy,dz --facet right-front") == 0
    for _ in range(3):
        assert surehold("study ask cup --json") == 0
    held = {}
    for trial, value in enumerate((0.0, 0.9, -0.1)):  # on the shapes that are possible trial 0 would be the best
        held[trial] = value > 0.0
        assert surehold(f"study tell cup {trial} {value}") == 0
    capsys.readouterr()
    assert surehold("study recommend cup --json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert held[answer["trial"]]
    from surehold.reports.study_report import study_report
    from surehold.studies.robot import RobotStudy

    report = study_report(RobotStudy.open("cup"))
    (shown,) = report.candidates
    assert shown.trial == answer["trial"]
    assert shown.predicted_mean == pytest.approx(answer["mean"])
    assert "of the shapes that are possible" in " ".join(report.notes)


def test_files_of_a_study_are_found_from_any_folder(here, monkeypatch):
    (here / "hand.xml").write_text(three_fingers())
    assert surehold("hand new hand.xml") == 0
    assert surehold("explore --box 0.04,0.04,0.1 --study cup --hand hand.yaml --storage journal.log") == 0
    (here / "elsewhere").mkdir()
    monkeypatch.chdir(here / "elsewhere")
    assert surehold("study ask cup --storage ../journal.log --json") == 0


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"contacts": []}, "hold 0 touches"),
        ({"contacts": [{"point": [0.03, 0, 0], "normal": [2, 0, 0]}]}, "unit normals"),
        ({"contacts": [{"point": [30.0, 0, 50.0], "normal": [1, 0, 0]}]}, "give meters"),
        ({"contacts": [{"point": [0.4, 0, 0], "normal": [1, 0, 0]}]}, "mm off the surface"),
        (
            {"contacts": [{"point": [0.03, 0, 0], "normal": [v, 0, 0]} for v in (1, -1)]},
            "normals 180 degrees",
        ),
        ({"contacts": [{"point": [0.03, 0], "normal": [1, 0, 0]}]}, "point of contact 0 of contacts"),
        ({"touches": 3}, "no list 'contacts'"),
    ],
)
def test_contacts_that_cannot_be_are_refused_in_one_line(here, capsys, told, said):
    assert surehold("explore --box 0.06,0.06,0.2 --study cup --variables dx,dy --facet right-front") == 0
    assert surehold("study ask cup --json") == 0
    (here / "touched.json").write_text(json.dumps(told))
    capsys.readouterr()
    assert surehold("study tell cup 0 0.4 --contacts touched.json") == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_contacts_are_for_studies_of_a_shape(here, capsys):
    assert surehold("study create rig --parameters x=0:1") == 0
    assert surehold("study ask rig --json") == 0
    (here / "touched.json").write_text(json.dumps({"contacts": [{"point": [0, 0, 0], "normal": [1, 0, 0]}]}))
    capsys.readouterr()
    assert surehold("study tell rig 0 0.4 --contacts touched.json") == 2
    assert "not about a shape that is touched" in capsys.readouterr().err


def test_the_storage_of_the_environment_is_that_of_studies_alone(here, monkeypatch, capsys):
    monkeypatch.setenv("SUREHOLD_STORAGE", "studies.log")
    assert surehold("explore --box 0.06,0.06,0.2 --study cup --variables dx,dy --facet right-front") == 0
    assert surehold("study status cup --storage studies.log") == 0
    assert surehold("explore mug --noise none") == 2  # not for the storage
    assert "--noise is none" in capsys.readouterr().err


def test_language_models_are_told_the_pose_as_well(here):
    mcp = pytest.importorskip("mcp.client")
    from surehold.studies.model_context import model_context_server
    from surehold.studies.robot import RobotStudy

    assert surehold("explore --box 0.06,0.06,0.2 --study cup --variables dx,dy --facet right-front") == 0
    study = RobotStudy.open("cup")

    async def asked():
        async with mcp.Client(model_context_server(study)) as client:
            return (await client.call_tool("ask", {"worker": "me"})).structured_content

    assert asyncio.run(asked())["pose"] == study.ask("me").pose


def test_contacts_come_over_http_as_well(here):
    from fastapi.testclient import TestClient

    from surehold.studies.robot import RobotStudy
    from surehold.studies.service import new_token, service

    assert surehold("explore --box 0.06,0.06,0.2 --study cup --variables dx,dy --facet right-front") == 0
    study, token = RobotStudy.open("cup"), new_token()
    client = TestClient(service(study, token), base_url="http://127.0.0.1/studies/cup")
    client.headers["Authorization"] = f"Bearer {token}"
    asked = client.post("/ask", json={}).json()
    assert len(asked["pose"]["quaternion"]) == 4
    touches = {"contacts": [{"point": [0.02, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}], "free": [[0.05, 0.0, 0.0, 0.01]]}
    answer = {"id": asked["id"], "value": 0.4, "touches": touches}
    assert client.post("/tell", json=answer).json()["state"] == "complete"
    assert study.trials()[0].user_attrs["surehold:contacts"] == touches
    wrong = {"id": asked["id"], "value": 0.4, "touches": {"contacts": [{"point": [0.02, 0.0], "normal": [1, 0, 0]}]}}
    assert client.post("/tell", json=wrong).status_code == 422


def test_an_unseen_side_under_the_contacts_is_said(here):
    from surehold.cli.grasp import known_at
    from surehold.problems.grasp.from_cloud import belief_of_file, object_of_cloud
    from surehold.problems.grasp.options import checked_words
    from surehold.problems.grasp.problem import GraspProblem

    words = checked_words({"object": "", "cloud": "bottle.npz", "shapes": 3})
    body = object_of_cloud(words)[0]
    assert body.deviation == pytest.approx(belief_of_file(words)[0].surface.deviation(body.vertices))
    with np.load("bottle.npz") as file:
        seen, camera = file["points"], file["camera"]
    problem = GraspProblem(shipped_object("bottle")).on(body)
    assert "scan it" not in known_at(problem, seen[:20])["shape at the contacts"]
    far = body.vertices[np.argsort(-np.linalg.norm(body.vertices - camera, axis=1))[:20]]
    assert "scan it" in known_at(problem, far)["shape at the contacts"]
