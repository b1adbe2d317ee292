#!/usr/bin/env bash
# Builds the documentation site in out/docs. Every warning is an error: a broken link, a page in no table of contents, a
# docstring that is not valid. With --links, addresses on other sites are visited, too; this needs a network.
set -euo pipefail
cd "$(dirname "$0")/.."
.venv/bin/codespell
build=(.venv/bin/sphinx-build -q -W --keep-going -c docs/site -d out/docs.doctrees)
"${build[@]}" -b html docs out/docs
if [[ ${1:-} == --links ]]; then "${build[@]}" -b linkcheck docs out/docs.links; fi
echo "out/docs/index.html"
