"""The page in a real browser: everything is drawn, nothing is fetched, nothing complains."""

from __future__ import annotations

import math

import pytest
from report_fakes import CONFIG, invented, write_folder

from browsing import browser
from hmrf_icp.evaluate.report import write_report

METHODS = ("hmrf", "x84", "field-gicp", "gicp@0.05", "gicp@0.8", "kiss-gicp@0.1")

CONTRAST = """
const light = colour => {
  const parts = colour.match(/[\\d.]+/g).slice(0, 3).map(v => v / 255)
    .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2];
};
const page = light(getComputedStyle(document.body).backgroundColor);
return ["body", "figcaption", ".notes", "td small", "nav a"].map(name => {
  const text = light(getComputedStyle(document.querySelector(name)).color);
  return [name, (Math.max(text, page) + 0.05) / (Math.min(text, page) + 0.05)];
});
"""


@pytest.fixture(scope="module")
def chromium():
    with browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def report(chromium, tmp_path_factory):
    rows = invented(pairs=15, axes=1, starts=((math.pi / 30, 0.0),), methods=METHODS)
    return write_report(write_folder(tmp_path_factory.mktemp("evaluation"), rows, CONFIG))


@pytest.fixture(scope="module")
def page(chromium, report):
    chromium.open(report.page)
    return chromium


def test_every_figure_is_drawn(page, report):
    figures = page.figures()
    assert sorted(figure.name for figure in figures) == sorted({p.stem for p in report.figures})
    assert all(figure.own_width > 300 and figure.shown_width > 300 for figure in figures)


def test_every_table_has_rows_that_can_be_seen(page):
    tables = page.tables()
    assert len(tables) >= 10
    assert all(table.rows > 1 and table.height > 20 and table.caption for table in tables)


def test_nothing_is_fetched_and_the_console_is_silent(page):
    assert page.fetched() == []
    assert page.complaints() == []


def test_every_link_leads_somewhere(page):
    dead = page.run(
        "return [...document.querySelectorAll('nav a')].filter("
        "a => !document.querySelector(a.getAttribute('href'))).map(a => a.href)"
    )
    assert dead == []


def test_text_stands_out_from_the_page(page):
    for name, contrast in page.run(CONTRAST):
        assert contrast >= 4.5, name


def test_on_a_narrow_screen_only_tables_and_figures_scroll(chromium, report):
    chromium.open(report.page, width=500)
    width, inside = chromium.run("return [document.documentElement.scrollWidth, window.innerWidth]")
    assert width <= inside
    wider = chromium.run(
        "return [...document.querySelectorAll('.wide')].every("
        "e => getComputedStyle(e).overflowX === 'auto')"
    )
    assert wider
