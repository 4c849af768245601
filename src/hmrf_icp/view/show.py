"""A story, opened in the browser."""

from __future__ import annotations

import sys
from collections.abc import Callable

from hmrf_icp.view.page import page
from hmrf_icp.view.server import Viewer
from hmrf_icp.view.story import Story


def show(
    story: Story,
    port: int = 0,
    block: bool | None = None,
    on_ready: Callable[[str], object] | None = None,
) -> Viewer:
    """Open a story in the browser.

    Parameters
    ----------
    story
        What is shown.
    port
        Of the address on this machine; 0 for any that is free.
    block
        Whether to return only when Ctrl-C is pressed, as a script wants it; None means: not at
        an interactive prompt, and not where nobody was told the address.
    on_ready
        Called with the address, such as ``print``: over SSH no browser opens by itself.

    Returns
    -------
    The viewer; its address is served until it is closed.

    Raises
    ------
    InputError
        The port is taken.
    """
    text = page(story)
    viewer = Viewer(lambda path: text if path == "" else None, port)
    opened = viewer.open()
    if on_ready is not None:
        on_ready(viewer.address)
    if block is None:
        block = not _prompt() and (opened or on_ready is not None)
    if block:
        viewer.wait()
    return viewer


def _prompt() -> bool:
    """Tell whether somebody types at a prompt, or in a notebook."""
    return hasattr(sys, "ps1") or bool(sys.flags.interactive) or "ipykernel" in sys.modules
