import hashlib
import os

import pytest

from surehold.errors import InputError
from surehold.store.atomic import checked_folder, new_folder, noted_writes, replacing, write_file


def test_the_old_content_stays_until_the_new_is_whole(tmp_path):
    path = tmp_path / "data"
    write_file(path, "old")
    with replacing(path) as file:
        file.write(b"ne")
        file.flush()
        assert path.read_text() == "old"
        file.write(b"w")
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["data"]


def _fail_half_way(file, failure):
    file.write(b"half")
    raise failure


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_a_failure_inside_keeps_the_old_content_and_leaves_nothing_behind(tmp_path, failure):
    path = tmp_path / "data"
    write_file(path, "old")
    with pytest.raises(failure), replacing(path) as file:
        _fail_half_way(file, failure)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["data"]


def test_others_may_read_what_is_written(tmp_path):
    before = os.umask(0o022)
    try:
        write_file(tmp_path / "data", b"\x00\xff")
    finally:
        os.umask(before)
    assert (tmp_path / "data").stat().st_mode & 0o777 == 0o644
    assert (tmp_path / "data").read_bytes() == b"\x00\xff"


def test_a_folder_that_is_missing_is_named(tmp_path):
    with pytest.raises(InputError, match=r"make the folder '.*missing' or choose another"):
        write_file(tmp_path / "missing" / "hand.yaml", "x")


def test_a_failed_write_keeps_what_was_there(tmp_path):
    target = tmp_path / "report.html"
    target.mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        write_file(target, "new")
    assert list(tmp_path.iterdir()) == [target]
    with pytest.raises(InputError, match="cannot be written"):
        write_file(tmp_path / "missing" / "x", "new")


def test_what_is_no_ordinary_file_stays(tmp_path):
    """A program of root that saves to /dev/stdout would take it from all others."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="it is no ordinary file"):
        write_file(tmp_path / "pipe", "x")
    assert (tmp_path / "pipe").is_fifo()
    for name, end in (("link", "data"), ("dangling", "missing"), ("device", "pipe")):
        (tmp_path / name).symlink_to(end)
    with pytest.raises(InputError, match="it is no ordinary file"):
        write_file(tmp_path / "device", "x")
    for name in ("link", "dangling"):
        write_file(tmp_path / name, name)
        assert (tmp_path / name).is_symlink()
    assert [(tmp_path / name).read_text() for name in ("data", "missing")] == ["link", "dangling"]


def test_a_folder_is_made_or_refused(tmp_path):
    assert checked_folder(tmp_path / "a" / "b").is_dir()
    (tmp_path / "taken").write_text("a file")
    for place in (tmp_path / "taken", tmp_path / "taken" / "below"):
        with pytest.raises(InputError, match="choose another"):
            checked_folder(place)


def test_a_new_folder_is_none_that_was_there(tmp_path):
    made = [new_folder(tmp_path / "run") for _ in range(3)]
    assert [path.name for path in made] == ["run", "run-2", "run-3"]
    assert all(path.is_dir() for path in made)


def test_writes_are_noted_by_the_innermost_block_and_where_they_are(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with noted_writes() as outer:
        with noted_writes() as inner:
            write_file(tmp_path / "link" / "a", "x")
        write_file(tmp_path / "b", "x")
    write_file(tmp_path / "c", "x")
    assert list(inner) == [(tmp_path / "real" / "a").resolve()]
    assert list(outer) == [(tmp_path / "b").resolve()]
    assert inner.popitem()[1] == hashlib.sha256(b"x").hexdigest()
