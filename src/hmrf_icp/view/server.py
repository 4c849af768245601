"""Pages in the browser of whoever started them: a server on the loopback address alone."""

from __future__ import annotations

import os
import secrets
import sys
import threading
import webbrowser
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Any

from hmrf_icp.errors import InputError
from hmrf_icp.view.page import POLICY

LOOPBACK = "127.0.0.1"

Pages = Callable[[str], "str | None"]
"""Gives the page at a path below the address (empty for the first); None where there is none."""


class Viewer:
    """Pages that are served until :meth:`close`; also a context manager.

    Nothing outside this machine can connect. On it, other people can, so the address holds a
    word that nobody guesses.

    Parameters
    ----------
    pages
        What is shown.
    port
        Of the address; 0 for any that is free.

    Attributes
    ----------
    address
        Where to look, ``http://127.0.0.1:PORT/WORD/``.

    Raises
    ------
    InputError
        The port is taken, or is none.
    """

    def __init__(self, pages: Pages, port: int = 0) -> None:
        word = secrets.token_urlsafe(12)
        try:
            self._server = _Server((LOOPBACK, port), _handler(pages, word))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(
                f"port {port}: cannot be listened on ({reason}); give another, or 0 for any"
            ) from None
        self.port: int = self._server.server_address[1]
        self.address = f"http://{LOOPBACK}:{self.port}/{word}/"
        self._ended = threading.Event()
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.1,), name="hmrf-icp view", daemon=True
        )
        self._thread.start()

    def open(self) -> bool:
        """Open the address in a browser, where there is a screen; return whether one was asked."""
        return on_a_screen() and webbrowser.open(self.address)

    def wait(self) -> None:
        """Serve until the viewer is closed or Ctrl-C is pressed, which closes it."""
        try:
            # In short sleeps: on Windows a long one does not hear Ctrl-C.
            while not self._ended.wait(0.5):
                pass
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """Stop, and free the port; a page that is open stays as it is."""
        if not self._ended.is_set():
            self._ended.set()
            self._server.shutdown()
            self._server.server_close()
            self._thread.join()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Viewer({self.address}{', closed' if self._ended.is_set() else ''})"

    def _repr_html_(self) -> str:
        return f'<a href="{self.address}" target="_blank">{self.address}</a>'


def on_a_screen() -> bool:
    """Tell whether a browser started here would be seen: not over SSH, not without a display."""
    if "SSH_CONNECTION" in os.environ:
        return False
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    # Otherwise two of them could listen on one port on Windows.
    allow_reuse_address = sys.platform != "win32"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a browser that goes away is no error of ours."""


def _handler(pages: Pages, word: str) -> type[BaseHTTPRequestHandler]:
    """Make the class that answers, for these pages under this word."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            """Answer with a page."""
            # A name that somebody points at this address would let their pages read ours.
            host = (self.headers.get("Host") or "").rpartition(":")[0]
            _, given, path = [*self.path.split("/", 2), "", ""][:3]
            if host not in (LOOPBACK, "localhost") or not secrets.compare_digest(
                given.encode(), word.encode()
            ):
                self.send_error(HTTPStatus.FORBIDDEN)
                return
            try:
                page = pages(path)
            except InputError as error:
                self._send(HTTPStatus.INTERNAL_SERVER_ERROR, str(error), "text/plain")
                return
            if page is None:
                self.send_error(HTTPStatus.NOT_FOUND)
            else:
                self._send(HTTPStatus.OK, page, "text/html")

        def _send(self, status: HTTPStatus, text: str, kind: str) -> None:
            content = text.encode("utf-8", "backslashreplace")
            self.send_response(status)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Content-Security-Policy", POLICY)
            self.send_header("Cache-Control", "no-store")
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
            """Say nothing: the terminal belongs to the command."""

    return Handler
