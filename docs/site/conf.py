"""Settings of the documentation site, which `make docs` builds from the pages of docs/."""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

import pam_model

project = "PAM suite"
author = "PAM suite authors"
copyright = "PAM suite authors, Apache-2.0"
version = release = pam_model.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "sphinx_copybutton", "sphinx_design"]
root_doc = "index"
source_suffix = {".rst": "restructuredtext", ".md": "markdown"}
exclude_patterns = ["site", "README.md"]  # README.md lists the pages for readers of the folder

html_theme = "furo"
html_title = f"PAM suite {version}"
html_static_path: list[str] = []
html_copy_source = False
html_show_sourcelink = False

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # links such as page.md#heading, with the anchors of GitHub

numpydoc_show_class_members = False
autodoc_default_options = {"member-order": "bysource"}
autodoc_typehints = "none"  # the docstrings state types and units

linkcheck_ignore = [r"https?://(127\.0\.0\.1|localhost|example\.org)"]
linkcheck_anchors = False

ROOT = Path(__file__).parents[2]
OUTSIDE = re.compile(r"\[([^\]]*)\]\((?:\.\./)+((?:[\w.-]+/)*(?:[\w-]+\.md|[\w-]*))(?:#[\w-]*)?\)")
"""Links from a page to a folder or to a page that does not belong to the site."""


def without_outside_links(app: Sphinx, name: str, source: list[str]) -> None:
    """Name files of the source tree where the site has no page for them.

    Other links out of docs/, for example to rig files, become downloads.
    """
    text = source[0]
    if name == "contributing":
        text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    elif name == "changes":
        text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    if name in ("contributing", "changes"):
        text = text.replace("](docs/", "](").replace("](README.md)", "](index.rst)")
        text = text.replace("](CONTRIBUTING.md", "](contributing.md")
        text = re.sub(r"\]\((config|src|tests|examples|tools)/", r"](../\1/", text)
    text = text.replace("../CONTRIBUTING.md", "contributing.md").replace(
        "../CHANGELOG.md", "changes.md"
    )
    text = OUTSIDE.sub(_named, text)
    source[0] = text.replace("```mermaid", "```text")  # it would need a script from the network


def _named(found: re.Match[str]) -> str:
    if (ROOT / "docs" / found[2]).is_file():  # within docs/, from a folder of it
        return found[0]
    return f"{found[1]} (`{found[2]}`)"


def setup(app: Sphinx) -> None:
    """Connect the rewriting of links."""
    app.connect("source-read", without_outside_links)
