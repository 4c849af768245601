"""Draw the pictures of the viewer, in Chromium: ``python docs/figures/view.py``.

Two noisy views of the desk that ``hmrf-icp demo`` renders, registered without a start.
"""

from __future__ import annotations

import base64
import io
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "tests"))

from PIL import Image  # noqa: E402

import hmrf_icp  # noqa: E402
from browsing import browser  # noqa: E402
from hmrf_icp.cli.demo import NAMES, desk_pair  # noqa: E402
from hmrf_icp.view import Recording, story, write_html  # noqa: E402

SIZE = {"width": 1240, "height": 760, "deviceScaleFactor": 1, "mobile": False}

SETTLED = """
return new Promise(done => setTimeout(() => requestAnimationFrame(done), 1500));
"""

CANDIDATE = """
for (const label of document.querySelectorAll("#colouring label"))
  if (label.textContent.includes("Agreement")) label.querySelector("input").click();
const slider = document.getElementById("slider");
slider.value = Math.round(0.3 * slider.max);
slider.dispatchEvent(new Event("input"));
"""
"""A candidate that was given up, by what the other's sensor saw."""


def main() -> None:
    """Open the page, and write what it shows."""
    pair, recording = desk_pair(), Recording()
    result = hmrf_icp.register(pair.source, pair.target, on_iteration=recording)
    with tempfile.TemporaryDirectory() as folder, browser() as page:
        file = Path(folder) / "page.html"
        write_html(story(result, recording=recording, names=NAMES), file)
        page.open(file)
        asked = f"{page.session}/goog/cdp/execute"
        page._post(asked, {"cmd": "Emulation.setDeviceMetricsOverride", "params": SIZE})
        for name, script in (("view.png", ""), ("view-candidate.png", CANDIDATE)):
            page.run(script)
            page.run(SETTLED)
            shot = page._post(asked, {"cmd": "Page.captureScreenshot", "params": {}})
            with Image.open(io.BytesIO(base64.b64decode(shot["data"]))) as picture:
                picture.convert("RGB").quantize(96).save(HERE / name, optimize=True)


if __name__ == "__main__":
    main()
