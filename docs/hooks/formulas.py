"""Formulas become MathML while the site is built: no script draws them, and none is loaded."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

_FORMULA = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\(?P<open>[(\[])(?P<tex>.*?)\\[)\]]</(?P=tag)>',
    re.DOTALL,
)
_ROLE = re.compile(r":(?:class|func|meth|attr|mod|data|exc|obj):<code>~?(.*?)</code>")


def on_page_content(content: str, **_: Any) -> str:
    """Turn what arithmatex marked into MathML, and the roles of docstrings into names."""
    return _ROLE.sub(r"<code>\1</code>", _FORMULA.sub(_mathml, content))


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found["open"] == "[" else "inline"
    formula = convert(html.unescape(found["tex"]).strip(), display=display)
    return f'<{found["tag"]} class="formula">{formula}</{found["tag"]}>'
