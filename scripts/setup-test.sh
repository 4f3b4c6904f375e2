#!/usr/bin/env bash
# Tests that scripts/apt.sh, by which scripts/setup.sh installs, waits for each lock of the package manager: with the
# real apt-get, but a state of its own in a temporary folder, in which the one package is installed already.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if ! command -v apt-get >/dev/null || ! command -v python3 >/dev/null || ((EUID != 0)); then
    echo "setup-test: needs apt-get, python3 and root: not tested" >&2
    exit
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder"/var/lib/apt/lists/partial "$folder"/var/lib/dpkg "$folder"/var/cache/apt/archives/partial "$folder"/etc/apt/{apt.conf,preferences,sources.list}.d
touch "$folder/etc/apt/sources.list"
cat >"$folder/var/lib/dpkg/status" <<END
Package: there
Status: install ok installed
Architecture: all
Maintainer: nobody
Version: 1
Description: a package that is installed

END
cat >"$folder/apt.conf" <<END
Dir "$folder";
Dir::State "$folder/var/lib/apt";
Dir::State::status "$folder/var/lib/dpkg/status";
Dir::Etc "$folder/etc/apt";
Dir::Cache "$folder/var/cache/apt";
APT::Sandbox::User "root";
END
export APT_CONFIG=$folder/apt.conf

# Runs scripts/apt.sh beside a program that holds this lock for this many seconds.
beside() {
    local lock=$1 seconds=$2 status=0 holder
    shift 2
    python3 -c '
import fcntl, sys, time
file = open(sys.argv[1], "w")
fcntl.lockf(file, fcntl.LOCK_EX)
print("held", flush=True)
time.sleep(float(sys.argv[2]))' "$folder/var/lib/$lock" "$seconds" >"$folder/held" &
    holder=$!
    until [[ -s $folder/held ]]; do sleep 0.1; done
    env "$@" scripts/apt.sh there 2>"$folder/said" || status=$?
    kill "$holder" 2>/dev/null || true
    wait "$holder" 2>/dev/null || true
    rm "$folder/held"
    return "$status"
}

expect() {
    if ! grep -q -- "$1" "$folder/said"; then
        printf 'setup-test: %s: expected "%s" in:\n' "$lock" "$1" >&2
        cat "$folder/said" >&2
        exit 1
    fi
}

for lock in apt/lists/lock dpkg/lock-frontend dpkg/lock; do
    if ! beside "$lock" 3; then
        echo "setup-test: $lock: it did not wait" >&2
        cat "$folder/said" >&2
        exit 1
    fi
    expect 'waiting for another program (process [0-9]* (python3)) to release .* at most 300 s'
    if beside "$lock" 60 LIMPID_APT_WAIT=2; then
        echo "setup-test: $lock: it did not give up" >&2
        exit 1
    fi
    expect 'has held .* for 2 s; run this again when it has ended'
    # Three lines name the packages, the wait and its end; apt-get adds none.
    [[ $(wc -l <"$folder/said") == 3 ]] || expect 'three lines'
done

# All other failures end at once, in apt-get's words.
lock=none
if LIMPID_APT_WAIT=60 scripts/apt.sh nosuch 2>"$folder/said"; then
    echo "setup-test: a package that is not there was installed" >&2
    exit 1
fi
expect 'Unable to locate package nosuch'
echo "setup-test: passed" >&2
