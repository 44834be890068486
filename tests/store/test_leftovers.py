"""A folder that is used again: what was written there before goes, and nothing else does."""

import json

import pytest

from surehold.store.atomic import checked_folder, write_file
from surehold.store.leftovers import LIST, listed_writes


def written(folder, *names, replacing=True):
    with listed_writes(folder, replacing=replacing) as removed:
        for name in names:
            checked_folder((folder / name).parent)
            write_file(folder / name, f"content of {name}")
    return sorted(removed)


def there(folder):
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file() and p.name != LIST)


def test_what_is_not_written_again_is_removed(tmp_path):
    assert written(tmp_path, "a.txt", "b.txt", "deep/down/c.txt") == []
    assert written(tmp_path, "a.txt") == ["b.txt", "deep/down/c.txt"]
    assert there(tmp_path) == ["a.txt"]
    assert not (tmp_path / "deep").exists(), "no empty folders"
    assert written(tmp_path, "b.txt") == ["a.txt"]


def test_files_of_the_user_stay(tmp_path):
    (tmp_path / "own.txt").write_text("mine")
    written(tmp_path, "a.txt", "b.txt", "deep/c.txt", "gone.txt")
    (tmp_path / "b.txt").write_text("changed by hand")
    (tmp_path / "deep" / "own.txt").write_text("mine")
    (tmp_path / "gone.txt").unlink()
    assert written(tmp_path, "new.txt") == ["a.txt", "deep/c.txt"]
    assert there(tmp_path) == ["b.txt", "deep/own.txt", "new.txt", "own.txt"]


def test_a_file_that_is_made_again_by_hand_is_the_users(tmp_path):
    written(tmp_path, "a.txt", "b.txt")
    assert written(tmp_path, "a.txt") == ["b.txt"]
    (tmp_path / "b.txt").write_text("content of b.txt")
    assert written(tmp_path, "a.txt") == []
    assert (tmp_path / "b.txt").exists()


def test_without_replacing_the_list_grows(tmp_path):
    written(tmp_path, "a.txt")
    assert written(tmp_path, "b.txt", replacing=False) == []
    assert there(tmp_path) == ["a.txt", "b.txt"]
    assert written(tmp_path, "c.txt") == ["a.txt", "b.txt"]


def test_after_an_error_everything_is_there_and_listed(tmp_path):
    written(tmp_path, "a.txt")

    def half_a_run():
        with listed_writes(tmp_path, replacing=True):
            write_file(tmp_path / "b.txt", "content")
            raise KeyError

    with pytest.raises(KeyError):
        half_a_run()
    assert there(tmp_path) == ["a.txt", "b.txt"]
    assert written(tmp_path, "c.txt") == ["a.txt", "b.txt"]


def test_a_list_reaches_no_file_outside_of_its_folder(tmp_path):
    folder, outside = checked_folder(tmp_path / "folder"), checked_folder(tmp_path / "outside")
    written(outside, "a.txt")
    digest = json.loads((outside / LIST).read_text())["a.txt"]
    (folder / "link").symlink_to(outside)
    (folder / "a.txt").symlink_to(outside / "a.txt")
    names = ("../outside/a.txt", str(outside / "a.txt"), "link/a.txt", "a.txt", "\0")
    (folder / LIST).write_text(json.dumps(dict.fromkeys(names, digest)))
    assert written(folder, "b.txt") == []
    assert (outside / "a.txt").exists()


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 100_000])
def test_a_damaged_list_is_none(tmp_path, text):
    (tmp_path / "own.txt").write_text("mine")
    (tmp_path / LIST).write_text(text)
    assert written(tmp_path, "a.txt") == []
    assert there(tmp_path) == ["a.txt", "own.txt"]
