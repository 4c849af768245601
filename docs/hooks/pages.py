"""Texts that stand elsewhere in the repository are pages too, and links between all lead on."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]

PAGES = {
    "benchmarks/README.md": "benchmarks.md",
    "benchmarks/metrics.md": "metrics.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "README.md": "index.md",
}
"""Where a text of the repository stands among the pages."""

_FROM = {page: text for text, page in PAGES.items() if text != "README.md"}
_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((?!https?:|#|mailto:)([^)#\s]+)(#[^)\s]*)?\)")
_CODE = re.compile(r"<code>[^<]*</code>")
_OPTION = re.compile(r"(?<![\w-])(--[a-z][\w-]*)")


def on_files(files: Files, config: Any) -> Files:
    """Add the texts that stand outside of the folder of pages."""
    for page, text in _FROM.items():
        files.append(File.generated(config, page, abs_src_path=str(ROOT / text)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Lead links to where their text is a page; a link to what is none becomes its words."""
    name = page.file.src_uri
    here = ROOT / _FROM.get(name, f"docs/{name}")

    def led(found: re.Match[str]) -> str:
        words, link, part = found[1], found[2], found[3] or ""
        there = Path(os.path.normpath(here.parent / link))
        inside = there.relative_to(ROOT).as_posix() if there.is_relative_to(ROOT) else ""
        target = PAGES.get(inside, inside.removeprefix("docs/") if _is_page(inside) else "")
        if not target:
            return words
        relative = os.path.relpath(target, Path(name).parent)
        words = re.sub(r"^(?:[\w-]+/)*([\w-]+)\.md$", r"\1", words)  # a file's name: a page's
        return f"[{words}]({Path(relative).as_posix()}{part})"

    return _LINK.sub(led, markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Keep an option in one piece: a line would break behind its first dash."""
    return _CODE.sub(lambda found: _OPTION.sub(r'<span class="whole">\1</span>', found[0]), content)


def _is_page(path: str) -> bool:
    shown = path.startswith("docs/") and path.endswith((".md", ".png", ".gif"))
    return shown and not path.endswith("README.md") and (ROOT / path).is_file()
