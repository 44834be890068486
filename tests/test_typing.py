"""The types that a user's checker sees: the package says that it is typed, and lazy names have their types."""

import json
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

PROGRAM = Path(__file__).parent / "typing" / "user_program.py"

WRONG = """
import surehold as sh

sh.Optimizer(sh.Box({"a": (0.0, 1.0)}), seed="zero")
sh.Optimiser
sh.Box({"a": (0.0, 1.0)}).dimension.upper()
"""


def _complaints(path):
    """Return line and rule of what pyright says of a file that stands outside the project."""
    command = [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=path.parent, timeout=600)
    said = json.loads(done.stdout)
    assert said["summary"]["filesAnalyzed"] == 1, done.stdout
    return [(d["range"]["start"]["line"], d.get("rule")) for d in said["generalDiagnostics"]]


def test_the_package_is_marked_as_typed():
    assert files("surehold").joinpath("py.typed").is_file()


def test_a_users_program_has_no_complaint():
    assert _complaints(PROGRAM) == []


def test_mistakes_are_found(tmp_path):
    (tmp_path / "wrong.py").write_text(WRONG)
    assert _complaints(tmp_path / "wrong.py") == [
        (3, "reportArgumentType"),
        (4, "reportAttributeAccessIssue"),
        (5, "reportAttributeAccessIssue"),
    ]
