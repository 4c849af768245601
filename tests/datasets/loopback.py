"""A file server on loopback that can be told to misbehave."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

FOLDER = "rgbd_dataset_freiburg1_desk2"
PATH = f"/freiburg1/{FOLDER}.tgz"
"""Where the server of the TUM benchmark has a sequence."""


@dataclass
class Host:
    """What is served, how, and what was asked for.

    Parameters
    ----------
    files
        Content by path.
    cut_after
        Bytes of the body after which each answer's connection is closed, one
        number an answer; answers beyond the list are whole.
    ranges
        Whether ``Range`` is heeded.
    tag
        ``ETag`` of every file; None sends none.
    """

    files: dict[str, bytes]
    cut_after: list[int] = field(default_factory=list)
    ranges: bool = True
    tag: str | None = '"one"'
    url: str = ""
    asked: list[str | None] = field(default_factory=list)
    sent: int = 0


@contextmanager
def serving(host: Host) -> Iterator[Host]:
    class Handler(http.server.BaseHTTPRequestHandler):
        def log_message(self, *arguments: object) -> None:
            pass

        def do_GET(self) -> None:
            host.asked.append(self.headers.get("Range"))
            body = host.files.get(self.path)
            if body is None:
                self.send_error(404)
                return
            start = 0
            wanted = self.headers.get("Range") if host.ranges else None
            if wanted and self.headers.get("If-Range", host.tag) == host.tag:
                start = int(wanted.removeprefix("bytes=").rstrip("-"))
            if start >= len(body):
                self.send_response(416)
                self.send_header("Content-Range", f"bytes */{len(body)}")
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            self.send_response(206 if start else 200)
            if start:
                self.send_header("Content-Range", f"bytes {start}-{len(body) - 1}/{len(body)}")
            if host.tag is not None:
                self.send_header("ETag", host.tag)
            self.send_header("Content-Length", str(len(body) - start))
            self.end_headers()
            part = body[start:]
            if host.cut_after:
                part = part[: host.cut_after.pop(0)]
            self.wfile.write(part)
            host.sent += len(part)
            self.close_connection = True

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    host.url = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield host
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
