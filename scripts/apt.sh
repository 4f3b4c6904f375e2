#!/usr/bin/env bash
# Installs packages of Debian or Ubuntu, as root or by sudo.
#
#     scripts/apt.sh PACKAGE ...
#
# Where another program holds the package manager's locks, as on fresh cloud machines in their first minutes,
# it says so and waits: five minutes, or LIMPID_APT_WAIT seconds.
set -euo pipefail

longest=${LIMPID_APT_WAIT:-300}

say() { echo "setup: $*" >&2; }

as_root=()
if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
        say "run this as root: apt-get install $*"
        exit 1
    fi
    as_root=(sudo)
fi
# `env` last, so that the variables pass sudo. The ${x[@]+…} is for old versions of bash.
apt=(${as_root[@]+"${as_root[@]}"} env LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get -qq)

# Runs apt-get. Its own DPkg::Lock::Timeout knows neither the lock of the lists nor that of the archives, and old
# versions do not have it at all.
apt_get() {
    local message status holder waited=0
    while true; do
        status=0
        { message=$("${apt[@]}" "$@" 2>&1 >&3); } 3>&2 || status=$?
        if ((status == 0)) || [[ $message != *"Could not get lock"* && $message != *"locked by another process"* ]]; then
            [[ -z $message ]] || printf '%s\n' "$message" >&2
            return "$status"
        fi
        # "… It is held by process 12 (apt-get)", "… was locked by another process with pid 12".
        holder=$(sed -n 's/.*process \(with pid \)\?\([0-9]\+\( ([^)]*)\)\?\).*/ (process \2)/p' <<<"$message" | head -n 1)
        if ((waited >= longest)); then
            say "another program$holder has held the package manager's lock for $longest s; run this again when it has ended"
            exit 1
        fi
        if ((waited == 0)); then
            say "waiting for another program$holder to release the package manager's lock, at most $longest s"
        fi
        sleep 1
        waited=$((waited + 1))
    done
}

say "installing $*"
apt_get update
apt_get install -y --no-install-recommends "$@"
