"""A real browser, driven through its WebDriver with nothing but the standard library."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from urllib.request import Request, urlopen

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome")

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
)


class Figure(NamedTuple):
    """A figure of a report as the page has it; widths in pixels."""

    name: str
    own_width: int
    shown_width: int


class SeenTable(NamedTuple):
    """A table of a report as the page has it; height in pixels."""

    caption: str
    rows: int
    height: float


class Browser:
    """One session of a headless browser."""

    def __init__(self, address: str, profile: str, binary: str) -> None:
        self.address = address
        options = {"binary": binary, "args": [*FLAGS, f"--user-data-dir={profile}"]}
        asked = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
        made = self._post("/session", {"capabilities": {"alwaysMatch": asked}})
        self.session = f"/session/{made['sessionId']}"

    def open(self, page: Path, width: int = 1280) -> None:
        """Load a file, and wait until it and its images are there."""
        self.visit(page.resolve().as_uri(), width)
        self.run("return Promise.all([...document.images].map(image => image.decode()))")

    def visit(self, address: str, width: int = 1280) -> None:
        """Load what is at an address, in a window of so many pixels."""
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        asked = {"cmd": "Emulation.setDeviceMetricsOverride", "params": size}
        self._post(f"{self.session}/goog/cdp/execute", asked)
        self._post(f"{self.session}/url", {"url": address})

    def run(self, script: str) -> Any:
        """Evaluate JavaScript on the page; a promise is waited for."""
        return self._post(f"{self.session}/execute/sync", {"script": script, "args": []})

    def figures(self) -> list[Figure]:
        """Every figure on the page."""
        found = self.run(
            "return [...document.querySelectorAll('figure')].map(f => [f, f.querySelector('img')])"
            ".map(([f, image]) => [f.id, image.naturalWidth, image.clientWidth])"
        )
        return [Figure(*one) for one in found]

    def tables(self) -> list[SeenTable]:
        """Every table on the page."""
        found = self.run(
            "return [...document.querySelectorAll('table')].map("
            "t => [t.caption.innerText, t.rows.length, t.getBoundingClientRect().height])"
        )
        return [SeenTable(*one) for one in found]

    def fetched(self) -> list[str]:
        """Addresses of what the page has loaded, but for what it holds itself."""
        found = self.run("return performance.getEntriesByType('resource').map(e => e.name)")
        return [address for address in found if not address.startswith("data:")]

    def complaints(self) -> list[str]:
        """Everything that the console has said since it was last asked."""
        entries = self._post(f"{self.session}/se/log", {"type": "browser"})
        return [f"{entry['level']}: {entry['message']}" for entry in entries]

    def close(self) -> None:
        """End the session and the browser."""
        with urlopen(Request(self.address + self.session, method="DELETE"), timeout=30):
            pass

    def _post(self, path: str, content: dict[str, Any]) -> Any:
        body = json.dumps(content).encode()
        headers = {"Content-Type": "application/json"}
        with urlopen(Request(self.address + path, body, headers), timeout=120) as answer:
            return json.load(answer)["value"]


@contextmanager
def browser() -> Iterator[Browser]:
    """Start a browser of its own, and end it; skips where there is none."""
    binary = next(filter(None, map(shutil.which, BROWSERS)), None)
    driver = shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("needs chromium and chromedriver (Debian: chromium, chromium-driver)")
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile,
        subprocess.Popen([driver, "--port=0"], stdout=subprocess.PIPE, text=True) as process,
    ):
        try:
            yield from _session(process, profile, binary)
        finally:
            process.terminate()


def _session(process: subprocess.Popen[str], profile: str, binary: str) -> Iterator[Browser]:
    for line in process.stdout or ():
        found = re.search(r"started successfully on port (\d+)", line)
        if found:
            opened = Browser(f"http://127.0.0.1:{found[1]}", profile, binary)
            try:
                yield opened
            finally:
                opened.close()
            return
    raise RuntimeError("chromedriver ended before it listened")
