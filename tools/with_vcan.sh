#!/usr/bin/env bash
# Runs a command with a CAN interface vcan0: tools/with_vcan.sh WRITABLE_FOLDER COMMAND...
# "tools/with_vcan.sh --is-native" tells by its exit code whether this kernel has vcan.
# Uses the vcan of this kernel if there is one; otherwise it boots a distribution kernel that has vcan (under
# virtme-ng) and runs the command inside. The exit code is that of the command. The command receives the
# interface in PAM_TEST_CAN_CHANNEL, and PAM_TEST_SLOW_HOST=1 if the processor is emulated.
set -euo pipefail
cd "$(dirname "$0")/.."

as_root() { if [[ $(id -u) == 0 ]]; then "$@"; else sudo "$@"; fi; }
die() { echo "vcan: $*" >&2; exit 1; }

native_vcan() {
  [[ -d /sys/class/net/vcan0 ]] && return
  command -v ip >/dev/null || return
  as_root modprobe vcan 2>/dev/null || true
  as_root ip link add dev vcan0 type vcan 2>/dev/null || return
}

if [[ $1 == --is-native ]]; then
  as_root() { if [[ $(id -u) == 0 ]]; then "$@"; else sudo -n "$@"; fi; }
  native_vcan 2>/dev/null && exit 0 || exit 1
fi
out=$(realpath "$1")
shift

if native_vcan; then
  [[ $(<"/sys/class/net/vcan0/operstate") != down ]] || as_root ip link set vcan0 up
  command -v candump >/dev/null || as_root apt-get install -y -q --no-install-recommends can-utils
  PAM_TEST_CAN_CHANNEL=vcan0 exec "$@"
fi

echo "vcan: this kernel has no vcan, booting a kernel that has"
[[ $(uname -m) == x86_64 ]] || die "the test kernel is for x86_64, this machine is $(uname -m); load the module vcan instead"
command -v apt-get >/dev/null || die "needs apt-get to fetch qemu and a kernel; load the module vcan instead"

install_tools() {
  local missing=()
  command -v qemu-system-x86_64 >/dev/null || missing+=(qemu-system-x86)
  command -v modprobe >/dev/null || missing+=(kmod)
  command -v ip >/dev/null || missing+=(iproute2)
  command -v busybox >/dev/null || missing+=(busybox-static)
  command -v candump >/dev/null || missing+=(can-utils)
  ((${#missing[@]} == 0)) && return
  echo "vcan: installing ${missing[*]}"
  as_root apt-get update -qq
  DEBIAN_FRONTEND=noninteractive as_root apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}
install_tools || die "could not install qemu-system-x86 kmod iproute2 busybox-static can-utils with apt-get"

kernel_dir=$PWD/.cache/vcan-kernel
fetch_kernel() {
  local id meta image packages work
  id=$(. /etc/os-release && echo "$ID")
  meta=linux-image-amd64
  if [[ $id == ubuntu ]]; then meta=linux-image-generic; fi
  apt-cache show "$meta" >/dev/null 2>&1 || as_root apt-get update -qq
  image=$(apt-cache depends --important "$meta" | sed -n 's/^ *Depends: \(linux-image-[0-9].*\)$/\1/p' | head -1)
  [[ -n $image ]] || die "apt knows no kernel image ($meta)"
  packages=("$image")
  # Ubuntu has the modules in separate packages
  if [[ $id == ubuntu ]]; then
    packages+=("${image/image/modules}" "${image/image/modules-extra}")
  fi
  echo "vcan: fetching ${packages[*]}"
  work=$(mktemp -d)
  (
    cd "$work"
    # apt's download user has no permission to write here
    apt-get -o APT::Sandbox::User=root download -qq "${packages[@]}"
    mkdir root
    for package in *.deb; do
      dpkg-deb --fsys-tarfile "$package" | tar x -C root --wildcards --no-anchored \
        'boot/vmlinuz*' 'modules.*' 'kernel/net/can/*' 'kernel/drivers/net/can/*' 'kernel/net/9p/*' \
        'kernel/fs/9p/*' 'kernel/fs/netfs/*' 'kernel/fs/fscache/*' 'kernel/fs/overlayfs/*' \
        'kernel/drivers/virtio/*' 'kernel/drivers/char/*' 2>/dev/null || true
    done
  )
  rm -rf "$kernel_dir"
  mkdir -p "$(dirname "$kernel_dir")"
  mv "$work/root" "$kernel_dir"
  rm -rf "$work"
}
kernel() { compgen -G "$kernel_dir/boot/vmlinuz-*" | head -1; }
[[ -n $(kernel) ]] || fetch_kernel
[[ -n $(kernel) ]] || die "the kernel package contains no boot/vmlinuz"
[[ -x .venv/bin/vng ]] || die "virtme-ng is not in .venv; run 'make setup'"

# The home folder is read-only inside; all output goes to the one shared folder.
script=$out/in-vm.sh
{
  printf 'set -e\nexec >%q 2>&1\ntrap "echo \\$? >%q" EXIT\n' "$out/vm.log" "$out/vm.exit-code"
  printf 'export PATH=%q\n' "$PWD/.venv/bin:$PATH"
  printf 'export HOME=%q ROS_LOG_DIR=%q COVERAGE_FILE=%q\n' "$out/home" "$out/home/log" "$out/coverage-vcan"
  echo 'export PYTHONDONTWRITEBYTECODE=1 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST'
  echo "export PAM_TEST_CAN_CHANNEL=vcan0 PAM_TEST_SLOW_HOST=1 PAM_NO_NUMBA=1"
  printf 'mkdir -p %q\ncd %q\n' "$out/home" "$PWD"
  echo 'modprobe vcan; ip link set lo up; ip link add dev vcan0 type vcan; ip link set vcan0 up'
  printf '%q ' "$@"
  echo
} >"$script"

# KVM is disabled: nested virtualisation hangs on some hosts, and the tests are written for a slow processor.
# Output and exit code are passed in the shared folder, since the console needs udev, which containers lack.
rm -f "$out/vm.exit-code"
: >"$out/vm.log"
tail -f -n +1 "$out/vm.log" &
tail_pid=$!
trap 'kill $tail_pid 2>/dev/null' EXIT
PATH=$PWD/.venv/bin:$PATH timeout "${PAM_TEST_VM_TIMEOUT:-1500}" \
  .venv/bin/vng --verbose --disable-kvm --force-9p --cpus 2 --memory 2G --user root --rwdir="$out" \
  -r "$(kernel)" -- bash "$script" </dev/null >"$out/vm-console.log" 2>&1 || true
sleep 0.5
if [[ ! -s $out/vm.exit-code ]]; then
  tail -20 "$out/vm-console.log" >&2
  die "the test kernel did not boot or stopped early; its console is in $out/vm-console.log"
fi
exit "$(<"$out/vm.exit-code")"
