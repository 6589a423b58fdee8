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


def test_loading_a_script_changes_the_table(bench, client, heard) -> None:
    (bench.script.parent / "a.yaml").write_text(SCRIPT + "  - name: /log/nix\n    enabled: true\n")
    applied = client.load_script("a.yaml")
    assert applied.unknown == ["/log/nix"]
    assert bench.logger.elements[0].options.divider == 7
    assert "1 names are not in the table" in heard.wait(EventKind.SCRIPT_LOADED).text


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


def test_a_time_in_a_script_follows_the_rate_of_the_logger(bench, client) -> None:
    (bench.script.parent / "a.yaml").write_text(SCRIPT + "    buffer: {size: 7s}\n")
    client.load_script("a.yaml")
    assert bench.logger.elements[0].options.size == bench.logger.options.frequency_hz


def test_loading_is_refused_while_running(bench, client) -> None:
    (bench.script.parent / "a.yaml").write_text(SCRIPT)
    client.start()
    assert refused(client.load_script, "a.yaml") is RefusedWhy.RUNNING


def test_a_table_that_changes_while_a_script_is_loaded_is_compared_anew(bench, client) -> None:
    (bench.script.parent / "a.yaml").write_text(SCRIPT)
    with ThreadPoolExecutor() as pool:
        with bench.logger._life.lock:  # so that the helper process learns of it only after it sent its edits
            bench.logger.set("q", divider=3)
            loaded = pool.submit(client.load_script, "a.yaml")
            select.select([bench.serving._helper.link], [], [])
        assert loaded.result().changed == 1
    assert [info.options.divider for info in bench.logger.elements[:2]] == [7, 3]


def test_loading_on_an_old_revision_conflicts(bench, client) -> None:
    (bench.script.parent / "a.yaml").write_text(SCRIPT)
    revision = client.table().revision
    client.load_script("a.yaml", revision)
    (bench.script.parent / "a.yaml").write_text(SCRIPT.replace("7", "8"))
    assert refused(client.load_script, "a.yaml", revision) is RefusedWhy.CONFLICT


def test_wrong_script_is_refused_with_file_and_line(bench, client) -> None:
    (bench.script.parent / "bad.yaml").write_text(SCRIPT.replace("7", "0"))
    with pytest.raises(RefusedError, match=r"bad\.yaml:4"):
        client.load_script("bad.yaml")
    assert bench.logger.elements[0].options.divider == 1


def test_diff_says_what_loading_would_change(bench, client) -> None:
    (bench.script.parent / "a.yaml").write_text(SCRIPT)
    changes = client.diff_script("a.yaml").changes
    assert [(change.name, change.field, change.old, change.new) for change in changes] == [
        ("/log/x", "divider", "1", "7")
    ]


def test_script_without_path_is_the_running_configuration(bench, client) -> None:
    text = client.read_script()
    assert text.path == str(bench.script)
    assert "name: /log/mixed" in text.text


def test_saved_script_is_read_back(bench, client) -> None:
    assert str(bench.script) in client.save_script()
    assert client.diff_script().changes == []


def test_existing_script_is_only_replaced_on_demand(bench, client) -> None:
    bench.script.write_text("mine")
    assert refused(client.save_script) is RefusedWhy.EXISTS
    assert bench.script.read_text() == "mine"
    client.save_script("", overwrite=True)
    assert bench.script.read_text() != "mine"


def test_missing_script_is_told(client) -> None:
    assert refused(client.load_script, "nix.yaml") is RefusedWhy.NOT_FOUND


def test_saving_into_a_missing_folder_makes_it(bench, client) -> None:
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
