"""Who may open the page of `silo-tui --serve`."""

import pytest
from click.testing import CliRunner

from silo_tui.cli import command
from silo_tui.web.guard import HEADERS, new_token, refusal

TOKEN = "t0ken"
OURS = "http://127.0.0.1:8000"


def asked(path=f"/{TOKEN}/", host="127.0.0.1:8000", origin=None, *, is_socket=False):
    return refusal(path, host, origin, TOKEN, is_socket=is_socket)


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost:8000", "[::1]:8000", "LOCALHOST:9", "localhost"])
def test_who_knows_the_token_is_let_in_by_every_name_of_this_computer(host):
    assert asked(host=host) == ""
    assert asked(f"/{TOKEN}/ws", host, f"http://{host}", is_socket=True) == ""


@pytest.mark.parametrize(
    "path", ["/", "", f"//{TOKEN}x/", "/t0keN/", "/t0ke/", "/ws", "/static/js/textual.js", f"/x/{TOKEN}/"]
)
def test_without_the_token_nothing_is_told(path):
    assert "token" in asked(path)


@pytest.mark.parametrize(
    "host", ["", "evil.example", "127.0.0.1.evil.example", "robot:8000", "localhost:8000@evil", "0.0.0.0:8000"]
)
def test_a_name_bent_to_this_computer_is_refused(host):
    assert "no address of this computer" in asked(host=host)


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "", "http://localhost:8000", "http://127.0.0.1:3000", "https://127.0.0.1:8000"],
)
def test_another_page_is_refused_with_the_token_too(origin):
    assert asked(f"/{TOKEN}/ws", origin=origin, is_socket=True)
    assert asked(origin=origin)


def test_a_socket_has_to_say_where_it_is_from():
    assert asked(f"/{TOKEN}/ws", is_socket=True)
    assert asked(f"/{TOKEN}/ws", origin=OURS, is_socket=True) == ""


def test_tokens_differ_and_fit_into_an_address():
    tokens = {new_token() for _ in range(100)}
    assert len(tokens) == 100
    assert all(len(token) == 32 and token.replace("-", "").replace("_", "").isalnum() for token in tokens)


def test_a_page_may_load_nothing_from_outside():
    assert "default-src 'none'" in HEADERS["Content-Security-Policy"]
    assert "http" not in HEADERS["Content-Security-Policy"]


@pytest.mark.parametrize("arguments", [["--control"], ["--port", "8000"]])
def test_what_belongs_to_serve_is_refused_without_it(arguments):
    done = CliRunner().invoke(command, arguments)
    assert done.exit_code == 2
    assert "--serve" in done.output
