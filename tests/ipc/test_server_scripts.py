"""Scripts on the robot's side, and nothing but scripts."""

import os
import select
from concurrent.futures import ThreadPoolExecutor

import pytest

from silo.cli.main import run
from silo.errors import RefusedError, SiloError
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy

SCRIPT = "log_elements:\n  - name: /log/x\n    enabled: true\n    divider: 7\n"


def refused(call, *arguments: object) -> RefusedWhy:
    with pytest.raises(RefusedError) as error:
        call(*arguments)
    return error.value.why


ESCAPES = ["../a.yaml", "/etc/a.yaml", "x/../../a.yaml", "link.yaml", "folder/a.yaml", "a\x00.yaml", "a\n.yaml"]


def test_scripts_in_the_folder_and_below_are_listed_and_nothing_else_is_listed_or_read(bench, client, tmp_path) -> None:
    folder = bench.script.parent
    (folder / "deep" / "er").mkdir(parents=True)
    for name in ("bot.yaml", "b.yml", "deep/c.yaml", "deep/er/d.YAML", "notes.txt", ".hidden.yaml"):
        (folder / name).write_text(SCRIPT)
    (tmp_path / "a.yaml").write_text(SCRIPT)
    (folder / "link.yaml").symlink_to(tmp_path / "a.yaml")
    (folder / "folder").symlink_to(tmp_path)
    assert client.scripts().names == ["b.yml", "bot.yaml", "deep/c.yaml", "deep/er/d.YAML"]
    assert client.scripts().folder == str(folder)
    for path in [*ESCAPES, "a.txt", "a", ".", "y" * 2000 + ".yaml"]:
        for call in (client.read_script, client.diff_script, client.load_script, client.save_script):
            assert refused(call, path) in (RefusedWhy.FORBIDDEN, RefusedWhy.INVALID), path
    assert (tmp_path / "a.yaml").read_text() == SCRIPT
    os.mkfifo(folder / "pipe.yaml")
    # a helper that opened it would wait for its writer, and the client for an answer until it gives up
    assert refused(client.read_script, "pipe.yaml") is RefusedWhy.INVALID
    (folder / "huge.yaml").write_bytes(b"#" * 3_000_000)
    assert refused(client.read_script, "huge.yaml") is RefusedWhy.INVALID


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
    told = heard.wait(EventKind.SCRIPT_LOADED).text
    assert told == f"script {bench.script} loaded: 1 element changed, 2 unknown keys left alone"
    saved = client.save_script("", overwrite=True)
    assert saved.endswith("kept what silo doesn't know: dividr of /log/x, version")
    assert client.diff_script().warnings[0].partition(": ")[2] == f"{warnings[0].partition(': ')[2]}; it was left alone"


def test_a_time_in_a_script_follows_the_rate_of_the_logger_and_what_became_of_a_rate_is_told(
    bench, client, heard
) -> None:
    script = SCRIPT + "    buffer: {size: 7s}\n  - name: /log/nix\n    enabled: true\n"
    (bench.script.parent / "a.yaml").write_text(script)
    client.load_script("a.yaml")
    path = bench.script.parent / "a.yaml"
    told = heard.wait(EventKind.SCRIPT_LOADED).text
    assert told == f"script {path} loaded: 1 element changed, 1 name not in the table"
    assert bench.logger.elements[0].options.size == bench.logger.options.frequency_hz
    path = bench.script.parent / "rate.yaml"
    path.write_text(SCRIPT.replace("7", "33Hz"))
    assert client.load_script("rate.yaml").warnings == [
        f"{path}:4: element '/log/x': divider=33Hz became 3: 33.33 Hz of 100 Hz"
    ]


def test_a_table_that_changes_while_a_script_is_loaded_is_compared_anew(bench, client) -> None:
    (bench.script.parent / "a.yaml").write_text(SCRIPT)
    with ThreadPoolExecutor() as pool:
        with bench.logger._life.lock:  # so that the helper process learns of it only after it sent its edits
            bench.logger.set("q", divider=3)
            loaded = pool.submit(client.load_script, "a.yaml")
            select.select([bench.serving._helper.link], [], [])
        assert loaded.result().changed == 1
    assert [info.options.divider for info in bench.logger.elements[:2]] == [7, 3]


def test_that_a_run_ends_by_itself_with_a_script_is_told_before_it_is_loaded(bench, client) -> None:
    for info in bench.logger.elements:
        bench.logger.set(info.name, buffer="looping")
    (bench.script.parent / "end.yaml").write_text(SCRIPT + "    buffer: {type: growing, size: 9}\n")
    end = client.diff_script("end.yaml").end
    assert end.startswith("logging stops by itself after ")
    assert client.load_script("end.yaml").warnings == [end]
    assert client.diff_script("end.yaml").end == ""


def test_saving_into_a_missing_folder_makes_it(bench, client) -> None:
    assert (client.read_script().path in client.save_script(), client.diff_script().changes) == (True, [])
    client.save_script("new/a.yaml")
    assert (bench.script.parent / "new" / "a.yaml").is_file()


def test_own_script_may_be_a_link_that_the_robot_program_chose(bench, client, tmp_path) -> None:
    (tmp_path / "elsewhere.yaml").write_text(SCRIPT)
    bench.script.symlink_to(tmp_path / "elsewhere.yaml")
    client.load_script()
    assert bench.logger.elements[0].options.divider == 7


WRONG = """\
derived_signals:
  - name: /log/power
    expression: x * nix
  - {name: /log/twice, expression: x}
signal_limits:
  - name: x
    bounds: [4, 3, 2, 1]
triggers:
  - name: fall
    when: abs(x > 5
  - {name: keeps, when: x > 1, keep: -1}
  - {name: edge, when: x > 1, slope: up}
  - {name: fine, when: twice > 1}
"""
WHERE = [
    (6, "derived_signals '/log/power': no signal is named 'nix'"),
    (10, "limits of 'x'"),
    (13, "triggers 'fall': '(' was never closed"),
    (15, "keep of trigger 'keeps' must be"),
    (16, "edge of trigger 'edge' must be rising, falling, level, enter or leave, got 'up'"),
]


def test_what_does_not_fit_of_conditions_is_told_with_file_and_line_wherever_it_is_read(bench, client, capsys) -> None:
    path = bench.script.parent / "wrong.yaml"
    path.write_text(SCRIPT + WRONG)
    before = (bench.logger.elements, client.triggers().triggers)
    told = []
    for call in (lambda: client.load_script("wrong.yaml"), lambda: bench.logger.load_script(path)):
        with pytest.raises(SiloError) as error:
            call()
        told.append(str(error.value))
    assert run(["script", "check", str(path), "--logger", "bot"]) == 1
    told.append(capsys.readouterr().err.removeprefix("silo: "))
    for text in told:
        lines = text.splitlines()
        assert len(lines) == len(WHERE), text
        for line, (number, words) in zip(lines, WHERE, strict=True):
            assert line.startswith(f"{path}:{number}: {words}"), line
        assert lines[-1].endswith("; nothing was changed")
    twice = "triggers:\n  - {name: a, when: x > 1}\n  - {name: a, when: x > 2}\n"
    path.write_text(SCRIPT + twice + "signal_limits:\n  - {name: a, bounds: [1, 2, 3, 4]}\n")
    both = rf"^{path}:7: triggers 'a': listed twice, first in line 6; nothing was changed$"
    with pytest.raises(SiloError, match=both):
        client.load_script("wrong.yaml")
    assert (bench.logger.elements, client.triggers().triggers) == before
