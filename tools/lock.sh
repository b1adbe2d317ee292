#!/usr/bin/env bash
# Generates requirements.lock from requirements.in, with all versions and hashes, without an index address.
set -euo pipefail
cd "$(dirname "$0")/.."
.venv/bin/pip-compile --quiet --generate-hashes --allow-unsafe --no-strip-extras --no-header \
  --no-emit-index-url --no-emit-find-links --no-emit-trusted-host \
  --output-file requirements.lock requirements.in "$@"
