import errno
import os
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from threading import Thread

import optuna
import pytest
from filelock import FileLock

import surehold as sh
from surehold.errors import InputError
from surehold.store.locks import locked
from surehold.studies import storage as storage_module
from surehold.studies.dashboard_note import read_note, write_note
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.status import rows, status
from surehold.studies.storage import StorageFailure, open_storage

SETTINGS = StudySettings(SearchSpace({"x": (0.0, 1.0)}), optimizer={"n_initial": 4})


def test_the_default_is_a_journal_of_the_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    RobotStudy.create("mug", SETTINGS).ask()
    assert (tmp_path / "runs" / "mug" / "journal.log").stat().st_size > 0
    assert RobotStudy.open("mug").ask().id == 1
    assert RobotStudy.open("mug", "runs/mug").ask().id == 2
    assert RobotStudy.open("mug", f"journal://{tmp_path}/runs/mug/journal.log").ask().id == 3


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("gone/journal.log", "does not exist in this folder .*'/.*/gone/journal.log' was looked for"),
        ("sqlite:///gone.db", "does not exist in this folder .*'/.*/gone.db' was looked for"),
        ("sqlite://", "names no file"),
        ("mysql://host/db", "of no kind that is known"),
        ("postgresql://nobody@127.0.0.1:1/none", "cannot be used"),
        ("redis://localhost", "of no kind that is known"),
    ],
)
def test_storages_that_are_not_there(url, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        RobotStudy.open("mug", url)
    assert os.listdir(tmp_path) == []


def test_passwords_are_not_shown():
    with pytest.raises(InputError) as error:
        RobotStudy.open("mug", "postgresql://me:secret@127.0.0.1:1/none")
    assert "secret" not in str(error.value)
    assert "me:***@" in str(error.value)


@pytest.mark.parametrize("url", ["{}/file/journal.log", "sqlite:///{}/file/a.db", "{}/folder.db"])
def test_storages_that_cannot_be_written(url, tmp_path):
    (tmp_path / "file").write_text("not a folder")
    (tmp_path / "folder.db").mkdir()
    (tmp_path / "folder.db" / "journal.log").mkdir()
    with pytest.raises(InputError, match="cannot be"):
        RobotStudy.create("mug", SETTINGS, url.format(tmp_path))


@pytest.mark.skipif(os.getuid() == 0, reason="root may write everywhere")
def test_storages_without_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="cannot be written"):
        RobotStudy.create("mug", SETTINGS, str(tmp_path / "journal.log"))


@pytest.mark.parametrize("url", ["{}/journal.log", "sqlite:///{}/a b%20.db"])
def test_what_cannot_be_written_is_read(url, tmp_path, monkeypatch, caplog):
    """A copy on a medium that is mounted for reading; the tests may run as root, who writes everywhere."""
    url = url.format(tmp_path)
    robot = RobotStudy.create("mug", SETTINGS, url)
    robot.tell(robot.ask().id, 0.5)
    robot.close()
    for file in tmp_path.iterdir():
        if file.suffix in (".lock", ".asking", ".telling"):
            file.unlink()

    def read_only(path, mode):
        if mode != "rb":
            raise OSError(errno.EROFS, "Read-only file system")
        return open(path, mode)

    monkeypatch.setattr(storage_module, "open", read_only, raising=False)
    before = sorted(tmp_path.iterdir())
    copy = RobotStudy.open("mug", url)
    assert (status(copy)["complete"], [row["value"] for row in rows(copy)]) == (1, [0.5])
    assert copy.recommend(write=False).trial == 0
    assert sorted(tmp_path.iterdir()) == before
    monkeypatch.setattr(FileLock, "acquire", lambda *_, **__: read_only("", "ab"))
    with pytest.raises(InputError, match="Read-only file system; copy it to a place that can be written"):
        copy.ask()
    caplog.clear()
    assert copy.recommend() == copy.recommend(write=False)
    assert "The answer is not noted in study 'mug': storage" in caplog.text
    with pytest.raises(InputError, match="cannot be written: Read-only file system"):
        RobotStudy.create("other", SETTINGS, url)
    copy.close()
    if not url.startswith("sqlite"):
        with open(url, "ab") as journal:
            journal.write(b'{"op_code":4,"worker')  # copied while it was written
        assert [row["value"] for row in rows(RobotStudy.open("mug", url))] == [0.5]


@pytest.mark.parametrize("text", ["hello", "hello\n", '{"op_code": 99}\n', '{"op_code": 0}\n', "[1]", "\0\0\n"])
def test_journals_that_are_none_are_left_alone(text, tmp_path):
    path = tmp_path / "journal.log"
    path.write_text(text)
    with pytest.raises(InputError, match="cannot be read"):
        RobotStudy.create("mug", SETTINGS, str(path))
    assert path.read_text() == text


@pytest.mark.parametrize("number", ["1e999", '"two"', "null", "[]"])
def test_a_journal_with_a_strange_number_in_a_sound_line(number, tmp_path):
    path = tmp_path / "journal.log"
    robot = RobotStudy.create("mug", StudySettings(SearchSpace(sh.Box({"n": (2, 5, "int")})), None, {}, {}), str(path))
    robot.tell(robot.ask().id, 0.5)
    text = path.read_text().replace(r"\"low\": 2", rf"\"low\": {number}".replace('"two"', r"\"two\""))
    assert text != path.read_text()
    path.write_text(text)
    with pytest.raises(InputError, match=r"cannot be read: .*damaged"):
        RobotStudy.open("mug", str(path))


def test_databases_that_are_none_or_of_a_newer_version(tmp_path):
    (tmp_path / "a.db").write_text("this is no database, but a text that is long enough to be mistaken for one" * 9)
    with pytest.raises(InputError, match="cannot be used"):
        RobotStudy.open("mug", f"sqlite:///{tmp_path}/a.db")
    url = f"sqlite:///{tmp_path}/b.db"
    RobotStudy.create("mug", SETTINGS, url).close()
    with sqlite3.connect(tmp_path / "b.db") as connection:
        connection.execute("UPDATE version_info SET schema_version = 99")
        connection.execute("UPDATE alembic_version SET version_num = 'v99.0.0'")
    connection.close()
    with pytest.raises(InputError, match="version"):
        RobotStudy.open("mug", url)


def test_a_locked_database_is_said_and_nothing_is_lost(tmp_path):
    url = f"sqlite:///{tmp_path}/a.db?timeout=0.1"
    robot = RobotStudy.create("mug", SETTINGS, url)
    asked = robot.ask()
    other = sqlite3.connect(tmp_path / "a.db", isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    for attempt in (lambda: robot.tell(asked.id, 0.5), robot.ask, lambda: RobotStudy.open("mug", url)):
        with pytest.raises(InputError, match="locked"):
            attempt()
    other.execute("ROLLBACK")
    other.close()
    assert robot.tell(asked.id, 0.5).already is False
    assert robot.ask().id == 1
    robot.close()


def test_half_a_line_of_a_journal_is_cut_off(tmp_path):
    path = tmp_path / "journal.log"
    robot = RobotStudy.create("mug", SETTINGS, str(path))
    robot.tell(robot.ask().id, 0.5)
    whole = path.read_bytes()
    with open(path, "ab") as journal:
        journal.write(b'{"op_code":4,"worker')
    assert robot.ask().id == 1  # one that was open at that time
    assert path.read_bytes().startswith(whole)
    with open(path, "ab") as journal:
        journal.write(b'{"op_code"')
    assert [t.value for t in RobotStudy.open("mug", str(path)).trials()] == [0.5, None]
    optuna.storages.JournalStorage(optuna.storages.journal.JournalFileBackend(str(path)))


@pytest.mark.parametrize(
    "damage",
    [b"garbage\n", b'{"op_code":4,"worker\n', b"\0" * 5000 + b"\n", b"5\n", b"\xff\xfe\n{}\n", b"[" * 50000 + b"\n"],
    ids=["text", "half an operation", "zeros", "a number", "two lines", "deep"],
)
def test_a_damaged_last_line_with_its_newline_is_cut_off_before_anything_is_appended(damage, tmp_path):
    path = tmp_path / "journal.log"
    robot = RobotStudy.create("mug", SETTINGS, str(path))
    robot.tell(robot.ask().id, 0.5)
    whole = path.read_bytes()
    path.write_bytes(whole + damage)
    assert robot.ask().id == 1  # one that was open at that time
    assert path.read_bytes().startswith(whole + b'{"op_code"')
    path.write_bytes(path.read_bytes() + damage)
    again = RobotStudy.open("mug", str(path))
    again.tell(again.ask().id, 0.25)
    assert [t.value for t in RobotStudy.open("mug", str(path)).trials()] == [0.5, None, 0.25]


def test_a_file_of_somebody_else_keeps_its_lines(tmp_path):
    path = tmp_path / "settings.json"
    path.write_text('{"a": 1,\n "b": 2}\n')
    with pytest.raises(InputError, match="cannot be read"):
        RobotStudy.create("mug", SETTINGS, str(path))
    assert path.read_text() == '{"a": 1,\n "b": 2}\n'


CREATING = """
import sys
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
sys.stdin.readline()
RobotStudy.create(sys.argv[2], StudySettings(SearchSpace({"x": (0.0, 1.0)})), sys.argv[1]).close()
"""


def test_studies_are_created_in_a_new_storage_at_the_same_time(url):
    pipes = {"stdin": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    made = [subprocess.Popen([sys.executable, "-c", CREATING, url, f"study{k}"], **pipes) for k in range(3)]
    for process in made:  # all at once, when all are loaded
        process.stdin.write("go\n")
        process.stdin.flush()
    errors = [process.communicate(timeout=600)[1] for process in made]
    assert [process.returncode for process in made] == [0] * 3, errors
    for k in range(3):
        RobotStudy.open(f"study{k}", url).close()


def test_the_tables_of_a_database_are_made_under_a_lock(tmp_path):
    with ThreadPoolExecutor(1) as pool:
        with locked(tmp_path / "a.db.telling"):  # as while another process makes them
            creation = pool.submit(RobotStudy.create, "mug", SETTINGS, f"sqlite:///{tmp_path}/a.db")
            wait([creation], 1.0)
            assert not (tmp_path / "a.db").exists() or not (tmp_path / "a.db").stat().st_size
        creation.result().close()


HOLDING = """
import sys, time
from surehold.studies.storage import StorageFailure, open_storage
with open_storage(sys.argv[1], "mug", create=True).handing_out():
    print("held", flush=True)
    time.sleep(3600)
"""


def test_the_lock_ends_with_its_process(url):
    storage = open_storage(url, "mug", create=True)
    holder = subprocess.Popen([sys.executable, "-c", HOLDING, url], stdout=subprocess.PIPE, text=True)
    assert holder.stdout.readline().strip() == "held"
    waiter = subprocess.Popen(
        [sys.executable, "-c", HOLDING.replace("time.sleep(3600)", ""), url], stdout=subprocess.PIPE, text=True
    )
    time.sleep(1.0)
    assert waiter.poll() is None, "a second process got the lock"
    holder.kill()
    holder.communicate()
    assert waiter.communicate(timeout=600)[0].strip() == "held"
    with storage.handing_out(), storage.handing_out():
        pass
    storage.close()


def test_notes_are_those_of_the_dashboard(url):
    from surehold.studies.storage import open_storage

    storage = open_storage(url, "mug", create=True)
    study = optuna.create_study(study_name="mug", storage=storage.backend)
    backend, number = storage.backend, study._study_id
    assert read_note(backend, number) == ""
    for text in ("short", "long " * 2000, "ä" * 2045, "shorter", ""):
        write_note(backend, number, text)
        assert read_note(backend, number) == text
        assert as_the_dashboard_reads(backend, number) == text
    storage.close()


def as_the_dashboard_reads(backend, number):
    """Return the note by the dashboard's own function, loaded by itself: the package would load PyTorch."""
    from importlib.util import find_spec, module_from_spec, spec_from_file_location
    from pathlib import Path

    folder = Path(find_spec("optuna_dashboard").submodule_search_locations[0])
    spec = spec_from_file_location("_dashboard_note", folder / "_note.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.get_note_from_system_attrs(backend.get_study_system_attrs(number), None)["body"]


@pytest.mark.parametrize("how", ["an older copy", "an older copy in its place", "a new study", "nothing"])
@pytest.mark.parametrize("file", ["journal.log", "a.db"])
def test_a_file_that_was_replaced_is_found_out(file, how, tmp_path):
    """Answers were taken and lost, or went to the trials of another study."""
    path = tmp_path / file
    url = str(path) if file == "journal.log" else f"sqlite:///{path}"
    robot = RobotStudy.create("mug", SETTINGS, url)
    robot.tell(robot.ask().id, 0.5)
    older = path.read_bytes()
    asked = [robot.ask(f"arm {k}").id for k in range(2)]
    newer = path.read_bytes()
    if how == "an older copy in its place":
        path.write_bytes(older)
    else:
        path.unlink()
    if how == "an older copy":
        path.write_bytes(older)
    elif how == "a new study":
        again = RobotStudy.create("mug", SETTINGS, url)
        others = [again.ask(f"leg {k}").id for k in range(4)]
        assert set(asked) < set(others)
    there = path.read_bytes() if path.exists() else b""
    for attempt in (lambda: robot.tell(asked[0], 9.0), lambda: robot.veto(asked[1])):
        with pytest.raises(StorageFailure, match=r"start the program again|No such file"):
            attempt()
    if file == "journal.log":
        for look in (lambda: robot.paused, lambda: status(robot), lambda: robot.stop_rule):
            with pytest.raises(StorageFailure, match=r"start the program again|No such file"):
                look()
    assert (path.read_bytes() if path.exists() else b"") == there
    if file == "journal.log":
        path.write_bytes(newer)
        assert robot.tell(asked[0], 9.0).already is False
    robot.close()


def test_a_journal_that_another_program_goes_on_with_is_read_on(tmp_path):
    path = tmp_path / "journal.log"
    robot = RobotStudy.create("mug", SETTINGS, str(path))
    robot.ask()
    path.with_suffix(".copy").write_bytes(path.read_bytes())
    os.replace(path.with_suffix(".copy"), path)  # the same, as rsync does it
    other = RobotStudy.open("mug", str(path))
    other.tell(other.ask().id, 0.5)
    assert [t.value for t in robot.trials()] == [None, 0.5]
    assert robot.ask().id == 2


@pytest.mark.parametrize("file", ["journal.log", "sqlite:///a.db"])
def test_a_study_that_was_deleted_is_said_to_be_gone(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot = RobotStudy.create("mug", SETTINGS, file)
    asked = robot.ask()
    other = RobotStudy.open("mug", file)
    optuna.delete_study(study_name="mug", storage=other.storage.backend)  # as optuna-dashboard does
    for attempt in (lambda: robot.tell(asked.id, 0.5), robot.ask, lambda: status(robot), robot.recommend):
        with pytest.raises(StorageFailure, match="lacks the study, or a trial"):
            attempt()
    robot.close()
    other.close()


def test_a_creation_that_was_cut_off_is_made_again(url, monkeypatch):
    """A kill, or a full disk, between the study and its settings left a name that could be neither used nor created."""
    with monkeypatch.context() as full:
        full.setattr(optuna.Study, "set_user_attr", lambda *_: (_ for _ in ()).throw(OSError(errno.ENOSPC, "full")))
        with pytest.raises(StorageFailure, match="full"):
            RobotStudy.create("mug", SETTINGS, url)
    with pytest.raises(InputError, match="not created by surehold"):
        RobotStudy.open("mug", url)
    robot = RobotStudy.create("mug", SETTINGS, url)
    assert robot.ask().id == 0
    robot.close()
    with pytest.raises(InputError, match=r"exists in .*; use it, or choose another name"):
        RobotStudy.create("mug", SETTINGS, url)


@pytest.mark.parametrize("file", ["study.log", "sqlite:///study.db"])
def test_a_link_shares_the_locks_of_its_file(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = RobotStudy.create("rig", SETTINGS, file)
    name = file.rpartition("/")[2]
    Path("link").symlink_to(name)
    linked = RobotStudy.open("rig", file.replace(name, "link"))
    asked = []
    with study.storage.handing_out():
        other = Thread(target=lambda: asked.append(linked.ask()))
        other.start()
        other.join(0.3)
        assert asked == []  # it waits, or both would be given the same trial
    other.join(60)
    assert study.ask().id == asked[0].id + 1
    study.close()
    linked.close()


@pytest.mark.parametrize("file", ["study.log", "sqlite:///study.db"])
def test_a_study_is_found_when_its_program_has_gone_to_another_folder(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = RobotStudy.create("rig", SETTINGS, file)
    assert study.storage.shown == file
    first = study.ask()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    study.tell(first.id, 0.5)
    assert study.ask().id == 1
    assert not list(Path().iterdir())
    study.close()


@pytest.mark.filterwarnings("ignore:.*use of fork")  # Python 3.12 in a process with threads
@pytest.mark.parametrize("url", ["journal.log", "sqlite:///study.db"])
def test_forked_processes_share_an_open_study(url, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = RobotStudy.create("mug", StudySettings(SETTINGS.space, optimizer={"n_initial": 8}), url)
    study.tell(study.ask().id, 0.0)  # what the children inherit has been used
    children = []
    for value in (1.0, 2.0):
        child = os.fork()
        if not child:
            try:
                for _ in range(2):
                    study.tell(study.ask().id, value)
            except BaseException:
                os._exit(1)
            os._exit(0)
        children.append(child)
    assert [os.waitpid(child, 0)[1] for child in children] == [0, 0]
    trials = study.trials()
    assert sorted(trial.values[0] for trial in trials) == [0.0, 1.0, 1.0, 2.0, 2.0]
    assert len({trial.params["x"] for trial in trials}) == 5
