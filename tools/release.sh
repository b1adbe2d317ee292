#!/usr/bin/env bash
# Builds and checks what can be made of a release without anybody's account, in out/release:
# source archives and wheels of all packages, checked as the package index does, and tried in an empty environment.
#   tools/release.sh prepare 0.3.0   writes version, date and CHANGELOG.md (from changes/) into the files; to be committed
#   tools/release.sh                 builds and checks
#   tools/release.sh tag             builds and checks, then makes the tag in this clone; nothing is pushed or uploaded
set -euo pipefail
cd "$(dirname "$0")/.."
python="$PWD/.venv/bin/python"
work=${1:-check}
fail() { echo "release: $1" >&2; exit 1; }

# the tools of a release are no part of the suite's environment
tools="$PWD/.cache/release"
if [[ ! -x $tools/bin/twine ]]; then
  "$python" -m venv "$tools"
  "$tools/bin/python" -m pip install -q --disable-pip-version-check \
    'build==1.3.0' 'twine==6.2.0' 'check-manifest==0.51' 'towncrier==25.8.0' 'setuptools<80' wheel
fi

if [[ $work == prepare ]]; then
  version=${2:?usage: tools/release.sh prepare VERSION}
  [[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]] || fail "$version is no version; expected three numbers, as 0.3.0"
  "$tools/bin/towncrier" build --yes --version "$version"
  "$python" tools/set_version.py "$version"
  echo "release: the files state $version; read CHANGELOG.md, run make setup and make test-all, commit, then make release"
  exit 0
fi
[[ $work == check || $work == tag ]] || fail "unknown: $work; expected prepare VERSION, tag, or nothing"

version=$("$python" tools/set_version.py)
[[ -z $(git status --porcelain) ]] || fail "there are changes that are not committed: git status"
left=$(find changes -name '*.md' ! -name README.md | wc -l)
[[ $left == 0 || $work == check ]] || fail "changes/ holds $left changes that no CHANGELOG.md tells: tools/release.sh prepare VERSION"

out="$PWD/out/release"
rm -rf "$out"
mkdir -p "$out"
# a clean copy of what is committed: nothing that lies about here gets into an archive
git worktree prune
source=$(mktemp -d)
trap 'git worktree remove --force "$source/tree" 2>/dev/null; rm -rf "$source"' EXIT
git worktree add -q --detach "$source/tree" HEAD
packages=("$source"/tree/src/*/)
for folder in "${packages[@]}"; do
  package=$(basename "$folder")
  (cd "$folder" && PATH="$tools/bin:$PATH" "$tools/bin/check-manifest" -q --no-build-isolation) || fail "$package: check-manifest"
  "$tools/bin/python" -m build --no-isolation --outdir "$out" "$folder" >"$out/build.log" 2>&1 || { tail -20 "$out/build.log" >&2; fail "$package: build"; }
done
rm -f "$out/build.log"
"$tools/bin/twine" check --strict "$out"/*
(cd "$out" && sha256sum ./*.whl ./*.tar.gz >SHA256SUMS)
"$python" -m pytest -q tests/packaging/test_wheels.py tests/packaging/test_rosdep_keys.py tests/packaging/test_dependencies.py

if [[ $work == tag ]]; then
  git tag -a "$version" -m "Version $version; CHANGELOG.md says what is in it"
  echo "release: tag $version is made in this clone"
fi
if [[ $work == tag ]]; then make_tag=""; else make_tag="make release TAG=1, which makes the tag; then "; fi
cat <<END

release: version $version is built and checked: ${#packages[@]} source archives and as many wheels in out/release.
What is left needs a person with accounts:
  1. make test-all passes on this commit, and the robot or the bench on which it was tried is named in the notes of the release.
  2. ${make_tag}git push origin main $version
  3. $tools/bin/twine upload out/release/*.whl out/release/*.tar.gz
     (once: see that the names on the index are free or yours)
  4. bloom-release --rosdistro jazzy pam_suite   (once: a release repository and an entry in rosdistro)
  5. A release of the forge from the tag, with the section of CHANGELOG.md and out/release/SHA256SUMS.
END
