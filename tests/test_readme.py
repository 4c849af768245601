"""The README keeps its word: its example runs, and its commands are the ones that are tested."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
DOCUMENTS = [
    README,
    ROOT / "CONTRIBUTING.md",
    *ROOT.glob("docs/*.md"),
    *ROOT.glob("benchmarks/*.md"),
]

pytestmark = pytest.mark.skipif(not README.exists(), reason="tests run without the repository")


def python_examples():
    return re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


def test_the_example_runs_and_finds_the_pose(capsys):
    (example,) = python_examples()
    names = {}
    exec(compile(example, "README.md", "exec"), names)  # the point of the test
    from hmrf_icp import se3

    result, poses = names["result"], names["poses"]
    truth = se3.inverse(poses[0]) @ poses[4]
    metres, radians = se3.error(result.transformation, truth)
    assert metres < 0.05
    assert radians < 0.05
    assert result.converged
    assert result.inlier_probability.shape == names["source"].shape == (120, 160)
    assert result.transformation.dtype == np.float64
    assert "Registration: to be believed, confidence 0.9" in capsys.readouterr().out


def test_the_two_commands_stand_there_word_for_word():
    text = README.read_text(encoding="utf-8")
    assert "\npip install . && hmrf-icp demo\n" in text
    assert "\npip install '.[test]' && pytest\n" in text
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert "pip install --quiet '.[test]'" in ci
    assert re.search(r"^ *pytest --quiet$", ci, re.MULTILINE)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_between_documents_lead_somewhere(document):
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", document.read_text(encoding="utf-8"))
    for link in links:
        assert (document.parent / link).exists(), f"{document.name} links to {link}"
