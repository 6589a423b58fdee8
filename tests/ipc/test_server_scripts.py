"""Scripts on the robot's side, and nothing but scripts."""

import os
import select
from concurrent.futures import ThreadPoolExecutor

import pytest

from silo.errors import RefusedError
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy

SCRIPT = "log_elements:\n  - name: /log/x\n    enabled: true\n    divider: 7\n"


def refused(call, *arguments: object) -> RefusedWhy:
    with pytest.raises(RefusedError) as error:
        call(*arguments)
    return error.value.why


def test_scripts_in_the_folder_and_below_are_listed(bench, client) -> None:
    folder = bench.script.parent
    (folder / "deep" / "er").mkdir(parents=True)
    for name in ("bot.yaml", "b.yml", "deep/c.yaml", "deep/er/d.YAML", "notes.txt", ".hidden.yaml"):
        (folder / name).write_text(SCRIPT)
    assert client.scripts().names == ["b.yml", "bot.yaml", "deep/c.yaml", "deep/er/d.YAML"]
    assert client.scripts().folder == str(folder)


def test_links_that_lead_out_of_the_folder_are_not_listed(bench, client, tmp_path) -> None:
    (tmp_path / "secret.yaml").write_text("x")
    (bench.script.parent / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    assert client.scripts().names == []


def test_unknown_keys_are_told_with_their_line_and_kept(bench, client, heard) -> None:
    bench.script.write_text(SCRIPT + "    dividr: 3\nversion: 2\n")
    warnings = [
        f"{bench.script}:5: element '/log/x': unknown key 'dividr' in an element; did you mean 'divider'?",
        f"{bench.script}:6: unknown key 'version' in a script; "
        "known are log_elements, derived_signals, signal_limits, triggers",
    ]
    assert (
        client.diff_script().warnings == client.load_script().warnings == [f"{w}; it was left alone" for w in warnings]
    )
    assert "2 keys are unknown and were left alone" in heard.wait(EventKind.SCRIPT_LOADED).text
    saved = client.save_script("", overwrite=True)
    assert saved.endswith("kept what silo doesn't know: dividr of /log/x, version")
    assert client.diff_script().warnings[0].partition(": ")[2] == f"{warnings[0].partition(': ')[2]}; it was left alone"


def test_a_time_in_a_script_follows_the_rate_of_the_logger(bench, client, heard) -> None:
    script = SCRIPT + "    buffer: {size: 7s}\n  - name: /log/nix\n    enabled: true\n"
    (bench.script.parent / "a.yaml").write_text(script)
    client.load_script("a.yaml")
    assert "1 names are not in the table" in heard.wait(EventKind.SCRIPT_LOADED).text
    assert bench.logger.elements[0].options.size == bench.logger.options.frequency_hz


def test_a_table_that_changes_while_a_script_is_loaded_is_compared_anew(bench, client) -> None:
    (bench.script.parent / "a.yaml").write_text(SCRIPT)
    with ThreadPoolExecutor() as pool:
        with bench.logger._life.lock:  # so that the helper process learns of it only after it sent its edits
            bench.logger.set("q", divider=3)
            loaded = pool.submit(client.load_script, "a.yaml")
            select.select([bench.serving._helper.link], [], [])
        assert loaded.result().changed == 1
    assert [info.options.divider for info in bench.logger.elements[:2]] == [7, 3]


def test_saving_into_a_missing_folder_makes_it(bench, client) -> None:
    assert (client.read_script().path in client.save_script(), client.diff_script().changes) == (True, [])
    client.save_script("new/a.yaml")
    assert (bench.script.parent / "new" / "a.yaml").is_file()


ESCAPES = ["../a.yaml", "/etc/a.yaml", "x/../../a.yaml", "link.yaml", "folder/a.yaml", "a\x00.yaml", "a\n.yaml"]


def test_paths_that_clients_may_not_use(bench, client, tmp_path) -> None:
    (tmp_path / "a.yaml").write_text(SCRIPT)
    (bench.script.parent / "link.yaml").symlink_to(tmp_path / "a.yaml")
    (bench.script.parent / "folder").symlink_to(tmp_path)
    for path in [*ESCAPES, "a.txt", "a", ".", "y" * 2000 + ".yaml"]:
        for call in (client.read_script, client.diff_script, client.load_script, client.save_script):
            assert refused(call, path) in (RefusedWhy.FORBIDDEN, RefusedWhy.INVALID), path
    assert (tmp_path / "a.yaml").read_text() == SCRIPT


def test_named_pipe_stalls_nobody(bench, client) -> None:
    os.mkfifo(bench.script.parent / "pipe.yaml")
    # a helper that opened it would wait for its writer, and the client for an answer until it gives up
    assert refused(client.read_script, "pipe.yaml") is RefusedWhy.INVALID


def test_huge_script_is_not_read(bench, client) -> None:
    (bench.script.parent / "huge.yaml").write_bytes(b"#" * 3_000_000)
    assert refused(client.read_script, "huge.yaml") is RefusedWhy.INVALID


def test_own_script_may_be_a_link_that_the_robot_program_chose(bench, client, tmp_path) -> None:
    (tmp_path / "elsewhere.yaml").write_text(SCRIPT)
    bench.script.symlink_to(tmp_path / "elsewhere.yaml")
    client.load_script()
    assert bench.logger.elements[0].options.divider == 7
