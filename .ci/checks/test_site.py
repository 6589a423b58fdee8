"""The site read from the disk: browsers start no worker there, so its search lives in a frame."""

import asyncio
import shutil
from pathlib import Path

import pytest

from tests import chromium

SHIM = Path(__file__).parents[2] / ".docs" / "mkdocs" / "iframe-worker.js"
PAGE = """<!doctype html><script src="iframe-worker.js"></script><body><script>
const worker = new Worker("worker.js");
worker.addEventListener("message", (event) => { window.answer = event.data; });
worker.postMessage({ number: 20 });
</script>"""
WORKER = 'addEventListener("message", (event) => postMessage(event.data.number * 2 + self.own)); self.own = 2;'
ANSWER = """new Promise((done) => { const look = () =>
  window.answer === undefined ? setTimeout(look, 20) : done(window.answer); look(); })"""


@pytest.mark.slow
@pytest.mark.skipif(chromium.PROGRAM is None, reason="there is no Chromium")
def test_a_worker_answers_a_page_from_the_disk(tmp_path):
    shutil.copy(SHIM, tmp_path)
    (tmp_path / "page.html").write_text(PAGE)
    (tmp_path / "worker.js").write_text(WORKER)

    async def answer():
        async with chromium.opened((tmp_path / "page.html").as_uri()) as page:
            found = await asyncio.wait_for(page.value(ANSWER), 60)
            return found, page.complaints

    assert asyncio.run(answer()) == (42, [])
