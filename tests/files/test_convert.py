"""Logs converted by the endings of their names, read back with the tools that people have."""

import json
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.core.recording import Recording
from silo.errors import FileFormatError, LogNotFoundError, SaveError, SiloError
from silo.files.atomic import sweep_parts
from silo.files.bags.writer import write_bag
from silo.files.convert import convert
from silo.files.formats import format_of, read_recording, writer_for
from silo.files.silo.writer import write_silo
from tests.later import Later
from tests.stand_ins import saved

h5py, pd, pl, pq, scipy_io = map(Later, ("h5py", "pandas", "polars", "pyarrow.parquet", "scipy.io"))

TICKS = 20
TIMES = 1_700_000_000_000_000_001 + 2_500_001 * np.arange(TICKS, dtype=np.int64)
ENDINGS = [".silo", ".csv", ".mcap", ".rosbag2", ".bag", "", ".parquet", ".mat", ".npz", ".h5"]


def element(name, columns, **more):
    return saved.element(name, columns, "Nm", description="what it is", prefix="", **more)


NAN_FIRST = np.array([np.nan, *range(1, TICKS)])
MODE = np.array([0, 1, 2, 1] * 5, dtype="i1")


def files_of(target):
    """The names that a log takes in its folder."""
    beside = format_of(target).beside
    return [target.name, f"{target.name}{beside}"] if beside else [target.name]


@pytest.fixture(scope="module")
def log() -> Recording:
    table = [
        element("/log/x", [NAN_FIRST]),
        element("/log/slow", [np.array([10.5, 11.5, 12.5])], divider=8, first=1),
        element("/log/mode", [MODE], labels={0: "stand", 1: "walk"}),
        element("/log/text", [np.array([b"a", "Ω".encode(), b"", b"long one"] * 5)]),
        element("/log/on", [MODE == 1]),
        element("/log/v", [np.arange(TICKS) * 1.0 + i for i in range(3)], suffixes=("_x", "_y", "_z")),
        element(
            "/log/m",
            [np.full(TICKS, i, "<i4") for i in range(4)],
            suffixes=("_0_0", "_0_1", "_1_0", "_1_1"),
            kind="matrix",
            shape=(2, 2),
        ),
        element(
            "/log/foot", [np.arange(TICKS) * 1.0, MODE == 0], suffixes=("_force", "_contact"), kind="struct", shape=()
        ),
        element("/log/z", [np.arange(TICKS) * 1j]),
        element("/log/long", [np.arange(TICKS, dtype=np.longdouble)]),
        element("/log/half", [np.arange(TICKS, dtype=np.float16)]),
        element("/log/never", [np.zeros(0)]),
    ]
    return Recording("robot", TIMES, TICKS, table, frequency_hz=400.0, started_ns=5)


@pytest.fixture
def source(log, tmp_path):
    path = tmp_path / "in.mcap"
    write_bag(log, path)
    return path


@pytest.fixture(scope="module")
def converted(log, tmp_path_factory):
    """The log in the format of an ending, from a bag."""
    folder = tmp_path_factory.mktemp("converted")
    write_bag(log, folder / "in.mcap")

    def to(ending):
        convert(folder / "in.mcap", folder / f"out{ending}")
        return folder / f"out{ending}"

    return to


@pytest.fixture(scope="module")
def parquet(converted):
    return converted(".parquet")


@pytest.fixture(scope="module")
def variables(converted):
    return scipy_io.loadmat(converted(".mat"), simplify_cells=True)


@pytest.fixture(scope="module")
def arrays(converted):
    return np.load(converted(".npz"))


@pytest.fixture(scope="module")
def store(converted):
    with h5py.File(converted(".h5")) as opened:
        yield opened


@pytest.mark.parametrize("ending", [".parquet", ".mat"])
def test_long_doubles_that_a_format_rounds_are_told_and_none_of_those_that_it_holds(tmp_path, log, ending):
    third = element("/log/third", [np.full(TICKS, np.longdouble(1) / 3)])
    write_bag(replace(log, elements=[*log.elements, third]), tmp_path / "in.mcap")
    target = tmp_path / f"out{ending}"
    told = f"/log/third: long doubles are rounded to 53 bits, as {ending} has none"
    assert [words.partition(" (")[0] for words in convert(tmp_path / "in.mcap", target).warnings] == [told]
    assert [words.partition(" (")[0] for words in read_recording(target).warnings] == [told]
    with pytest.warns(silo.LogWarning, match="/log/third: long doubles are rounded"):
        silo.open_log(tmp_path / "in.mcap").save(target, overwrite=True)
    assert convert(tmp_path / "in.mcap", tmp_path / "out.npz").warnings == []


class TestParquet:
    def test_pandas_has_time_stamps_to_the_nanosecond(self, parquet):
        frame = pd.read_parquet(parquet)
        assert frame["time_ns"].tolist() == TIMES.tolist()
        assert frame["time"].dt.as_unit("ns").astype("int64").tolist() == TIMES.tolist()

    def test_a_tick_without_sample_is_null_nan_stays_nan_and_a_complex_number_is_two_columns(self, parquet):
        table = pq.read_table(parquet)
        assert table["/log/z_imag"].to_pylist() == list(range(TICKS))
        assert table["/log/slow"].to_pylist() == [None, 10.5, *[None] * 7, 11.5, *[None] * 7, 12.5, None, None]
        assert np.isnan(table["/log/x"][0].as_py())
        assert table["/log/x"].null_count == 0
        assert table["/log/never"].null_count == TICKS

    def test_polars_has_strings_and_types(self, parquet):
        frame = pl.read_parquet(parquet)
        assert frame["/log/text"].to_list()[:4] == ["a", "Ω", "", "long one"]
        assert (frame["/log/mode"].dtype, frame["/log/on"].dtype) == (pl.Int8, pl.Boolean)

    def test_units_and_labels_are_metadata_of_the_columns(self, parquet):
        about = pq.read_schema(parquet).field("/log/mode").metadata
        assert about[b"unit"] == b"Nm"
        assert json.loads(about[b"labels"]) == {"0": "stand", "1": "walk"}

    def test_row_groups_bound_the_memory(self, source, tmp_path, monkeypatch):
        monkeypatch.setattr("silo.files.tables.parquet._MAX_ROWS", 7)
        convert(source, tmp_path / "out.parquet")
        assert pq.ParquetFile(tmp_path / "out.parquet").num_row_groups == 3
        assert pq.read_table(tmp_path / "out.parquet")["/log/slow"].to_pylist()[9] == 11.5


class TestMatlab:
    def test_an_element_is_a_struct_with_its_times_whose_stamps_follow_from_its_first_one_counted_from_1(
        self, variables
    ):
        slow, stamps = variables["log_slow"], variables["silo"]["time_ns"]
        assert (slow["name"], slow["unit"], slow["divider"]) == ("/log/slow", "Nm", 8)
        assert slow["data"].tolist() == [10.5, 11.5, 12.5]
        assert slow["time"].tolist() == pytest.approx(((TIMES[1::8] - TIMES[0]) / 1e9).tolist())
        assert stamps[int(slow["first"]) - 1 :: int(slow["divider"])][:3].tolist() == TIMES[1::8].tolist()

    def test_a_vector_is_one_matrix_mixed_types_are_columns_and_strings_and_labels_are_text(self, variables):
        assert variables["log_v"]["data"].shape == (TICKS, 3)
        assert list(variables["log_v"]["entries"]) == ["/log/v_x", "/log/v_y", "/log/v_z"]
        assert sorted(variables["log_foot"]["data"]) == ["contact", "force"]
        assert list(variables["log_text"]["data"][:2]) == ["a", "Ω"]
        assert list(variables["log_mode"]["label_names"]) == ["stand", "walk"]

    def test_names_that_matlab_would_cut_or_mix_up_stay_apart(self, tmp_path):
        names = ["/log/" + "long" * 20 + end for end in ("a", "b")] + ["/log/p q", "/log/p_q", "silo", "1st"]
        table = [element(name, [np.zeros(TICKS)]) for name in names]
        write_silo(Recording("robot", TIMES, TICKS, table), tmp_path / "in.silo")
        convert(tmp_path / "in.silo", tmp_path / "out.mat")
        found = [name for name in scipy_io.loadmat(tmp_path / "out.mat") if not name.startswith("__")]
        assert len(found) == 7
        assert all(name.isidentifier() and len(name) <= 63 for name in found)


class TestNumpy:
    def test_every_entry_keeps_its_type_and_bits(self, arrays, log):
        for recorded in log.elements:
            for entry in recorded.entries:
                stored = arrays[entry.name.lstrip("/")]
                assert stored.dtype == entry.values.dtype
                assert stored.tobytes() == entry.values.tobytes()

    def test_an_element_that_is_not_due_at_each_tick_has_times_of_its_own(self, arrays):
        assert arrays["time_ns"].tolist() == TIMES.tolist()
        assert arrays["log/slow.time_ns"].tolist() == TIMES[1::8].tolist()
        assert "log/x.time_ns" not in arrays

    def test_what_arrays_cannot_say_is_json(self, arrays):
        facts = json.loads(str(arrays["silo.json"]))
        assert facts["elements"][1]["divider"] == 8
        assert facts["elements"][2]["entries"][0]["labels"] == {"0": "stand", "1": "walk"}


class TestHdf5:
    def test_values_stand_with_times_shape_and_attributes_under_the_name_and_equal_times_once(self, store):
        assert store["log/slow/values"][:].tolist() == [10.5, 11.5, 12.5]
        assert store["log/slow/time_ns"][:].tolist() == TIMES[1::8].tolist()
        assert store["log/m/values"].shape == (TICKS, 2, 2)
        assert store["log/m/values"][0].tolist() == [[0, 1], [2, 3]]
        assert store["log/x/time_ns"] == store["time_ns"]
        about = store["log/mode"].attrs
        assert (about["unit"], about["description"], list(about["entries"])) == ("Nm", "what it is", ["/log/mode"])

    def test_names_that_are_also_groups_stay_apart(self, tmp_path):
        names = ["/log/a", "/log/a/values", "/log/a/time_ns", "/log/a/values/b"]
        table = [element(name, [np.full(TICKS, i)]) for i, name in enumerate(names)]
        write_silo(Recording("robot", TIMES, TICKS, table), tmp_path / "in.silo")
        convert(tmp_path / "in.silo", tmp_path / "out.h5")
        found = {}
        with h5py.File(tmp_path / "out.h5") as opened:
            opened.visititems(
                lambda _, item: found.update({item.attrs["name"]: item}) if "name" in item.attrs else None
            )
            first = {
                name: [d[0] for d in item.values() if isinstance(d, h5py.Dataset) and d.dtype != TIMES.dtype][:1]
                for name, item in found.items()
            }
        assert sorted(first) == sorted(names)


@pytest.mark.parametrize("ending", ENDINGS)
def test_progress_ends_at_one(ending, source, tmp_path):
    seen = []
    convert(source, tmp_path / f"out{ending}", seen.append)
    assert seen[-1] == 1.0


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_empty_log_converts_too(ending, tmp_path):
    write_silo(Recording("robot", np.zeros(0, dtype=np.int64), 0, []), tmp_path / "in.silo")
    convert(tmp_path / "in.silo", tmp_path / f"out{ending}")
    assert (tmp_path / f"out{ending}").exists()


@pytest.mark.parametrize("ending", [ending for ending in ENDINGS if ending not in (".silo", ".csv")])
def test_a_name_that_is_no_unicode_is_escaped(ending, tmp_path):
    odd = replace(element("/log/\udcff", [np.zeros(TICKS)], labels={0: "\ud800"}), unit="\udc80", description="\0")
    writer_for(tmp_path / f"out{ending}")(Recording("\udcff", TIMES, TICKS, [odd]), tmp_path / f"out{ending}", None)
    assert (tmp_path / f"out{ending}").exists()


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_existing_target_is_kept_without_force_and_replaced_with_it(ending, source, tmp_path):
    target = tmp_path / f"out{ending}"
    convert(source, target)
    with pytest.raises(SaveError, match="--force"):
        convert(source, target)
    before = target.stat().st_ino
    convert(source, target, force=True)
    assert target.stat().st_ino != before
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["in.mcap", *files_of(target)])


@pytest.mark.parametrize("ending", ENDINGS)
def test_ctrl_c_leaves_no_half_file_and_the_old_one_in_place(ending, source, tmp_path):
    target = tmp_path / f"out{ending}"
    convert(source, target)
    size = target.stat().st_size

    def interrupt(_fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert(source, target, interrupt, force=True)
    assert target.stat().st_size == size
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["in.mcap", *files_of(target)])


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_disk_that_is_full_is_a_save_error_and_leaves_nothing(ending, source, tmp_path, small_files):
    with small_files(600), pytest.raises(SaveError, match="out"):
        convert(source, tmp_path / f"out{ending}")
    assert [path.name for path in tmp_path.iterdir()] == ["in.mcap"]


def test_a_folder_that_is_no_bag_is_never_replaced(source, tmp_path):
    precious = tmp_path / "thesis"
    precious.mkdir()
    (precious / "chapter1").write_text("…")
    with pytest.raises(SaveError, match="not of a bag"):
        convert(source, precious, force=True)
    assert (precious / "chapter1").exists()


@pytest.mark.parametrize(
    ("given", "target", "error", "words"),
    [
        ("in.mcap", "out.xls", SaveError, r"can't write \.xls.*\.parquet"),
        ("in.xls", "out.csv", FileFormatError, r"doesn't read \.xls.*\.silo"),
        ("empty", "out.csv", FileFormatError, "without a bag"),
        ("no.silo", "out.csv", LogNotFoundError, r"no\.silo"),
    ],
)
def test_what_is_no_source_or_target_says_which_are(source, tmp_path, given, target, error, words):
    (tmp_path / "in.xls").write_text("")
    (tmp_path / "empty").mkdir()
    with pytest.raises(error, match=words):
        convert(tmp_path / given, tmp_path / target)


def test_of_what_can_not_be_read_at_all_nothing_is_written_and_the_last_warning_says_why(tmp_path, log, monkeypatch):
    nothing = replace(log, elements=[], warnings=("one topic is left out", "another is left out"))
    monkeypatch.setattr("silo.files.convert.read_recording", lambda *_, **__: nothing)
    with pytest.raises(FileFormatError) as refused:
        convert("in.mcap", tmp_path / "out.csv")
    assert str(refused.value) == "'in.mcap': nothing in it can be read, nothing was written: another is left out"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("ending", "module"), [(".parquet", "pyarrow"), (".mat", "scipy.io"), (".h5", "h5py")])
def test_a_missing_library_says_what_to_install(ending, module, source, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(SiloError, match=r'pip install "silo-logger\[convert\]"'):
        convert(source, tmp_path / f"out{ending}")
    assert [path.name for path in tmp_path.iterdir()] == ["in.mcap"]


KILLED = """
import os, signal, sys
from pathlib import Path
from silo.files import atomic, convert

def kill(*_):
    os.kill(os.getpid(), signal.SIGKILL)

where = sys.argv[3]
if where == "before":
    atomic._exchanged = kill
if where == "behind":
    whole = atomic._exchanged
    atomic._exchanged = lambda one, other: whole(one, other) and kill()
if where.startswith("between"):  # the file system exchanges nothing: killed at that rename
    atomic._exchanged = lambda one, other: False
    left, rename = int(where[-1]), Path.rename
    def renamed(path, target):
        global left
        if path.name == "bag.rosbag2" or Path(target).name == "bag.rosbag2":
            left -= 1
            if not left:
                kill()
        return rename(path, target)
    Path.rename = renamed
convert.convert(sys.argv[1], sys.argv[2], kill if where == "writing" else None, force=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("where", ["writing", "before", "behind", "between 1", "between 2", "between 3", "between 4"])
def test_a_kill_while_a_bag_is_replaced_hides_no_bag(where, source, tmp_path):
    target = tmp_path / "bag.rosbag2"
    convert(source, target)
    made = subprocess.run([sys.executable, "-c", KILLED, source, target, where], check=False, capture_output=True)
    assert made.returncode == -9 or where == "between 4", made.stderr.decode()
    for path in sweep_parts(tmp_path):
        assert path.name.startswith(".silo-")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag.rosbag2", "in.mcap"]
    assert len(silo.open_log(target)) == len(silo.open_log(source))


@pytest.mark.slow
def test_recover_gives_a_bag_its_name_back(source, tmp_path):
    target = tmp_path / "bag.rosbag2"
    convert(source, target)
    subprocess.run([sys.executable, "-c", KILLED, source, target, "between 3"], check=False, capture_output=True)
    assert not target.exists()
    listed = CliRunner().invoke(cli, ["recover", "--list", str(tmp_path)])
    assert f"{target}  a bag that lost its name" in listed.output
    assert "nothing to recover" not in listed.output
    assert not target.exists()
    found = CliRunner().invoke(cli, ["recover", str(tmp_path)])
    assert f"{target}: has its name again" in found.output
    assert "nothing to recover" not in found.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag.rosbag2", "in.mcap"]


def test_an_old_bag_that_an_earlier_silo_left_hidden_gets_its_name_back(source, tmp_path):
    convert(source, tmp_path / "walk")
    (tmp_path / "walk").rename(tmp_path / f".silo-{2**22 + 1}-abcdef01.old")
    assert sweep_parts(tmp_path) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.mcap", "walk"]


def test_a_disk_that_is_full_leaves_the_old_bag_and_names_it(source, tmp_path, small_files):
    target = tmp_path / "bag.rosbag2"
    convert(source, target)
    with small_files(600), pytest.raises(SaveError, match=rf"can't save '{target}'"):
        convert(source, target, force=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag.rosbag2", "in.mcap"]
    assert len(silo.open_log(target)) == len(silo.open_log(source))


def test_no_name_of_an_element_leads_out_of_the_folder_that_an_archive_is_unpacked_to(tmp_path):
    names = ("/log/a/../b", "/../x", "..", "/log/a..b/..c")
    elements = [saved.element(name, np.arange(4.0) + at) for at, name in enumerate(names)]
    silo.Log(Recording("robot", np.arange(4) * 10**9, 4, elements)).save(tmp_path / "a.npz")
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        assert not [name for name in archive.namelist() if ".." in Path(name).parts or name == "...npy"]
    back = silo.open_log(tmp_path / "a.npz")
    assert [back[name].values[0] for name in names] == [0.0, 1.0, 2.0, 3.0]
