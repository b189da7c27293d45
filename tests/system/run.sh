#!/bin/bash
# The daemon under real systemd on a real vcan0, in a user-mode-linux guest: make system.
#
#   tests/system/run.sh             build what is missing, boot, run guest.py, exit with its status
#   tests/system/run.sh COMMAND…    the same guest, another command
#
# The guest's image holds Debian, systemd, a kernel with SocketCAN and the pinned dependencies; it is made once
# (about 90 s) and kept in $BELIEFD_VM (default ~/.cache/beliefd-vm). The project itself goes in as a wheel at
# every run. Needs root and apt on a Debian host; elsewhere it says why it cannot run and exits 0, or 1 when
# BELIEFD_SYSTEM=required.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
python=$root/.venv/bin/python

skip() {
  echo "system tests skipped: $*"
  [ "${BELIEFD_SYSTEM:-}" != required ] || exit 1
  exit 0
}

suite=$(. /etc/os-release 2>/dev/null && echo "${ID:-} ${VERSION_CODENAME:-}") || suite=
[ "$(uname -sm)" = "Linux x86_64" ] || skip "user-mode-linux needs Linux on x86-64, this is $(uname -sm)"
[ "$(id -u)" = 0 ] || skip "building the guest's root file system needs root"
[[ $suite == "debian "* ]] || skip "the guest is made from the apt sources of a Debian host, this is ${suite:-unknown}"
command -v apt-get >/dev/null || skip "there is no apt-get"
[ -x "$python" ] || { echo "no $python: make install" >&2; exit 2; }

image=${BELIEFD_VM:-${XDG_CACHE_HOME:-$HOME/.cache}/beliefd-vm}
results=$root/out/system
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
mkdir -p "$image" "$results"
say() { printf '[system %3ds] %s\n' "$SECONDS" "$*"; }

say "wheel of the project"
"$python" -m pip wheel -q --disable-pip-version-check --no-deps --wheel-dir "$work/wheels" "$root" >&2
"$python" "$here/requirements.py" >"$work/requirements.txt"

say "image in $image"
VM_SUITE=${suite#debian } bash "$here/vm/build_image.sh" "$image" -r "$work/requirements.txt"

# what the guest sees as /project: the wheel and the checks, not the tree (the installed daemon must do)
mkdir "$work/project"
cp "$work"/wheels/*.whl "$here"/guest.py "$here"/checks.py "$work/project/"
say "boot"
[ $# -gt 0 ] || set -- /opt/venv/bin/python guest.py
status=0
bash "$here/vm/run_vm.sh" "$image" -p "$work/project" -o "$results" -t 1200 -m 1536 -- "$@" || status=$?
say "exit $status; journal and console in ${results#"$root"/}"
exit $status
