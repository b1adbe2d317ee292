#!/usr/bin/env bash
# Runs the tests: style, types, unit, property and process tests, and the SocketCAN tests where the kernel has vcan.
# "tools/test.sh all" adds the tests marked `long`, coverage, the fits with other BLAS kernels, and boots a kernel
# that has vcan where this one has none. All parts run even if one fails; the last lines show times and totals.
set -uo pipefail
cd "$(dirname "$0")/.."
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
# the process tests start hundreds of interpreters, which would all compile the suite again
unset PYTHONDONTWRITEBYTECODE
case "${1:-}" in
  "") run="make test" short="and not long" ;;
  all) run="make test-all" short="" ;;
  *) echo "usage: tools/test.sh [all]" >&2; exit 2 ;;
esac
out=out/test
rm -rf "$out"
mkdir -p "$out"
failed=()
times=()

# part NAME COMMAND...: runs a part, and keeps how long it took and whether it failed
part() {
  local name=$1 begin=$SECONDS
  shift
  "$@" || failed+=("$name")
  times+=("$name $((SECONDS - begin)) s")
}
counted() { if [[ -z $short ]]; then coverage=(--cov "$@"); else coverage=(); fi; }

# Without its cache, mypy takes half a minute: style and types are checked beside the tests, which go first.
nice -n 19 tools/lint.sh >"$out/lint.txt" 2>&1 &
lint=$!
trap 'kill "$lint" 2>/dev/null' EXIT
ended_lint() {
  wait "$lint"
  local code=$?
  cat "$out/lint.txt"
  return "$code"
}

# What only computes is shared by the processors; what keeps the time of the host has them for itself.
counted --cov-report=
OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 part "tests that compute" .venv/bin/python -m pytest -q -n "$(nproc)" --dist loadfile \
  -m "not system and not vcan $short" --durations=10 --junitxml="$out/computed.xml" "${coverage[@]}"
part "rest of lint" ended_lint
counted --cov-append --cov-report=term:skip-covered --cov-report=html:"$out/coverage"
# only the files with such tests: to import the others takes as long as ten of them
mapfile -t system_files < <(grep -rlw system tests --include='test_*.py')
part "tests of processes" .venv/bin/python -m pytest -q -m "system and not vcan $short" \
  --durations=10 --junitxml="$out/system.xml" "${coverage[@]}" "${system_files[@]}"
totals=("$out"/{computed,system}.xml)

# Fits must not depend on the processor. OpenBLAS selects its kernel by the processor, here by name.
if [[ -z $short ]]; then
  for kernel in Haswell Prescott; do
    OPENBLAS_CORETYPE="$kernel" OPENBLAS_NUM_THREADS=1 part "fits with the BLAS kernel $kernel" \
      .venv/bin/python -m pytest -q tests/pam_model/test_fit_and_compare.py \
      tests/pam_model/test_dual_numbers.py tests/pam_model/test_comparison_page.py
  done
fi

if [[ -z $short ]] || tools/with_vcan.sh --is-native; then
  # only the files with such tests: an emulated processor takes minutes to import the others
  mapfile -t vcan_files < <(grep -rlw vcan tests --include='test_*.py')
  part "vcan tests" tools/with_vcan.sh "$out" .venv/bin/python -m pytest -v -m "vcan $short" \
    -p no:cacheprovider --durations=10 --junitxml="$out/vcan.xml" "${vcan_files[@]}"
  totals+=("$out/vcan.xml")
else
  echo "$run: no SocketCAN tests, since this kernel has no vcan; make test-all boots one that has"
fi

part "totals" .venv/bin/python tools/test_totals.py "${totals[@]}"
printf '%s: %s s' "$run" "$SECONDS"
printf ', %s' "${times[@]}"
echo
if ((${#failed[@]})); then
  echo "$run: FAILED in: ${failed[*]}" >&2
  exit 1
fi
