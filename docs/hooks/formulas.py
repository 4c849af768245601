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
_NAME = re.compile(r"<mi>(arg|min|max|exp|log|tanh|tr)</mi>")
_ROLE = re.compile(r":(?:class|func|meth|attr|mod|data|exc|obj):<code>~?(.*?)</code>")


def on_page_content(content: str, **_: Any) -> str:
    """Turn what arithmatex marked into MathML, and the roles of docstrings into names."""
    return _ROLE.sub(r"<code>\1</code>", _FORMULA.sub(_mathml, content))


def _plain(tex: str) -> str:
    """Say what the converter does not know in words that it does."""
    return tex.replace(r"\arg\min", r"\text{arg}\min")


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found["open"] == "[" else "inline"
    formula = convert(_plain(html.unescape(found["tex"]).strip()), display=display)
    formula = _NAME.sub(r'<mspace width="0.17em"/><mi>\1</mi><mspace width="0.17em"/>', formula)
    formula = formula.replace("<mi>&#x0007E;</mi>", "<mo>&#x0223C;</mo>")
    return f'<{found["tag"]} class="formula">{formula}</{found["tag"]}>'
