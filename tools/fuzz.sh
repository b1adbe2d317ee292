#!/usr/bin/env bash
# Coverage-guided fuzzing (atheris) of the byte targets: tools/fuzz.sh [seconds per target] [target ...]
# The smallest set of inputs with the full coverage is kept in tests/data/fuzz_corpus, and the tests
# replay it. Inputs that fail are written to out/fuzz. Exit code 1 if anything failed.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
shift || true
targets=("$@")
((${#targets[@]})) || targets=(frames commands driver)
python=$PWD/.venv/bin/python
# installed outside the project's environment, since nothing else needs the tool
tool=$PWD/.cache/fuzz-$(sha256sum <tools/fuzz.lock | cut -c1-12)
if [[ ! -d $tool ]]; then
  "$python" -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps \
    --only-binary :all: --target "$tool.part" -r tools/fuzz.lock
  mv "$tool.part" "$tool"
fi
export PATH=$PWD/.venv/bin:$PATH PYTHONPATH=$tool${PYTHONPATH:+:$PYTHONPATH} NUMBA_NUM_THREADS=1
mkdir -p out/fuzz
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
code=0
for target in "${targets[@]}"; do
  export FUZZ_TARGET=$target
  kept=tests/data/fuzz_corpus/$target.txt
  found=$work/$target
  least=$work/$target.least
  "$python" tools/fuzz_corpus.py unpack "$kept" "$found"
  mkdir "$least"
  tools/fuzz_coverage.py "$found" -max_total_time="$seconds" -max_len=400 \
    -artifact_prefix="out/fuzz/$target-" -print_final_stats=1 >"out/fuzz/$target.txt" 2>&1 || code=1
  tools/fuzz_coverage.py -merge=1 "$least" "$found" >"out/fuzz/$target-merge.txt" 2>&1 || code=1
  grep -E 'number_of_executed_units|Error' "out/fuzz/$target.txt" | sed "s/^/$target: /" || true
  "$python" tools/fuzz_corpus.py pack "$kept" "$least"
done
exit "$code"
