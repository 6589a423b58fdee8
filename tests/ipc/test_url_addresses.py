"""One URL names a topic: for Python, for the commands, and, by what `silo address` prints, for Zenoh anywhere."""

import json
import select
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.cli.main import run
from silo.errors import ConnectionLostError, ElementError
from silo.net.configuration import remote_file
from silo.net.found import Address, LoggerAddress, logger_of, parse_url, url_of
from silo.net.session import zenoh_settings
from tests.waiting import DEADLINE_S

PROTOCOL = Path(__file__).parents[2] / ".docs" / "protocol.md"


class TestUrls:
    @pytest.mark.parametrize(
        ("url", "logger", "element"),
        [
            ("silo://robot3/anymal", "robot3/anymal", ""),
            ("silo://robot3/anymal/log/joints/q", "robot3/anymal", "/log/joints/q"),
            ("silo://robot3~3fa977b2e0/anymal/x", "robot3~3fa977b2e0/anymal", "/x"),
            ("silo:///anymal.4711/log/x", "anymal.4711", "/log/x"),
        ],
    )
    def test_a_url_names_a_logger_and_an_element_and_is_made_of_them(self, url, logger, element):
        assert parse_url(url) == Address(logger, element)
        assert url_of(logger, element) == url

    @pytest.mark.parametrize(
        "url", ["silo://", "silo://robot3", "silo:///", "silo://a b/c", "http://a/b", "silo:anymal"]
    )
    def test_what_names_no_logger_is_refused_with_the_form_that_does(self, url):
        with pytest.raises(ConnectionLostError, match="is no address of a logger: write silo://HOST/LOGGER"):
            parse_url(url)

    def test_where_a_whole_logger_is_meant_an_element_is_refused(self):
        assert logger_of("silo://robot3/anymal") == "robot3/anymal"
        assert logger_of("anymal") == "anymal"
        with pytest.raises(ConnectionLostError, match="names an element, and this is for a whole logger: silo://r/a;"):
            logger_of("silo://r/a/log/x")

    def test_a_configuration_of_a_remote_has_paths_that_hold_anywhere(self, tmp_path, monkeypatch):
        monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
        file = remote_file("lab")
        file.parent.mkdir(parents=True)
        tls = '{ root_ca_certificate: "ca.pem" }'
        file.write_text(f'{{ connect: {{ endpoints: ["tls/robot3:7447"] }}, transport: {{ link: {{ tls: {tls} }} }} }}')
        settings = zenoh_settings(LoggerAddress("anymal", 0, "", "", config="lab", host="robot3", id="0011223344"))
        assert settings["connect"] == {"endpoints": ["tls/robot3:7447"]}
        assert settings["mode"] == "client"
        assert settings["transport"]["link"]["tls"] == {"root_ca_certificate": str(file.parent / "ca.pem")}


def written(folder: Path, heading: str, language: str) -> tuple[Path, Path, str]:
    """Settings of the logger, a program of the protocol's page in a language, and where the logger's keys begin."""
    file, program = folder / "bot.json5", folder / f"program.{language}"
    file.write_text(CliRunner().invoke(cli, ["address", "bot", "--zenoh"]).output)
    program.write_text(PROTOCOL.read_text().split(f"### {heading}\n")[1].split(f"```{language}\n")[1].split("```")[0])
    printed = json.loads(CliRunner().invoke(cli, ["address", "bot", "--json"]).output)
    return file, program, printed["key"].removesuffix("/topic/**")


def connections() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "silo-client"]


class TestTopics:
    def test_a_topic_is_read_by_its_url_alone_and_its_connection_ends_with_it_or_where_it_is_refused(self, bench):
        bench.logger.start()
        with silo.topic("silo:///bot/log/q") as topic:
            while not (batches := topic.read(timeout_s=0.2)):
                bench.ticks(1)
            assert batches[0].values.shape[1:] == (3,)
            assert len(connections()) == 1
        assert connections() == []
        for url, why in (
            ("silo:///bot/log/r", "has no element"),
            ("silo:///bot", "names no element: write silo:///bot/joints/q"),
        ):
            with pytest.raises(ElementError, match=why):
                silo.topic(url)
            assert connections() == []

    def test_the_program_of_the_protocol_reads_it_by_what_the_command_prints(self, bench, tmp_path):
        printed = json.loads(CliRunner().invoke(cli, ["address", "bot", "q", "--json"]).output)
        assert parse_url(printed["url"]).element == "/log/q"
        file, program, _ = written(tmp_path, "Programs that read a topic", "python")
        bench.q[:] = 1, 2, 3
        bench.logger.start()
        command = [sys.executable, str(program), str(file), printed["key"]]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as reader:
            while not select.select([reader.stdout], [], [], 0.05)[0]:
                bench.ticks(1)
            first, time_ns, *values = reader.stdout.readline().split(maxsplit=2)
            reader.terminate()
        assert values == ["[1. 2. 3.]\n"]
        assert int(time_ns) in range(bench.begin_ns, bench.now_ns)
        assert int(first) >= 0

    def test_the_program_of_the_protocol_changes_it_by_what_the_command_prints(self, bench, tmp_path):
        file, program, root = written(tmp_path, "Programs that change something", "python")
        command = [sys.executable, str(program), str(file), root, "/log/q"]
        done = subprocess.run([*command, "5"], capture_output=True, text=True, check=True, timeout=DEADLINE_S)
        assert done.stdout.startswith("{'type': 'EditsApplied'")
        assert bench.logger["q"].options.divider == 5
        refused = subprocess.run([*command, "0"], capture_output=True, text=True, check=True, timeout=DEADLINE_S)
        assert "divider must be a whole number from 1 to" in refused.stdout
        assert bench.logger["q"].options.divider == 5

    def test_the_program_in_c_stops_it(self, bench, tmp_path):
        file, source, root = written(tmp_path, "Programs that change something", "c")
        made = ["cc", str(source), "-o", str(tmp_path / "stop"), "-lzenohc"]
        if shutil.which("cc") is None or subprocess.run(made, capture_output=True, check=False).returncode:
            pytest.skip("needs cc and zenoh-c")
        bench.logger.start()
        subprocess.run([tmp_path / "stop", file, f"{root}/do/@local"], check=True, timeout=DEADLINE_S)
        assert not bench.logger.is_running

    def test_its_url_is_taken_by_the_commands(self, bench, capsys):
        assert run(["address", "bot", "x"]) == 0
        url = capsys.readouterr().out.split()[1]
        assert run(["address", "bot", "kept", "--json"]) == 0
        out, err = capsys.readouterr()
        assert "'/log/kept' is saved but not published, so nothing comes: " in err
        assert json.loads(out)["url"].endswith("/log/kept")
        bench.start(3)
        assert run(["watch", url, "--count", "1", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["values"]["/log/x"] == 3
        assert run(["stop", url]) != 0  # its logger was not meant
        assert bench.logger.is_running

    def test_where_many_can_be_meant_a_url_means_its_logger(self, bench, capsys):
        assert run(["ls", "silo:///bot", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)[0]["logger"] == "bot"
        bench.logger.start()
        assert run(["stop", "silo:///bot", "--all"]) == 0
        assert not bench.logger.is_running
        assert run(["stop", "silo:///bot/log/x", "--all"]) != 0
        assert "names an element" in capsys.readouterr().err
