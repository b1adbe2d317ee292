#!/usr/bin/env bash
# Makes small changes to the driver's safety code, one at a time, in a copy of the tree, and checks
# whether the tests detect them. A pattern (for example 'pam_driver.safety.sensor_checks*') selects modules.
# Result: out/mutation/report.txt. Exit code 1 if less than 90 % are detected.
# MUTATION_TESTS="FILE ..." runs these tests instead of those in mutation.cfg, which is much faster.
# MUTATION_SECONDS=N reports what has been tried after N seconds.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
python=$root/.venv/bin/python
out=$root/out/mutation
# installed outside the project's environment, since nothing else needs the tool
tool=$root/.cache/mutation-$(sha256sum <tools/mutation.lock | cut -c1-12)
if [[ ! -d $tool ]]; then
  "$python" -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps \
    --target "$tool.part" -r tools/mutation.lock
  mv "$tool.part" "$tool"
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp -rL src/*/pam_* proof/pam_check config docs "$work"
mkdir "$work/tests"
cp -r tests/pam_driver tests/pam_model tests/pam_ros "$work/tests"
cp tools/mutation.cfg "$work/setup.cfg"
if [[ -n ${MUTATION_TESTS:-} ]]; then
  read -ra tests <<<"${MUTATION_TESTS//$'\n'/ }"
  "$python" - "$work/setup.cfg" "${tests[@]}" <<'PYTHON'
import configparser, sys

settings = configparser.ConfigParser()
settings.read(sys.argv[1])
settings["mutmut"]["pytest_add_cli_args_test_selection"] = "\n" + "\n".join(sys.argv[2:])
with open(sys.argv[1], "w") as file:
    settings.write(file)
PYTHON
fi
cd "$work"
export PYTHONPATH=$tool:$root/tests/helpers NUMBA_NUM_THREADS=1 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
mkdir -p "$out"
timeout "${MUTATION_SECONDS:-0}" "$python" -m mutmut run --max-children "${MUTATION_PROCESSES:-1}" "$@" \
  >"$out/log.txt" 2>&1 || {
  code=$?
  if ((code != 124)); then
    tail -20 "$out/log.txt" >&2
    exit 2
  fi
}
"$python" "$root/tools/mutation_report.py" mutants >"$out/report.txt" && code=0 || code=$?
cat "$out/report.txt"
exit "$code"
