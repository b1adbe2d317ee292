#!/usr/bin/env bash
# Mutates the driver's safety path in a copy of the tree and lists the mutants that no test kills.
# Takes hours on the whole path; a module's name (for example sensor_checks) narrows it down.
set -euo pipefail
cd "$(dirname "$0")/.."
only=${1:-}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
git ls-files -z | tar --null -T - -cf - | tar -xf - -C "$work"
python=$PWD/.venv/bin/python
tool=$PWD/.venv/bin/cosmic-ray
out=$PWD/out/mutation
[ -x "$tool" ] || "$python" -m pip install --quiet 'cosmic-ray~=8.7'
mkdir -p "$out"
cd "$work"
# the copy, not the installed packages, is what the tests must import
export PYTHONPATH=$work/src/pam_model:$work/src/pam_driver:$work/src/pam_control:$work/src/pam_sim
export PATH=$(dirname "$python"):$PATH
config=$work/mutation.toml
cp tools/mutation.toml "$config"
[ -z "$only" ] || sed -i "/^  \"src/{/$only/!d}" "$config"
session=$out/session.sqlite
rm -f "$session"
"$tool" init "$config" "$session"
"$tool" baseline "$config"
"$tool" exec "$config" "$session"
"$(dirname "$tool")/cr-report" --surviving-only --show-diff "$session" > "$out/survivors.txt"
"$(dirname "$tool")/cr-rate" "$session" | sed 's/^/share that survived [%]: /'
echo "survivors: $out/survivors.txt"
