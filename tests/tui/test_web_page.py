"""silo-tui in a headless Chromium: live values, an edit by keys, a plot; nothing from outside, no strangers."""

import asyncio
import importlib.util
import re
import socket
import struct
import subprocess
import sys
import time

import pytest

from tests import chromium
from tests.waiting import DEADLINE_S

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("textual_serve") is None, reason="needs silo-logger[web]"),
]
needs_browser = pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium (apt install chromium)")


def accepts(host: str, port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((host, port)) == 0


@pytest.fixture
def served(tmp_path, monkeypatch):
    """`served("--control")` returns the address of a silo-tui with a demo robot."""
    runtime = tmp_path / "run"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(runtime))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    running = []

    def serve(*arguments):
        command = [sys.executable, "-m", "silo_tui", "--serve", "--demo", *arguments]
        program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        running.append(program)
        url = program.stdout.readline().strip()
        host, _, port = url.split("/")[2].partition(":")
        assert accepts(host, int(port)), "it says where once it is there"
        return url

    serve.running = running
    yield serve
    for program in running:
        program.terminate()
        program.wait(DEADLINE_S)
        program.stdout.close()


async def until(fact, what):
    deadline = time.monotonic() + DEADLINE_S
    while not (found := await fact()):
        assert time.monotonic() < deadline, what
        await asyncio.sleep(0.05)
    return found


async def shows(page, pattern):
    async def found():
        return re.search(pattern, await page.words() or "")

    return await until(found, pattern)


@pytest.mark.parametrize(
    ("control", "words"), [(False, "it is read-only: with --control it could"), (True, "can change and stop")]
)
def test_who_serves_is_told_what_may_be_done_there_and_how_another_computer_gets_there(control, words, monkeypatch):
    serving, said = pytest.importorskip("silo_tui.web.serving"), []
    monkeypatch.setattr(serving.web, "run_app", lambda app, **_: app.close())
    serving.serve((), 0, control=control, tell=said.append)
    address, may, far = said
    port = address.split(":")[2].partition("/")[0]
    assert words in may
    assert f"`ssh -L {port}:127.0.0.1:{port} {socket.gethostname()}`" in far


@needs_browser
async def test_a_page_has_live_values_takes_an_edit_by_keys_and_plots(served):
    url = served("--control")
    async with chromium.opened(url) as page:
        await shows(page, r"RUNNING.*500/500")
        await shows(page, r"/base/acceleration")
        for _ in range(2):  # values come again and again
            await page.forget()
            await shows(page, r"-?\d\.\d\d")
        await page.press("e", "d", "7", "Enter")
        await shows(page, "divider: 1 changed")
        await page.press("m")
        await shows(page, r"10 s shown")
        await shows(page, "[⠁-⣿]{3}")
        assert page.asked
        assert all(asked.startswith(url) for asked in page.asked), page.asked
        assert not page.complaints


@needs_browser
async def test_a_page_changes_nothing_without_control(served):
    async with chromium.opened(served()) as page:
        await shows(page, r"RUNNING.*500/500")
        await page.press("e", "t")
        await shows(page, r"On/Off\): .*read-only")


async def test_strangers_get_neither_page_nor_socket(served):
    import aiohttp

    url = served()
    base, token = re.fullmatch(r"(http://127\.0\.0\.1:\d+)/([\w-]+)/", url).groups()
    async with aiohttp.ClientSession() as web:
        for address, headers in (
            (base, {}), (f"{base}/static/js/textual.js", {}), (f"{base}/wrong/", {}), (url, {"Host": "evil.example"}),
            (url, {"Origin": "http://evil.example"}),
        ):  # fmt: skip
            async with web.get(address, headers=headers) as answer:
                assert answer.status == 403, address
                assert token not in await answer.text()
        for origin in ("http://evil.example", "null", None):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await web.ws_connect(f"{url}ws", headers={"Origin": origin} if origin else {})
            assert refused.value.status == 403
        async with web.get(url.rstrip("/")) as answer:  # copied without its end
            assert answer.status == 200
            assert "googleapis" not in await answer.text()
            assert answer.headers["Referrer-Policy"] == "no-referrer"


async def test_a_fifth_page_is_refused_and_processes_end_with_their_pages(served):
    import aiohttp

    url = served()
    origin = {"Origin": url.split("/", 3)[0] + "//" + url.split("/", 3)[2]}
    async with aiohttp.ClientSession() as web:
        sockets = [await web.ws_connect(f"{url}ws", headers=origin) for _ in range(4)]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await web.ws_connect(f"{url}ws", headers=origin)
        assert refused.value.status == 503
        for each in sockets:
            await each.close()

        async def again():
            try:
                await (await web.ws_connect(f"{url}ws", headers=origin)).close()
            except aiohttp.WSServerHandshakeError:
                return False
            return True

        await until(again, "a place is free again")


async def test_pages_that_go_while_they_come_and_what_is_no_page_are_passed_over_in_silence(served):
    import aiohttp

    url = served()
    host, port = url.split("/")[2].split(":")
    asked = (
        f"GET /{url.split('/')[3]}/ws HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: http://{host}:{port}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: MDAwMDAwMDAwMDAwMDAwMA==\r\n\r\n"
    )
    async with aiohttp.ClientSession() as web:
        for _ in range(20):
            page = socket.create_connection((host, int(port)))
            page.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # goes without good-bye
            page.sendall(asked.encode())
            page.close()
        async with web.get(f"{url}ws") as answer:
            assert answer.status == 400
        async with web.get(url) as answer:
            assert answer.status == 200
    (program,) = served.running
    program.terminate()
    said = program.stdout.read()
    assert "Ctrl-C ends it" in said
    assert "Traceback" not in said


async def test_sizes_that_no_screen_has_are_cut_and_what_no_page_of_ours_sends_ends_it(served):
    import aiohttp

    url = served()
    origin = {"Origin": "/".join(url.split("/")[:3])}
    async with aiohttp.ClientSession() as web:
        page = await web.ws_connect(f"{url}ws?width=1000000&height=1000000", headers=origin)
        for _ in range(2):  # it draws; and goes on doing so
            assert (await page.receive(DEADLINE_S)).type is aiohttp.WSMsgType.BINARY
            await page.send_str('["resize", {"width": 9999999, "height": 9999999}]')
        await page.send_str("no JSON")
        while (await page.receive(DEADLINE_S)).type is aiohttp.WSMsgType.BINARY:
            pass
        assert page.closed


@pytest.mark.parametrize(
    ("sent", "does"),
    [
        ('["stdin", "é"]', ("send_bytes", "é".encode())),
        ('["resize", {"width": 100, "height": 30}]', ("set_terminal_size", {"width": 100, "height": 30})),
        (
            '["resize", {"width": 1001, "height": 401, "depth": 1}]',
            ("set_terminal_size", {"width": 1000, "height": 400}),
        ),
        ('["resize", {"width": -1, "height": "x"}]', ("set_terminal_size", {"width": 20, "height": 24})),
        ('["resize", {"width": 1e999, "height": 4}]', ("set_terminal_size", {"width": 80, "height": 5})),
        ('["ping", 7]', ("send_json", ["pong", 7])),
        ('["blur"]', ("blur",)),
        ('["focus"]', ("focus",)),
        *[(sent, None) for sent in ("", "{}", "null", "[]", '["x"]', '["stdin"]', '["stdin", 5]', "[" * 99_999)],
        ('["resize", 5]', None),
        ('["stdin", "\\ud800"]', None),
        ('["stop"]', None),
    ],
    ids=lambda given: str(given)[:30],
)
async def test_what_a_page_sends_is_done_or_ends_it(sent, does):
    from silo_tui.web import serving

    class Told:
        def __getattr__(self, name):
            async def tell(*given, **named):
                told.append((name, *given, *([named] if named else [])))

            return tell

    told = []
    assert await serving._handed_on(sent, Told(), Told()) is (does is not None)
    assert told == ([does] if does else [])
