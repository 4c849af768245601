"""A result shows itself in a notebook: verdict first, numbers, a picture that needs no file."""

from __future__ import annotations

import base64
import io
import pickle
import re
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from hmrf_icp.drawing import palette
from hmrf_icp.drawing.card import SIZE, card


class Balanced(HTMLParser):
    """Fails where a tag is left open or closed twice."""

    def __init__(self, page):
        super().__init__()
        self.open = []
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        if tag not in ("img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert tag == "img" or self.open.pop() == tag


def test_the_summary_has_the_verdict_the_numbers_and_a_picture_of_its_own(result):
    page = result._repr_html_()
    Balanced(page)
    assert result.verdict in page
    assert f"{result.overlap:.1%}" in page
    assert f"{result.fitness:.1%}" in page
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    with Image.open(io.BytesIO(base64.b64decode(data))) as image:
        assert image.size == SIZE
        pixels = np.asarray(image.convert("RGBA"))
    assert 0.05 < np.mean(pixels[..., 3] > 0) < 0.99, "points on a ground of the page's"
    assert "http" not in page
    assert len(page) < 200_000


def test_a_result_that_is_not_believed_is_hatched_and_says_what_to_try(wrong, result):
    page = wrong._repr_html_()
    assert "NOT convincing, confidence 0.12" in page
    assert "repeating-linear-gradient" in page
    assert palette.VIOLATED in page
    assert wrong.advice in page
    assert palette.VIOLATED not in result._repr_html_()


def test_a_pickle_has_the_numbers_without_a_picture(result):
    page = pickle.loads(pickle.dumps(result))._repr_html_()
    Balanced(page)
    assert "<img" not in page
    assert f"{result.fitness:.1%}" in page


def test_what_is_said_is_text_and_never_markup():
    page = card("<b>", True, "a < b & c", [("<i>", "<script>")], None)
    Balanced(page)
    assert "<b>" not in page
    assert "<script>" not in page
    assert "a &lt; b &amp; c" in page


@pytest.mark.parametrize("heavy", ["matplotlib"])
def test_a_summary_needs_no_plotting_library(heavy):
    code = (
        "import sys, numpy as np, hmrf_icp\n"
        "p = np.random.default_rng(0).uniform(-1, 1, (500, 3)); p[:, 2] = p[:, 0] ** 2 * p[:, 1]\n"
        "r = hmrf_icp.register(p, p, np.eye(4), preset='paper', rejector='all')\n"
        f"assert r._repr_html_(); print({heavy!r} in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
