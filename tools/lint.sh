#!/usr/bin/env bash
# Checks style, types and import rules of the whole tree.
set -euo pipefail
cd "$(dirname "$0")/.."
.venv/bin/ruff check .
.venv/bin/ruff format --check .
.venv/bin/mypy --strict src proof benchmarks
.venv/bin/lint-imports --no-logo --no-cache
.venv/bin/codespell
