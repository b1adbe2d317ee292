"""The documentation site is built without a warning, and holds every page of docs/."""

from __future__ import annotations

import subprocess
import sys

import pytest

from .pages import ROOT


@pytest.mark.long("test_pages holds links, headings and blocks of every page")
def test_the_site_builds_without_warnings_and_finds_every_page(tmp_path):
    """A warning is a broken link, a page in no table of contents, an invalid docstring."""
    words = ["-q", "-W", "--keep-going", "-c", "docs/site", "-d", str(tmp_path / "trees")]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *words, "docs", str(tmp_path / "site")],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    index = ROOT / "docs/README.md"  # for readers of the repository; the site has index.rst
    for page in set((ROOT / "docs").rglob("*.md")) - {index}:
        made = tmp_path / "site" / page.relative_to(ROOT / "docs").with_suffix(".html")
        assert made.exists(), page
    assert "diagnose" in (tmp_path / "site/searchindex.js").read_text(encoding="utf-8")
    assert "valve_commands" in (tmp_path / "site/topics.html").read_text(encoding="utf-8")
    for name in ("load_rig", "simulate", "MuscleGeometry"):
        assert f'id="pam_model.{name}"' in (tmp_path / "site/api/pam_model.html").read_text()
