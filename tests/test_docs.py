"""The pages keep their word: every block of Python runs, and the site is whole."""

from __future__ import annotations

import functools
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import textwrap
import threading
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"

pytestmark = pytest.mark.skipif(not DOCS.exists(), reason="tests run without the repository")

BLOCK = re.compile(
    r"(?:^ *<!-- (?P<word>skip|needs): (?P<reason>[^\n]+) -->\n)?"
    r"^(?P<indent> *)```python\n(?P<code>.*?)^(?P=indent)```",
    re.DOTALL | re.MULTILINE,
)
INCLUDED = "--8<--"
"""Marks a file that is shown whole: tests/test_examples.py runs it."""


def blocks(page: Path) -> list[re.Match[str]]:
    text = page.read_text(encoding="utf-8")
    found = [block for block in BLOCK.finditer(text) if INCLUDED not in block["code"]]
    assert len(found) + text.count(INCLUDED) == text.count("```python"), "a block was not found"
    return found


PAGES = [page for page in sorted(DOCS.rglob("*.md")) if blocks(page)]


def missing(needs: str) -> str:
    """The first of some modules that cannot be imported; empty where all can."""
    for name in needs.split(", "):
        try:
            found = importlib.util.find_spec(name)
        except ModuleNotFoundError:
            found = None
        if found is None:
            return name
    return ""


@pytest.fixture(scope="module")
def given():
    """What pages speak of without saying where it comes from: two views that share 0.7."""
    import hmrf_icp
    from hmrf_icp.synthetic import render, scenes

    camera = hmrf_icp.PinholeCamera(width=160, height=120, fx=146, fy=146, cx=79.5, cy=59.5)
    poses = scenes.trajectory("desk", 60)
    source, target = (
        hmrf_icp.PointCloud.from_depth(render.render(scenes.desk(), camera, poses[i]), camera)
        for i in (16, 0)
    )
    names = {"hmrf_icp": hmrf_icp, "np": np, "render": render, "scenes": scenes}
    return names | {"camera": camera, "source": source, "target": target, "start": np.eye(4)}


@pytest.mark.filterwarnings("ignore::hmrf_icp.RegistrationWarning")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_every_block_of_python_runs(page, given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LOKY_MAX_CPU_COUNT", "1")  # loops over the cores run in this process
    monkeypatch.setenv("MPLBACKEND", "agg")
    for name, cloud in (("A.ply", given["source"]), ("B.ply", given["target"])):
        given["hmrf_icp"].write_cloud(name, cloud)
    names, left_out = given | {"__name__": "page"}, []
    for block in blocks(page):
        line = page.read_text(encoding="utf-8")[: block.start("code")].count("\n")
        code = "\n" * line + textwrap.dedent(block["code"])
        compiled = compile(code, page.name, "exec")
        absent = missing(block["reason"]) if block["word"] == "needs" else ""
        if absent:
            left_out.append(f"line {line}: needs {absent}")
        elif block["word"] != "skip":
            exec(compiled, names)  # the point of the test
    if left_out:
        pytest.skip("; ".join(left_out) + "; all else ran")


class Page(HTMLParser):
    """What a page of the site refers to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.pictures: list[dict[str, str | None]] = []
        self.ids: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.ids |= {value for name, value in attrs if name in ("id", "name") and value}
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        if tag == "img":
            self.pictures.append(values)
        if tag == "link" and values.get("rel") not in ("canonical", "prev", "next"):
            self.loaded.append(values["href"])
        if tag in ("script", "img", "iframe", "video", "source") and values.get("src"):
            self.loaded.append(values["src"])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built; skips where what builds it is not installed."""
    for name in ("mkdocs", "material", "mkdocstrings", "latex2mathml"):
        pytest.importorskip(name, reason="needs the extra [docs]")
    if not (ROOT / "CONTRIBUTING.md").exists():
        pytest.skip("needs the repository: some of its texts are pages")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in folder.rglob("*.html")}
    return folder, pages


def test_links_of_the_site_lead_somewhere(site):
    folder, pages = site
    assert len(pages) > 25
    for path, page in pages.items():
        if path.name == "404.html":
            continue
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            there = there / "index.html" if there.is_dir() else there
            assert there.exists(), f"{path.relative_to(folder)} links to {link}"
            if parts.fragment and there in pages:
                assert unquote(parts.fragment) in pages[there].ids, f"{path.name}: no {link}"


def test_pages_load_nothing_from_elsewhere_and_pictures_say_what_they_show(site):
    folder, pages = site
    for path, page in pages.items():
        for source in page.loaded:
            assert not urlsplit(source).netloc, f"{path.relative_to(folder)} loads {source}"
        for picture in page.pictures:
            assert (picture.get("alt") or "").strip(), f"{path.name}: {picture} says nothing"
    for sheet in folder.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(https?:)?//", sheet.read_text(encoding="utf-8"))


def test_formulas_are_drawn_and_no_markup_is_left(site):
    folder, pages = site
    assert "<math" in (folder / "method.html").read_text(encoding="utf-8")
    for path in pages:
        text = path.read_text(encoding="utf-8")
        text = re.sub(r"<(pre|code|script|annotation)\b.*?</\1>", "", text, flags=re.DOTALL)
        left = re.search(
            r"arithmatex|\$\$|\\\(|:class:|:func:|--8&lt;--|^\s*\|.*\|\s*$", text, re.M
        )
        assert left is None, f"{path.relative_to(folder)}: {left[0]!r}"


class Quiet(SimpleHTTPRequestHandler):
    """Serves the site, and says nothing of it."""

    def log_message(self, *_):
        pass


def test_a_browser_draws_a_page_without_complaint(site, tmp_path):
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("needs chromium")
    folder, _ = site
    handler = functools.partial(Quiet, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/method.html"
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"]
        command += [f"--user-data-dir={tmp_path}", "--virtual-time-budget=3000"]
        command += ["--enable-logging=stderr", address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        server.shutdown()
    assert "md-content" in done.stdout, done.stderr[-2000:]
    complaints = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert not complaints
