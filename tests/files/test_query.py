"""SQL over runs and their archive: each answer against the logs themselves, what is read, what can't be reached."""

import errno
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.core.recording import Recording
from silo.errors import ElementError, LogNotFoundError, SaveError, SiloError
from silo.run_index import tables
from silo.run_index.archive import Archive
from tests.later import Later
from tests.stand_ins.saved import element

duckdb, polars = Later("duckdb"), Later("polars")
IS_THERE = None not in (find_spec("duckdb"), find_spec("polars"))
pytestmark = pytest.mark.skipif(not IS_THERE, reason="needs silo-logger[query]")
reads_what_is_asked = pytest.mark.skipif(
    not IS_THERE or version("duckdb") < "2", reason="DuckDB for Python 3.10 reads whole tables"
)
RUNS, TICKS = 4, 40


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Runs with a vector, a slow signal, a text, an enumeration, whole numbers that no double holds, a hole, a mark."""
    root = tmp_path_factory.mktemp("logs")
    for number in range(RUNS):
        clock = itertools.count(1_700_000_000_000_000_000 + number * 86_400 * 10**9, 10_000_000).__next__
        log = silo.Logger(f"dog{number % 2}", prefix=f"/dog{number % 2}", frequency=100, folder=root, clock=clock,
                          script=root / "none.yaml", about={"task": "walk"})  # fmt: skip
        tau = log.array("tau", 3, group="joints", unit="Nm")
        slow = log.array("slow", dtype=np.int64, divider=4)
        word = np.array("", "U8")
        log.add(word, "word")
        if number:
            log.array("Gain")[...] = number
        log.array("gain")[...] = -number
        log.parameter("kp", 10.0 * number, min=0, max=100)
        log.parameter("gains", [[1.0, 2.0], [3.0, number]])
        log.parameter("words", ["wet", "dry"], string_bytes=8)
        log.parameter("many2", [float(one) for one in range(12)])
        log.start()
        for tick in range(TICKS):
            tau[:] = number * np.sin(tick / 3 + np.arange(3))
            tau[1] = np.nan if tick == 7 else tau[1]
            slow[...] = 2**60 + tick
            word[...] = f"w{tick // 10}"
            if tick == 10:
                with log.episode("step", speed=0.5 * number) as episode:
                    log.collect()
                    episode.success = number != 2
            else:
                log.collect()
        if number == 1:
            log.mark("pushed")
        log.save(("silo",), name=f"run{number}")
        log.close()
    return root


@pytest.fixture(scope="module")
def runs(written):
    return silo.runs(written)


@pytest.fixture(scope="module")
def archive(runs, tmp_path_factory):
    made = Archive(str(tmp_path_factory.mktemp("archive") / "there"))
    assert not made.add(runs).problems
    return made


@pytest.fixture(params=["logs", "archive"])
def drawer(request, runs, archive):
    return runs if request.param == "logs" else archive


def test_every_value_of_the_tables_is_that_of_the_log(drawer, runs):
    rows = drawer.sql("select run, signal, t, value, text from samples order by run, signal, t")
    wide = drawer.sql("select * from wide order by run, t")
    for run in runs:
        log = run.open()
        of_run, table = (frame.filter(polars.col("run") == run.facts.path) for frame in (rows, wide))
        columns = {"gain": "gain_3"} | {name: name for name in ("joints/tau_x", "joints/tau_y", "slow", "word")}
        for name, shown in (columns | ({"Gain": "Gain_2"} if run.name != "run0" else {})).items():
            one = log[f"/{run.facts.robot}/{name}"]
            there = of_run.filter(polars.col("signal") == name)
            column = table[shown]
            if name == "word":
                assert there["text"].to_list() == column.to_list() == [str(text) for text in one.texts]
                continue
            finite = np.isfinite(one.values)
            assert there["value"].to_numpy() == pytest.approx(one.values[finite].astype(float), abs=0)
            assert there["t"].to_numpy() == pytest.approx((one.time_ns[finite] - one.start_ns) * 1e-9)
            np.testing.assert_array_equal(column.drop_nulls().to_numpy(), one.values[finite].astype(float))


@pytest.mark.parametrize("name", ["joints/tau_x", "joints/tau_y", "slow", "gain", "Gain", "time", "time_2", "success"])
def test_an_archive_reads_columns_as_the_log_has_them(tmp_path, name):
    clock = itertools.count(1_700_000_000_000_000_000, 10_000_000).__next__
    log = silo.Logger("dog", frequency=100, folder=tmp_path, clock=clock, script=tmp_path / "none.yaml")
    tau, slow = log.array("tau", 2, group="joints", unit="Nm"), log.array("slow", dtype=np.int64, divider=4)
    yes, here = log.array("success", dtype=bool), log.array("time")
    log.array("time_2", dtype=np.float32)[...], log.array("gain")[...], log.array("Gain")[...] = 0.1, 2, 3
    log.start()
    for tick in range(21):
        tau[:], slow[...], yes[...], here[...] = (
            [tick, np.nan if tick == 7 else -tick],
            2**60 + tick,
            tick % 3,
            tick + 9,
        )
        log.collect()
    log.save(("silo",), name="run")
    log.close()
    name = {"joints/tau_x": "joints/tau_0", "joints/tau_y": "joints/tau_1"}.get(name, name)
    made = Archive(str(tmp_path / "there"))
    assert not made.add(silo.runs(tmp_path)).problems
    wanted = tables.Folders(runs := silo.runs(tmp_path), runs.indexes).read("run.silo", [name])
    assert made.read("run.silo", [name]).equals(wanted)
    for drawer in (runs, made):
        column = {"time": "time_3", "Gain": "Gain_2", "gain": "gain_3"}.get(name, name)
        assert drawer.sql(f'select "{column}" from wide order by t').to_series().to_list() == wanted[name].to_list()
        there = drawer.sql(f"select value from samples where signal = '{name}' order by t")["value"].to_list()
        assert there == wanted[name].drop_nulls().to_list()
        if name == "Gain":  # it would find one of two
            with pytest.raises(ElementError, match=r'(?s)"Gain" not found.*"Gain_2"'):
                drawer.sql('select "Gain" from wide')


def test_words_and_numbers_of_a_run_are_read_together(archive):
    assert archive.read("run0.silo", ["slow", "word"])["word"].to_list()[:11] == ["w0"] * 10 + ["w1"]


def test_facts_statistics_events_and_parameters_stand_in_tables(drawer):
    facts = drawer.sql("select run, robot, task, ticks, problem from runs order by run")
    assert facts.rows() == [(f"run{one}.silo", f"dog{one % 2}", "walk", TICKS, "") for one in range(RUNS)]
    assert drawer.sql(
        "select run, text, tick from events where kind = 'marker' and text not like 'episode%'"
    ).rows() == [("run1.silo", "pushed", TICKS - 1)]
    assert drawer.sql("select sum(value) from parameters where name = 'kp'").item() == 60
    asked = "select name, value, text from parameters where run = 'run2.silo' and (name ^@ 'gains' or name ^@ 'words')"
    gains = [
        (f"gains_{row}_{column}", value, None) for row, column, value in ((0, 0, 1), (0, 1, 2), (1, 0, 3), (1, 1, 2))
    ]
    assert drawer.sql(asked).rows() == [*gains, ("words_0", None, "wet"), ("words_1", None, "dry")]
    asked = "select value from parameters where run = 'run2.silo' and name = 'many2_' || value::int"
    assert len(drawer.sql(asked).rows()) == 12
    # stamps are exact, and so is what is reckoned from them
    assert drawer.sql("select count(*) from runs where frequency_hz = 100").item() == RUNS
    assert drawer.sql("select count(*) from about where name = 'task'").item() == RUNS
    asked = "select run, name, success, ticks, (about->>'speed')::double from episodes order by run"
    assert [row[1:] for row in drawer.sql(asked).rows()] == [("step", one != 2, 1, one / 2) for one in range(RUNS)]
    told, read = drawer.sql(
        'select s.max, w.most from signals s join (select run, max("joints/tau_z") most from wide group by run) w'
        " on s.run = w.run where s.signal = 'joints/tau_z' and s.run = 'run3.silo'"
    ).row(0)
    assert told == read > 2.9


@pytest.mark.parametrize(
    ("statement", "wanted"),
    [
        ("select count(*) from runs", {}),
        ("select count(*) from wide where run = 'run1.silo'", {"run1.silo": set()}),
        ("select max(slow) from wide", {f"run{one}.silo": {"slow"} for one in range(RUNS)}),
        ("select max(value) from samples where signal = 'joints/tau_x' and run in ('run0.silo', 'run2.silo')",
         {"run0.silo": {"joints/tau_x"}, "run2.silo": {"joints/tau_x"}}),
        ("select t from wide where word = 'w1' and run <> 'run0.silo' and run < 'run2'", {"run1.silo": {"word"}}),
        ("select a.t from wide a, runs r where a.run = r.run and a.run = 'run3.silo' and a.slow is not null",
         {"run3.silo": {"slow"}}),
    ],
)  # fmt: skip
@reads_what_is_asked
def test_no_more_is_read_than_a_statement_asks_for(runs, monkeypatch, statement, wanted):
    read = {}
    real = tables.Folders.read
    monkeypatch.setattr(
        tables.Folders,
        "read",
        lambda self, run, names: (read.setdefault(run, set(names)), real(self, run, names))[1],
    )
    runs.sql(statement)
    assert read == wanted


@pytest.mark.parametrize(
    "statement",
    [
        "select * from read_csv('{file}')", "select * from read_text('{file}')", "select * from '{file}'",
        "copy runs to '{new}'", "attach '{new}'", "install httpfs", "load httpfs", "set enable_external_access = true",
        "select * from read_parquet('http://127.0.0.1:9/x')", "select * from glob('{folder}/*')",
        "select * from polars", "export database '{new}'",
    ],
)  # fmt: skip
def test_a_statement_reaches_no_file_no_network_no_extension(runs, tmp_path, statement):
    file = tmp_path / "secret.csv"
    file.write_text("a\n1\n")
    with pytest.raises(ElementError):
        runs.sql(statement.format(file=file, folder=tmp_path, new=tmp_path / "new"))
    assert [one.name for one in tmp_path.iterdir()] == ["secret.csv"]


def test_what_is_wrong_with_a_statement_is_said(runs):
    with pytest.raises(ElementError, match="did you mean 'joints/tau_x"):
        runs.sql("select * from samples where signal = 'joint/tau_x'")
    with pytest.raises(ElementError, match=r"samples.*describe wide"):
        runs.sql("select * from sample")


@pytest.mark.parametrize(
    ("statement", "wanted_bytes", "way_out"),
    [
        ("select max(value) from samples where signal = 'slow'", RUNS * TICKS // 4 * 64, "name signals"),
        ("select slow from wide", RUNS * TICKS * 10 * (3 + 1), "name columns"),
        ("select max(value) from samples where signal = 'slow' and run = 'none'", 0, ""),
        ("select slow from wide where run = 'none'", 0, ""),
        ("select count(*) from runs", 0, ""),
    ],
)
@reads_what_is_asked
def test_more_than_fits_into_memory_is_refused(runs, monkeypatch, statement, wanted_bytes, way_out):
    free = SimpleNamespace(available=2 * wanted_bytes)
    monkeypatch.setattr("silo.run_index.sql.psutil.virtual_memory", lambda: free)
    runs.sql(statement)
    free.available -= 2
    if way_out:
        with pytest.raises(ElementError, match=way_out):
            runs.sql(statement)


def test_a_log_that_went_away_is_an_error_that_names_it(written, tmp_path):
    (tmp_path / "run0.silo").write_bytes((written / "run0.silo").read_bytes())
    found = silo.runs(tmp_path)
    (tmp_path / "run0.silo").unlink()
    with pytest.raises(LogNotFoundError, match=r"run0\.silo"):
        found.sql("select max(slow) from wide")


@pytest.mark.parametrize("kept", [False, True])
def test_dates_and_durations_are_seconds_in_all_tables(tmp_path, kept):
    at = np.arange(5)
    columns = {
        "when": (1_700_000_000 * 10**9 + at * 10**6).astype("M8[ns]"), "late": (at * 1000).astype("m8[ms]"),
        "day": at.astype("M8[D]"), "micro": (at * 500_000).astype("m8[us]"), "whole": at.astype("m8[s]"),
    }  # fmt: skip
    columns["late"][2] = "NaT"
    stamps = 1_700_000_000 * 10**9 + at * 10_000_001
    made = Recording("dog", stamps, 5, [element(name, values) for name, values in columns.items()])
    (tmp_path / "logs").mkdir()
    silo.Log(made).save(tmp_path / "logs" / "run.silo")
    asked = silo.runs(tmp_path / "logs")
    if kept:
        asked = Archive(str(tmp_path / "archive"))
        asked.add(silo.runs(tmp_path / "logs"))
    known = dict(asked.sql("select signal, max from signals").iter_rows())
    assert known == pytest.approx(
        {"when": 1_700_000_000.004, "late": 4.0, "day": 4 * 86400.0, "micro": 2.0, "whole": 4.0}
    )
    largest = ", ".join(f'max("{name}") as "{name}"' for name in columns)
    wide = asked.sql(f"select {largest} from wide").row(0, named=True)
    assert wide == pytest.approx(known)
    assert dict(asked.sql("select signal, max(value) from samples group by signal").iter_rows()) == pytest.approx(known)
    assert asked.sql("select count(late) from wide").item() == 4


@pytest.mark.parametrize("kept", [False, True], ids=["logs", "archive"])
def test_numbers_stay_numbers_where_other_runs_have_words(tmp_path, kept):
    at = np.arange(12)
    logs = {"number": element("mode", at.astype(float)), "text": element("mode", np.array(["a", "b"] * 6, "U4")),
            "enum": element("mode", at % 2, labels={0: "STAND", 1: "TROT"})}  # fmt: skip
    (tmp_path / "logs").mkdir()

    def asked(*names):
        for name in names:
            silo.Log(Recording("dog", at, 12, [logs[name]])).save(tmp_path / "logs" / f"{name}.silo")
        there = Archive(str(tmp_path / "archive")) if kept else silo.runs(tmp_path / "logs")
        return there if not kept or there.add(silo.runs(tmp_path / "logs")) else None

    assert asked("enum").sql("select max(mode) from wide").item() == "TROT"
    mixed = "select run, min(mode), max(mode) from wide group by run order by run"
    assert asked("number").sql(mixed).rows() == [("enum.silo", 0, 1), ("number.silo", 0, 11)]
    mixed = "select run, max(mode), max(mode_text) from wide group by run order by run"
    assert asked("text").sql(mixed).rows() == [
        ("enum.silo", 1, "TROT"), ("number.silo", 11, None), ("text.silo", None, "b")
    ]  # fmt: skip


def test_elements_that_are_called_like_folders_of_an_archive_are_not_hidden_by_them(tmp_path):
    at = np.arange(5)
    for run in ("a", "b"):
        elements = [element("x", at), *([element(name, at + 100) for name in ("run", "robot")] if run == "a" else [])]
        silo.Log(Recording("dog", at, 5, elements)).save(tmp_path / f"{run}.silo")
    there = Archive(str(tmp_path / "archive"))
    there.add(silo.runs(tmp_path))
    whole = polars.scan_parquet(
        f"{there.where}/wide/**/*.parquet", hive_partitioning=True, missing_columns="insert", extra_columns="ignore"
    )
    assert whole.select("run", "robot", "run_2").collect().row(-6) == ("a.silo", "dog", 104)
    assert there.sql("select max(run_2) from wide").item() == 104
    assert there.sql("select max(value) from samples where signal = 'robot'").item() == 104


def test_programs_are_told_times_to_the_nanosecond(tmp_path):
    stamps = 1_700_000_000 * 10**9 + np.arange(2) * 10_000_001
    silo.Log(Recording("dog", stamps, 2, [element("x", np.arange(2.0))])).save(tmp_path / "run.silo")
    asked = "select time from wide order by t desc limit 1"
    shown = CliRunner().invoke(cli, ["query", asked, "--in", str(tmp_path), "--json"])
    (row,) = json.loads(shown.stdout)
    digits = "010000000" if version("duckdb") < "2" else "010000001"  # of the one for Python 3.10
    assert row["time"] == f"2023-11-14T22:13:20.{digits}Z"


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_lists_and_what_else_no_cell_holds_are_written_as_json(written, tmp_path, ending):
    file = tmp_path / f"rows.{ending}"
    asked = "select *, ['wet'] as wet, {'a': 1} as pair, 'ab'::blob as raw from runs order by run"
    made = CliRunner().invoke(cli, ["query", asked, "--in", str(written), "--to", str(file)])
    assert made.output == f"{file}: {RUNS} rows\n"
    rows = polars.read_csv(file) if ending == "csv" else polars.read_parquet(file)
    found = rows.row(1, named=True)
    wanted = ("[]", '["wet"]', '{"a":1}', '"YWI="') if ending == "csv" else ([], ["wet"], {"a": 1}, b"ab")
    assert (found["tags"], found["wet"], found["pair"], found["raw"]) == wanted


def test_an_answer_that_no_table_here_holds_is_told_with_the_way_out(runs):
    with pytest.raises(ElementError, match=r"write epoch\(\.\.\.\) of an interval") as raised:
        runs.sql("select age(timestamp '2026-01-02', timestamp '2026-01-01') as apart from runs")
    assert "interval" in str(raised.value)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_an_answer_for_which_a_disk_has_no_room_leaves_no_half_of_it(written, tmp_path, monkeypatch, ending):
    def full(descriptor, buffers, offset):
        os.pwrite(descriptor, bytes(buffers[0])[:10], offset)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("silo.cli.logs.query.write_all", full, raising=False)
    monkeypatch.chdir(tmp_path)
    asked = ["query", "select * from signals", "--in", str(written), "--to", f"rows.{ending}"]
    made = CliRunner().invoke(cli, asked)
    assert made.exit_code == 1
    assert f"can't save 'rows.{ending}': No space left on device" in made.output
    assert not list(tmp_path.iterdir())


def test_of_an_archive_the_shell_asks_its_table_of_runs(archive):
    refused = CliRunner().invoke(cli, ["query", "select 1", "--in", archive.where, "--where", "kp > 1"])
    assert refused.exit_code == 2
    assert "--where is for folders of logs; of an archive ask the table `runs`" in refused.output


def test_the_shell_prints_writes_and_counts(written, tmp_path):
    def ran(*arguments, code=0):
        result = CliRunner().invoke(cli, list(map(str, arguments)), standalone_mode=False)
        assert (result.exit_code or result.return_value or 0) == code, result.output
        return result.output

    asked = "select run, max(slow) - 1152921504606846976 < 64 as most, max(word) w from wide group by run order by run"
    assert ran("query", asked, "--in", written, "--where", "last(kp) > 25").splitlines()[1].split() == [
        "run3.silo",
        "True",
        "w3",
    ]
    assert json.loads(ran("query", "select ticks from runs limit 1", "--in", written, "--json")) == [{"ticks": TICKS}]
    ran("query", "select * from runs", "--in", written, "--to", tmp_path / "runs.parquet")
    assert len(polars.read_parquet(tmp_path / "runs.parquet")) == RUNS
    assert "60 rows more" in ran("query", "select t from wide", "--in", written)
    ran("query", "select 1", "--to", tmp_path / "runs.parquet", code=1)
    assert "4 files added" in ran("archive", written, tmp_path / "kept")
    assert "0 files added (0 B), 4 there already" in ran("archive", written, tmp_path / "kept")
    assert "4 files, 0 not as archived" in ran("archive", "--check", tmp_path / "kept")
    assert "run3.silo" in ran("query", asked, "--in", tmp_path / "kept")
    next((tmp_path / "kept").rglob("run=run2.silo/run.parquet")).write_bytes(b"PAR1")
    assert "run2.silo: it isn't what was archived" in ran("archive", "--check", tmp_path / "kept", code=4)


def test_an_archived_run_is_the_run(archive, runs):
    for run in runs:
        (file,) = Path(archive.where).rglob(f"run={run.facts.path}/run.parquet")
        assert f"robot={run.facts.robot}" in file.parts
        assert not silo.compare(run.open(), silo.open_log(file))


@pytest.mark.parametrize("name", ["測定結果二〇二六年十一月" * 3, "a/" * 60 + "walk", "x" * 250])
def test_a_run_of_a_name_that_fits_no_folder_is_archived_as_all_others(written, tmp_path, name):
    path = tmp_path / "logs" / f"{name}.silo"
    path.parent.mkdir(parents=True)
    shutil.copy(written / "run1.silo", path)
    shutil.copy(written / "run2.silo", tmp_path / "logs" / "zz.silo")
    there = Archive(str(tmp_path / "archive"))
    assert not there.add(silo.runs(tmp_path / "logs")).problems
    assert set(there.sql("select distinct run from wide")["run"]) == {f"{name}.silo", "zz.silo"}
    assert there.add(silo.runs(tmp_path / "logs")).kept == 2
    assert not there.check()


def test_another_engine_answers_the_same(archive):
    everything = polars.scan_parquet(
        f"{archive.where}/wide/**/*.parquet", hive_partitioning=True, missing_columns="insert", extra_columns="ignore"
    )
    answers = everything.group_by("run").agg(polars.col("joints/tau_x").max()).sort("run").collect()
    assert answers.rows() == archive.sql('select run, max("joints/tau_x") from wide group by run order by run').rows()


def test_an_archive_in_a_folder_whose_name_reads_as_a_glob_is_one_like_any_other(runs, tmp_path):
    there = Archive(str(tmp_path / "logs [2026] of a?b*"))
    assert len(there.add(runs).added) == RUNS
    again = Archive(there.where)
    assert (again.add(runs).kept, again.check()) == (RUNS, {})
    asked = "select run, max(slow) as most, count(*) as ticks from wide group by run order by run"
    assert again.sql(asked).rows() == runs.sql(asked).rows()


def test_runs_of_one_name_from_two_places_are_kept_apart(runs, written, tmp_path):
    one = Archive(str(tmp_path / "a"))
    one.add(runs)
    other = tmp_path / "logs"
    other.mkdir()
    (other / "run0.silo").write_bytes((written / "run0.silo").read_bytes())
    silo.runs(other)[0].tag("other")
    before = one.frame("runs").rows()
    assert "give these another" in one.add(silo.runs(other)).problems["run0.silo"]
    assert one.frame("runs").rows() == before, "of what was refused the tables have nothing"
    assert one.add(silo.runs(other), name="desk").added == ["desk/run0.silo"]
    assert one.sql("select count(*) from runs").item() == RUNS + 1
    os.utime(other / "run0.silo", ns=(1, 1))
    assert one.add(silo.runs(other), name="desk").added == ["desk/run0.silo"]
    assert one.sql("select count(*), count(distinct run) from runs").row(0) == (RUNS + 1, RUNS + 1)


@pytest.mark.slow
def test_tables_that_many_write_at_once_have_all_runs(warm, written, tmp_path):
    """Each of several processes adds a run of its own."""
    to, went = str(tmp_path / "kept"), "import sys, silo; from silo.run_index.archive import Archive as A\n"
    went += "r = silo.runs(sys.argv[1])[int(sys.argv[3]):][:1]; a = A(sys.argv[2]); input(); a.add(r)"
    silo.runs(written)
    Archive(to).add(silo.runs(written)[:0])
    each = [
        subprocess.Popen([sys.executable, "-c", went, written, to, str(number)], stdin=subprocess.PIPE)
        for number in range(RUNS)
    ]
    for one in each:
        one.communicate(b"\n")
    assert not any(one.returncode for one in each)
    there = Archive(to)
    for table in ("runs", "signals"):
        assert there.sql(f"select count(distinct run) from {table}").item() == RUNS
    assert not there.check()
    for table in ("signals", "runs"):
        rows = there.frame(table)
        rows.filter(polars.col("run") != "run1.silo").write_parquet(f"{to}/{table}.parquet")
        assert "not in its tables" in there.check()["run1.silo"]
        rows.write_parquet(f"{to}/{table}.parquet")


def test_a_run_that_left_an_archive_is_told_by_its_name(archive):
    with pytest.raises(ElementError, match=r"no run 'gone\.silo': ask again"):
        archive.read("gone.silo", ["slow"])


@pytest.mark.parametrize("door", [
    lambda one: one.exists, lambda one: one.manifest(), lambda one: one.frame("runs"), lambda one: one.check(),
    lambda one: one.read("run0", ["slow"]), lambda one: one._parts(), lambda one: one.sql("select * from runs"),
])  # fmt: skip
def test_a_store_that_fails_is_told_by_its_name_through_every_door(archive, door):
    class Failing:
        def __getattr__(self, name):
            raise TimeoutError("no answer")

    broken = Archive(archive.where)
    broken._files = Failing()
    with pytest.raises(SaveError, match=f"the archive '{archive.where}' can't be reached: no answer"):
        door(broken)


def test_a_store_elsewhere_is_one_too_and_a_password_in_a_url_is_refused(runs):
    there = Archive("memory://robots/runs")
    assert len(there.add(runs).added) == RUNS
    assert there.sql("select count(slow) from wide").item() == RUNS * TICKS // 4
    assert not there.check()
    with pytest.raises(ElementError, match="environment"):
        Archive("s3://key:secret@bucket/runs")
    with pytest.raises(SiloError) as refused:
        Archive("nothing://x")
    assert "nothing" in str(refused.value)


ARCHIVED = """
import itertools, os, signal, sys
from contextlib import contextmanager
import silo
from silo.run_index import archive
folder, to, steps = sys.argv[1:]
left, real = itertools.count(int(steps), -1), archive.atomic_file

@contextmanager
def dying(path):
    with real(path) as file:
        if next(left) <= 0:
            os.kill(os.getpid(), signal.SIGKILL)
        yield file

archive.atomic_file = dying
archive.Archive(to).add(silo.runs(folder))
"""


@pytest.mark.slow
def test_what_was_interrupted_anywhere_goes_on_without_loss_and_without_double(warm, written, tmp_path):
    to = str(tmp_path / "kept")
    ends = []
    for steps in range(1, 12, 2):  # it dies at the n-th time that something is written
        ends.append(subprocess.run([sys.executable, "-c", ARCHIVED, written, to, str(steps)], check=False).returncode)
        there = Archive(to)
        assert not there.exists or all("not in its tables" in one for one in there.check().values())
    assert ends[0] == -signal.SIGKILL
    assert set(ends) <= {-signal.SIGKILL, 0}
    assert not there.add(silo.runs(written)).problems
    assert there.sql("select count(*), count(distinct run) from runs").row(0) == (RUNS, RUNS)
    assert there.sql("select count(slow) from wide").item() == RUNS * TICKS // 4
    assert len(list(Path(to).rglob("run.parquet"))) == RUNS
    assert not list(Path(to).rglob("*.part"))


def test_a_row_is_a_tick_of_a_run_that_was_cut_whichever_signals_are_asked_for(tmp_path):
    log = silo.Logger("arm", frequency=100, folder=tmp_path, script=tmp_path / "none.yaml")
    x, y = log.array("x"), log.array("y", divider=2)
    log.start()
    for tick in range(100):
        x[...] = y[...] = tick
        log.collect()
        if tick == 39:
            log.set("y", divider=5, cut=True)
    log.save()
    log.close()
    slow = len(range(0, 40, 2)) + len(range(0, 60, 5))
    runs = silo.runs(tmp_path)
    for asked, told in (
        ("count(*)", [(100,)]),
        ("count(y)", [(slow,)]),
        ("count(*), count(y)", [(100, slow)]),
        ("count(*), count(x), count(y)", [(100, 100, slow)]),
    ):
        assert runs.sql(f"select {asked} from wide").rows() == told
