"""The viewer listens on this machine alone, and stops when it is told to."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from http.client import HTTPConnection
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from hmrf_icp import InputError
from hmrf_icp.cli import app
from hmrf_icp.view import Viewer, show, write_rrd

PAGES = {"": "the first page", "run/3": "another"}


@pytest.fixture(autouse=True)
def _no_screen(monkeypatch):
    monkeypatch.setenv("SSH_CONNECTION", "here")


def refused(address):
    with pytest.raises(HTTPError) as raised:
        urlopen(address, timeout=10)
    return raised.value.code


def test_pages_are_served_on_the_loopback_address_until_it_is_closed():
    with Viewer(PAGES.get) as viewer:
        assert viewer.address.startswith(f"http://127.0.0.1:{viewer.port}/")
        assert viewer._server.socket.getsockname()[0] == "127.0.0.1"
        for path, text in PAGES.items():
            with urlopen(viewer.address + path, timeout=10) as answer:
                assert answer.read().decode() == text
                assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        assert refused(viewer.address + "nothing") == 404
    with pytest.raises(OSError, match="refused"):
        urlopen(viewer.address, timeout=10)
    viewer.close()


def test_who_does_not_know_the_word_or_comes_by_another_name_sees_nothing():
    with Viewer(PAGES.get) as viewer:
        assert refused(f"http://127.0.0.1:{viewer.port}/") == 403
        assert refused(f"http://127.0.0.1:{viewer.port}/guess/") == 403
        connection = HTTPConnection("127.0.0.1", viewer.port, timeout=10)
        path = viewer.address.partition(str(viewer.port))[2]
        connection.request("GET", path, headers={"Host": f"elsewhere.example:{viewer.port}"})
        assert connection.getresponse().status == 403
        connection.close()


def test_a_port_that_is_taken_is_named():
    with Viewer(PAGES.get) as viewer, pytest.raises(InputError, match=f"port {viewer.port}"):
        Viewer(PAGES.get, viewer.port)


def test_a_result_shows_itself_and_says_where(found):
    said = []
    viewer = found.show(block=False, on_ready=said.append)
    try:
        assert said == [viewer.address]
        with urlopen(viewer.address, timeout=10) as answer:
            assert b"source to target" in answer.read()
        assert viewer.address in viewer._repr_html_()
    finally:
        viewer.close()


def test_nobody_is_kept_waiting_who_was_not_told_the_address(told):
    show(told).close()


# --- the commands -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def maps(pair, tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    for name, cloud in (("a", pair.source), ("b", pair.target)):
        depth = np.nan_to_num(1000 * cloud.points[..., 2]).round().astype(np.uint16)
        Image.fromarray(depth).save(folder / f"{name}.png")
    return folder


def asked(maps, pair):
    lens = pair.source.camera
    numbers = f"{lens.fx},{lens.fy},{lens.cx},{lens.cy}"
    return [str(maps / "a.png"), str(maps / "b.png"), "--intrinsics", numbers]


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_view_says_the_address_writes_the_page_and_ends_on_ctrl_c(maps, pair, tmp_path):
    page = tmp_path / "page.html"
    command = [sys.executable, "-m", "hmrf_icp", "view", *asked(maps, pair), "--html", str(page)]
    environment = {**os.environ, "SSH_CONNECTION": "here", "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        try:
            line = next(line for line in process.stdout if line.startswith("Viewer: "))
            with urlopen(line.split()[1], timeout=10) as answer:
                text = answer.read().decode()
            process.send_signal(signal.SIGINT)
            _, complaints = process.communicate(timeout=30)
        finally:
            process.kill()
    assert process.returncode == 0
    assert complaints == ""
    assert "a.png to b.png" in text
    assert page.read_text(encoding="utf-8") == text


def test_register_writes_the_page_beside_the_rest(maps, pair, tmp_path):
    page = tmp_path / "page.html"
    outcome = CliRunner().invoke(app, ["register", *asked(maps, pair), "--html", str(page)])
    assert outcome.exit_code == 0
    assert f"written: {page}" in outcome.stdout
    assert page.stat().st_size > 100_000


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{maps}/a.png"], "no TARGET"),
        (["{maps}"], "results.csv"),
        (["{maps}", "--html", "x.html"], "--html"),
        (["{maps}", "{maps}/b.png"], "one pair"),
        (["{maps}/a.png", "{maps}/b.png", "--html", "{maps}/none/x.html"], "does not exist"),
    ],
)
def test_what_cannot_be_shown_is_refused_at_once(maps, arguments, said):
    arguments = [word.format(maps=maps) for word in arguments]
    outcome = CliRunner().invoke(app, ["view", *arguments])
    assert outcome.exit_code == 2
    assert said in outcome.stderr


def test_many_pairs_have_no_page(maps, pair):
    command = ["register", str(maps), *asked(maps, pair)[1:], "--html", "x.html"]
    outcome = CliRunner().invoke(app, command)
    assert outcome.exit_code == 2
    assert "--html: is for one pair alone" in outcome.stderr


def test_a_recording_of_rerun_is_written_or_the_extra_is_named(told, tmp_path):
    path = tmp_path / "story.rrd"
    try:
        import rerun  # noqa: F401
    except ImportError:
        with pytest.raises(ImportError, match=r"hmrf-icp\[rerun\]"):
            write_rrd(told, path)
        assert not path.exists()
    else:
        write_rrd(told, path)
        assert path.read_bytes()[:3] == b"RRF"
