#!/usr/bin/env bash
# Makes .venv: Python 3.12, requirements.lock, and all packages in src and proof as editable. Does nothing if it is up to date.
# If ROS 2 Jazzy is sourced, the venv uses the system's packages and that ROS instead of the wheels.
set -euo pipefail
cd "$(dirname "$0")/.."

ros="${ROS_DISTRO:-wheels}"
place="$ros $PWD"
lock_stamp="$place $(sha256sum <requirements.lock)"
package_stamp="$place $(cat src/*/setup.py src/*/setup.cfg proof/setup.py tools/setup.sh | sha256sum)"
is_current() { [[ -f .venv/.$1 && $(<".venv/.$1") == "$2" ]]; }
if is_current lock-stamp "$lock_stamp" && is_current package-stamp "$package_stamp"; then exit 0; fi

if [[ $ros != wheels && $ros != jazzy ]]; then
  echo "setup: ROS_DISTRO is '$ros'; this suite runs on ROS 2 'jazzy' (or with no ROS 2 sourced)" >&2
  exit 1
fi

as_root() { if [[ $(id -u) == 0 ]]; then "$@"; else sudo "$@"; fi; }

find_python() {
  local candidate
  for candidate in "${PYTHON:-}" python3.12 python3 /usr/bin/python3.12; do
    if [[ -n $candidate ]] && "$candidate" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 12))' \
      2>/dev/null; then
      echo "$candidate"
      return
    fi
  done
  echo "setup: no Python 3.12 found (the ROS 2 Jazzy wheels exist for 3.12 only); give its path, as in PYTHON=/path/to/python3.12 make setup" >&2
  return 1
}
python=$(find_python)


if ! is_current place "$place"; then
  echo "setup: making .venv with $python, ROS 2 from $ros"
  if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    as_root apt-get update -qq
    as_root apt-get install -y -qq python3.12-venv
  fi
  venv_options=(--clear)
  if [[ $ros == jazzy ]]; then venv_options+=(--system-site-packages); fi
  "$python" -m venv "${venv_options[@]}" .venv
  printf '%s' "$place" >.venv/.place
fi

log=.venv/setup.log
pip_install() {
  .venv/bin/python -m pip --disable-pip-version-check --no-input install "$@" >"$log" 2>&1 || {
    tail -30 "$log" >&2
    echo "setup: pip failed, the full output is in $log" >&2
    return 1
  }
}

if ! is_current lock-stamp "$lock_stamp"; then
  lock=requirements.lock
  if [[ $ros == jazzy ]]; then
    # an entry is its first line and the indented lines that follow
    lock=.venv/without-ros.lock
    awk '/^[^ #]/ { keep = ($0 !~ /^ros-/) } keep || /^#/' requirements.lock >"$lock"
  fi
  echo "setup: installing $(grep -c '^[^ #].*==' "$lock") pinned packages"
  # The lock contains all dependencies, so pip need not resolve any.
  pip_install --require-hashes --no-deps -r "$lock"
  printf '%s' "$lock_stamp" >.venv/.lock-stamp
fi

editable=()
# a folder without a setup.py is what an older checkout left behind
for setup in src/*/setup.py proof/setup.py; do editable+=(-e "${setup%setup.py}"); done
pip_install --no-deps --no-build-isolation "${editable[@]}"
# before 0.2 the nodes had these names; scripts of that time still find them, in a source tree only
for old in controller_node driver_node model_node; do ln -sf "pam_$old" ".venv/bin/$old"; done
echo "setup: compiling the controller and the simulated robot, for which the first start would have to wait"
.venv/bin/python tools/compile_kernels.py
printf '%s' "$package_stamp" >.venv/.package-stamp
echo "setup: done in ${SECONDS} s"
