"""A headless Chromium, driven by its DevTools protocol: enough of it to open a page, press keys and look."""

import asyncio
import json
import shutil
import tempfile
from contextlib import asynccontextmanager, suppress
from pathlib import Path

PROGRAM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# what the page's terminal is sent, as text without escape sequences: the page itself draws it into a canvas
RECORD = r"""
window.sent = "";
const Real = window.WebSocket;
window.WebSocket = class extends Real {
  constructor(...all) {
    super(...all);
    const decoder = new TextDecoder();
    this.addEventListener("message", (event) => {
      if (event.data instanceof ArrayBuffer) window.sent += decoder.decode(event.data, { stream: true });
    });
  }
};
"""
WORDS = r"window.sent.replace(/\x1b\[[0-9;?<>=]*[A-Za-z]/g, '').replace(/\x1b[^\[]/g, '')"


class Page:
    """One page; `asked` are the addresses it wanted, `complaints` what its console said."""

    def __init__(self, socket):
        self._socket = socket
        self._number = 0
        self._waiting = {}
        self.asked, self.complaints = [], []

    async def listen(self):
        async for message in self._socket:
            told = json.loads(message.data)
            if told.get("id") in self._waiting:
                self._waiting.pop(told["id"]).set_result(told)
            elif told.get("method") == "Network.requestWillBeSent":
                self.asked.append(told["params"]["request"]["url"])
            elif told.get("method") == "Log.entryAdded" and told["params"]["entry"]["level"] == "error":
                self.complaints.append(told["params"]["entry"]["text"])

    async def do(self, method, **parameters):
        self._number += 1
        answer = self._waiting[self._number] = asyncio.get_running_loop().create_future()
        await self._socket.send_json({"id": self._number, "method": method, "params": parameters})
        told = await answer
        assert "error" not in told, told
        return told["result"]

    async def value(self, code):
        told = await self.do("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)
        return told["result"].get("value")

    async def words(self):
        return await self.value(WORDS)

    async def forget(self):
        await self.value("window.sent = ''")

    async def press(self, *keys):
        for key in keys:
            named = {"Enter": ("\r", 13), "Escape": ("", 27)}.get(key)
            text, code = named or (key, 0)
            await self.do("Input.dispatchKeyEvent", type="keyDown", key=key, text=text, windowsVirtualKeyCode=code)
            await self.do("Input.dispatchKeyEvent", type="keyUp", key=key, windowsVirtualKeyCode=code)


@asynccontextmanager
async def opened(url, picture=None):
    """Yield a page of this address; `picture` is a file to draw it into at the end."""
    import aiohttp

    with tempfile.TemporaryDirectory() as home:
        browser = await asyncio.create_subprocess_exec(
            PROGRAM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--window-size=1300,800",
            f"--user-data-dir={home}", "--remote-debugging-port=0", "about:blank",
            stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        try:
            port = await _port_of(browser)
            async with aiohttp.ClientSession() as web:
                async with web.get(f"http://127.0.0.1:{port}/json") as listed:
                    targets = await listed.json()
                target = next(each for each in targets if each["type"] == "page")
                async with web.ws_connect(target["webSocketDebuggerUrl"], max_msg_size=0) as socket:
                    page = Page(socket)
                    listening = asyncio.create_task(page.listen())
                    for domain in ("Page", "Network", "Log", "Runtime"):
                        await page.do(f"{domain}.enable")
                    await page.do("Page.addScriptToEvaluateOnNewDocument", source=RECORD)
                    await page.do("Page.navigate", url=url)
                    yield page
                    if picture:
                        told = await page.do("Page.captureScreenshot")
                        import base64

                        Path(picture).write_bytes(base64.b64decode(told["data"]))
                    listening.cancel()
        finally:
            with suppress(ProcessLookupError):
                browser.kill()
            await browser.wait()


async def _port_of(browser):
    async for line in browser.stderr:
        words = line.decode(errors="replace")
        if "DevTools listening on" in words:
            return int(words.split("127.0.0.1:")[1].split("/")[0])
    raise AssertionError("the browser ended before it listened")
