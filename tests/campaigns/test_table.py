import gzip
import json
import resource
import subprocess
import sys
from dataclasses import replace

import pytest

from surehold.campaigns.table import PACKED, opened, pack, read_folder
from surehold.errors import InputError, SureholdError


def row_of(cell, seed, **changes):
    data = {"problem": cell.problem, "method": cell.method, "seed": seed, "digest": cell.digest, "status": "done"}
    return data | {"best": [[0, 0.5 + seed]], "trials": 8, "settings": json.loads(json.dumps(cell.as_data()))} | changes


def fill(folder, plan, tasks):
    with opened(folder, plan) as table:
        for task in tasks:
            table.append(row_of(*task))
    return folder / "table.jsonl"


def test_rows_come_back(tmp_path, cheap):
    fill(tmp_path, cheap, cheap.tasks())
    records = read_folder(tmp_path)
    assert len(records.done) == len(cheap.tasks())
    assert records.rows["hill", "UBO", 3] == row_of(cheap.cells()[1], 3)
    assert records.header["plan"] == "cheap"


@pytest.mark.parametrize("cut", [1, 10, 60])
def test_a_row_that_was_cut_off_is_dropped_with_a_message_and_made_again(tmp_path, cheap, cut):
    path = fill(tmp_path, cheap, cheap.tasks()[:5])
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    with opened(tmp_path, cheap) as table:
        assert len(table.records.rows) == 4
        assert "line 6" in table.records.notes[0]
        assert "made again" in table.records.notes[0]
        table.append(row_of(*cheap.tasks()[4]))
    assert path.read_bytes() == whole


def test_garbage_in_the_middle_costs_one_row(tmp_path, cheap):
    path = fill(tmp_path, cheap, cheap.tasks()[:4])
    lines = path.read_bytes().split(b"\n")
    lines[2] = lines[2][:40] + b"\x00\xff"
    path.write_bytes(b"\n".join(lines))
    records = read_folder(tmp_path)
    assert len(records.rows) == 3
    assert len(records.notes) == 1


def test_another_format_and_no_header_are_refused(tmp_path, cheap):
    path = fill(tmp_path, cheap, cheap.tasks()[:1])
    text = path.read_text()
    path.write_text(text.replace("surehold campaign 1", "surehold campaign 9"))
    for read in (lambda: read_folder(tmp_path), lambda: opened(tmp_path, cheap).__enter__()):
        with pytest.raises(InputError, match=r"format 'surehold campaign 9'.*this version reads 'surehold campaign 1'"):
            read()
    path.write_text(text.split("\n", 1)[1])
    with pytest.raises(InputError, match="no header"):
        read_folder(tmp_path)


def test_another_version_of_surehold_is_not_continued_but_read(tmp_path, cheap, monkeypatch):
    fill(tmp_path, cheap, cheap.tasks()[:1])
    monkeypatch.setattr("surehold.__version__", "9.9")
    with pytest.raises(InputError, match=r"written by surehold .*, this is 9\.9"), opened(tmp_path, cheap):
        pass
    assert len(read_folder(tmp_path).rows) == 1


def test_other_settings_and_other_plans_are_refused(tmp_path, cheap):
    fill(tmp_path, cheap, cheap.tasks()[:2])
    other = replace(cheap, problems={**cheap.problems, "hill": replace(cheap.problems["hill"], trials=9)})
    with pytest.raises(InputError, match="BO on hill with another trials"), opened(tmp_path, other):
        pass
    with pytest.raises(InputError, match="plan 'cheap', not of 'dear'"), opened(tmp_path, replace(cheap, name="dear")):
        pass


def test_shares_of_one_plan_with_different_settings_are_not_averaged(tmp_path, cheap):
    hill = replace(cheap.problems["hill"], input_noise=0.02)
    changed = replace(cheap, problems={**cheap.problems, "hill": hill})
    for k, plan in enumerate((cheap, changed), start=1):
        with opened(tmp_path / str(k), plan, (k, 2)) as table:
            for task in plan.tasks(shard=(k, 2)):
                table.append(row_of(*task))
        name = f"table-{k}-of-2.jsonl"
        (tmp_path / str(k) / name).rename(tmp_path / name)  # as shares of two machines are brought together
    with pytest.raises(InputError, match=r"1-of-2.*2-of-2.*runs of BO on hill with different settings"):
        read_folder(tmp_path)
    tables = sorted(tmp_path.glob("table-*.jsonl"))
    with pytest.raises(InputError, match="different settings"):
        pack(tables, tmp_path / "packed")
    with pytest.raises(InputError, match="different settings"), opened(tmp_path, cheap):
        pass


def test_rows_go_to_their_table_when_a_run_has_gone_to_another_folder(tmp_path, cheap, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    with opened("runs", cheap) as table:
        monkeypatch.chdir("elsewhere")
        table.append(row_of(*cheap.tasks()[0]))
        table.sort(cheap)
    assert len(read_folder(tmp_path / "runs").rows) == 1


def test_more_runs_and_more_methods_are_welcome(tmp_path, cheap):
    fill(tmp_path, cheap, cheap.tasks()[:2])
    grown = replace(cheap, runs=9, methods={**cheap.methods, "third": cheap.methods["BO"]})
    with opened(tmp_path, grown) as table:
        assert len(table.records.rows) == 2
    kept = read_folder(tmp_path)
    assert kept.runs == 9, "also where the process is killed before it sorts the table"
    assert ("hill", "third") in kept.cells
    assert len(kept.rows) == 2


def test_two_processes_on_one_folder(tmp_path, cheap):
    with opened(tmp_path, cheap):
        with pytest.raises(InputError, match=r"another process \(\d+\)"), opened(tmp_path, cheap):
            pass
        with opened(tmp_path, cheap, shard=(1, 2)):  # another share is another table
            pass
    with opened(tmp_path, cheap):
        pass


def test_a_full_disk_keeps_the_rows_before(tmp_path):
    """The operating system refuses a file of more than 6000 bytes, as it would when the disk is full."""
    code = (
        "import resource, sys; sys.path.insert(0, sys.argv[2]); from conftest import CHEAP\n"
        "from surehold.campaigns.plan_file import parse_plan\n"
        "from surehold.campaigns.table import opened\n"
        "plan = parse_plan(CHEAP, 'cheap'); cell = plan.cells()[0]\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (6000, resource.RLIM_INFINITY))\n"
        "with opened(sys.argv[1], plan) as table:\n"
        "    for seed in range(50):\n"
        "        table.append(dict(problem='hill', method='BO', seed=seed, digest=cell.digest, status='done',\n"
        "                          settings={}, best=[[0, 1.0]] * 20))\n"
    )
    here = __file__.rpartition("/")[0]
    told = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path), here], capture_output=True, text=True, timeout=600
    )
    assert "SureholdError" in told.stderr
    assert "cannot be written" in told.stderr
    assert "Free space and start again" in " ".join(told.stderr.split())
    records = read_folder(tmp_path)
    assert records.notes == []
    assert len(records.rows) > 3
    assert (tmp_path / "table.jsonl").stat().st_size <= 6000
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 6000


def test_an_unwritable_folder_is_refused(tmp_path, cheap):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"), opened(tmp_path / "file", cheap):
        pass


def test_a_table_that_vanishes_is_an_error_not_a_crash(tmp_path, cheap):
    with opened(tmp_path, cheap) as table:
        table.path.unlink()
        with pytest.raises(SureholdError, match="cannot be written"):
            table.append(row_of(*cheap.tasks()[0]))


def test_packed_tables_are_read_beside_plain_ones(tmp_path, cheap):
    runs, results = tmp_path / "runs", tmp_path / "results"
    tasks = cheap.tasks()
    fill(runs, cheap, tasks[:6])
    first = pack([runs], results).read_bytes()
    assert pack([runs], results).read_bytes() == first, "packing is not repeatable"
    assert len(gzip.decompress(first).splitlines()) == 7
    with opened(results, cheap) as table:
        assert len(table.records.rows) == 6
        table.append(row_of(*tasks[6]))
    pack([results], results)
    assert [path.name for path in results.iterdir()] == [PACKED]
    assert len(read_folder(results).rows) == 7


def test_a_run_that_finished_takes_the_place_of_one_that_failed(tmp_path, cheap):
    """In the tables of a folder and in packed ones, whichever comes first; of two that finished the first stays."""
    cell = cheap.cells()[0]
    first, second = {0: "failed", 1: "done", 2: "done"}, {0: "done", 1: "failed", 2: "done"}
    for k, statuses in enumerate((first, second)):
        for folder in (tmp_path / "shares", tmp_path / str(k)):
            with opened(folder, cheap, (k + 1, 2) if folder.name == "shares" else (1, 1)) as table:
                for seed, status in statuses.items():
                    table.append(row_of(cell, seed, status=status, trials=8 + k))
    pack([tmp_path / "0", tmp_path / "1"], tmp_path / "packed")
    for records in (read_folder(tmp_path / "shares"), read_folder(tmp_path / "packed")):
        assert [records.rows[cell.problem, cell.method, seed]["trials"] for seed in range(3)] == [9, 8, 8]
        assert not records.failed
    with opened(tmp_path / "0", cheap) as table:
        table.append(row_of(cell, 0))
        table.sort(cheap)
    assert len(table.path.read_text().splitlines()) == 1 + len(first), "a row that another has replaced stays"


def test_packing_leaves_tables_that_it_has_not_read(tmp_path, cheap):
    own = fill(tmp_path / "results", cheap, cheap.tasks()[:2])
    fill(tmp_path / "runs", cheap, cheap.tasks()[2:4])
    pack([tmp_path / "runs"], tmp_path / "results")
    assert own.exists()
    assert len(read_folder(tmp_path / "results").rows) == 4


def test_seeds_beyond_the_plan_count_for_its_problems_and_methods_alone(tmp_path, cheap):
    fill(tmp_path, cheap, [(cheap.cells()[0], 11)])
    records = read_folder(tmp_path)
    assert records.runs == 12
    records.header["cells"] = records.header["cells"][1:]
    assert records.runs == cheap.runs


def test_an_empty_folder_names_the_next_step(tmp_path):
    with pytest.raises(InputError, match="surehold campaign run"):
        read_folder(tmp_path)
