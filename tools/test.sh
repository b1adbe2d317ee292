#!/usr/bin/env bash
# Runs the whole test suite: style, types, unit, property and process tests, then the SocketCAN tests on vcan.
# All parts run even if one fails; the last line shows the totals.
set -uo pipefail
cd "$(dirname "$0")/.."
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
# the process tests start hundreds of interpreters, which would all compile the suite again
unset PYTHONDONTWRITEBYTECODE
out=out/test
rm -rf "$out"
mkdir -p "$out"
failed=()

tools/lint.sh || failed+=("lint")

# What only computes is shared by the processors; what keeps the time of the host has them for itself.
.venv/bin/python -m pytest -q -n "$(nproc)" --dist loadfile -m "not system and not vcan" --durations=10 \
  --junitxml="$out/computed.xml" --cov --cov-report= || failed+=("tests that compute")
.venv/bin/python -m pytest -q -m "system and not vcan" --durations=10 --junitxml="$out/system.xml" \
  --cov --cov-append --cov-report=term:skip-covered --cov-report=html:"$out/coverage" ||
  failed+=("tests of processes")

# Fits must not depend on the processor. OpenBLAS selects its kernel by the processor, here by name.
for kernel in Haswell Prescott; do
  OPENBLAS_CORETYPE="$kernel" OPENBLAS_NUM_THREADS=1 .venv/bin/python -m pytest -q \
    tests/pam_model/test_fit_and_compare.py tests/pam_model/test_dual_numbers.py \
    tests/pam_model/test_comparison_page.py || failed+=("fits with the BLAS kernel $kernel")
done

# only the files with such tests: an emulated processor takes minutes to import the others
mapfile -t vcan_files < <(grep -rlw vcan tests --include='test_*.py')
tools/with_vcan.sh "$out" .venv/bin/python -m pytest -v -m vcan -p no:cacheprovider \
  --durations=10 --junitxml="$out/vcan.xml" "${vcan_files[@]}" || failed+=("vcan tests")

.venv/bin/python tools/test_totals.py "$out"/{computed,system,vcan}.xml || failed+=("totals")
if ((${#failed[@]})); then
  echo "make test: FAILED in: ${failed[*]}" >&2
  exit 1
fi
