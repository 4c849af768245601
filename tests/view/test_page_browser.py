"""The page in a real browser: the points are there, and nothing leaves the machine."""

from __future__ import annotations

import pytest

from browsing import browser
from hmrf_icp.view import write_html

DRAWN = """
const canvas = document.getElementById(%r), image = canvas.getContext("2d")
  .getImageData(0, 0, canvas.width, canvas.height).data;
const first = image.slice(0, 4).join(), kinds = new Set();
let set = 0, sum = 0;
for (let i = 0; i < image.length; i += 4) {
  const pixel = image.slice(i, i + 4).join();
  if (pixel !== first) { set++; kinds.add(pixel); }
  sum = (31 * sum + image[i] + 7 * image[i + 1] + 13 * image[i + 2]) %% 1000003;
}
return [set, kinds.size, sum];
"""

SETTLED = """
return new Promise(done => {
  const look = () => document.documentElement.dataset.drawn !== undefined
    ? requestAnimationFrame(() => requestAnimationFrame(done)) : setTimeout(look, 20);
  look();
});
"""


def choose(page, script):
    page.run(script)
    page.run(SETTLED)


def drawn(page, canvas="points"):
    return page.run(DRAWN % canvas)


@pytest.fixture(scope="module")
def chromium():
    with browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def files(told, wrong, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    for name, one in (("right", told), ("wrong", wrong)):
        write_html(one, folder / f"{name}.html")
    return folder


@pytest.fixture
def page(chromium, files):
    chromium.open(files / "right.html")
    chromium.run(SETTLED)
    return chromium


def test_the_points_are_there_and_nothing_is_fetched(page, told):
    pixels, colours, _ = drawn(page)
    assert pixels > 10_000
    assert colours > 50
    assert page.fetched() == []
    assert page.complaints() == []
    assert page.run("return document.getElementById('moment').innerText").startswith("Result")


def test_the_timeline_moves_the_source(page, told):
    seen = set()
    for moment in (0, 5, told.result):
        choose(
            page,
            "const s = document.getElementById('slider');"
            f"s.value = {moment}; s.dispatchEvent(new Event('input'))",
        )
        assert page.run("return document.documentElement.dataset.drawn") == str(moment)
        title = page.run("return document.getElementById('moment').firstChild.data")
        assert title == told.moments[moment].title
        seen.add(drawn(page)[2])
    assert len(seen) == 3


def test_every_colouring_draws_another_picture_with_a_legend(page):
    seen = set()
    for mode in ("clouds", "agreement", "distance", "probability"):
        choose(page, f"document.querySelector('[value={mode}]').click()")
        seen.add(drawn(page)[2])
        assert len(page.run("return document.getElementById('legend').innerText")) > 30
        assert drawn(page, "field")[1] > 1
    assert len(seen) == 4


def test_violated_lines_of_sight_are_drawn_where_there_are_any(page):
    choose(page, "document.querySelector('#switch [value=\"0\"]').click()")
    many = drawn(page, "lines")[0]
    choose(page, "document.querySelector('[value=rays]').click()")
    assert drawn(page, "lines")[0] < 0.5 * many


def test_a_wrong_pose_looks_wrong(chromium, files):
    chromium.open(files / "wrong.html")
    chromium.run(SETTLED)
    stamp = chromium.run("return document.getElementById('stamp').innerText")
    assert stamp == "NOT convincing"
    assert chromium.run("return document.getElementById('verdict').className") == "bad"
    assert chromium.run("return document.querySelector('[value=agreement]').checked")
    choose(chromium, "document.querySelector('#switch [value=\"0\"]').click()")
    assert chromium.run("return document.getElementById('stamp').hidden")


def test_dragging_turns_and_the_wheel_zooms(page):
    before = drawn(page)[2]
    choose(
        page,
        "const c = document.getElementById('points'), at = (type, x) => c.dispatchEvent("
        "new PointerEvent(type, {pointerId: 1, clientX: x, clientY: 300, buttons: 1}));"
        "c.setPointerCapture = () => {}; at('pointerdown', 300); at('pointermove', 380)",
    )
    turned = drawn(page)[2]
    choose(
        page,
        "document.getElementById('points').dispatchEvent("
        "new WheelEvent('wheel', {deltaY: -200, cancelable: true}))",
    )
    assert len({before, turned, drawn(page)[2]}) == 3


def test_numbers_over_the_timeline_are_plotted(page):
    assert page.run("return document.querySelectorAll('.plot svg').length") >= 5
    assert page.run("return document.querySelectorAll('#histogram rect').length") == 40
    labels = page.run("return document.getElementById('plots').innerText")
    assert "NaN" not in labels
    assert "undefined" not in labels


@pytest.mark.parametrize("width", [400, 1280])
def test_nothing_is_wider_than_the_screen(chromium, files, width):
    for name in ("right", "wrong"):
        chromium.open(files / f"{name}.html", width)
        chromium.run(SETTLED)
        wide, inside = chromium.run(
            "return [document.documentElement.scrollWidth, window.innerWidth]"
        )
        assert wide <= inside
        assert drawn(chromium)[0] > 3000
