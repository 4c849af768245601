"""Numbers as other systems write them in text."""

from __future__ import annotations

import re

_NOT_FINITE = re.compile(r"([-+]?)(?:nan\([a-z0-9_]*\)|1\.#(QNAN|SNAN|NAN|IND|INF)\d*)", re.I)


def understood(text: str) -> str:
    """Rewrite NaN and infinity as the C library of Windows prints them: -nan(ind), 1.#QNAN, 1.#INF.

    All else is left as it is; a text without any costs two searches.
    """
    if "#" not in text and "(" not in text:
        return text

    def plain(match: re.Match[str]) -> str:
        return f"{match[1]}inf" if (match[2] or "").upper() == "INF" else "nan"

    return _NOT_FINITE.sub(plain, text)
