#!/usr/bin/env bash
# Builds the page and the program (LIMPID is the path of one that is built), and tests the page in Chromium; on Debian
# and Ubuntu it installs what is missing.
#
#     scripts/web-test.sh [--core] [ARGUMENTS OF node --test ...]
#
# `--core` is the seven tests that CI runs: opening, shaders, files, playing, settings, sites, and the program's pictures.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [[ ${1-} == --core ]]; then
    shift
    export LIMPID_WEB_CORE=1
fi

browser=${LIMPID_CHROMIUM:-/usr/bin/chromium}
if ! [[ -x $browser ]] && command -v apt-get >/dev/null; then
    scripts/apt.sh chromium
fi

# LIMPID_WEB_BUILT=1 tests what is in web/dist, such as the smaller and faster module of `scripts/web.sh`.
[[ -n ${LIMPID_WEB_BUILT-} ]] || scripts/web.sh --draft
if [[ -z ${LIMPID-} ]]; then
    cargo build --locked
    export LIMPID=${CARGO_TARGET_DIR:-$PWD/target}/debug/limpid
fi
(cd tests/web && npm ci --silent --no-audit --no-fund)

exec node --test --test-concurrency=1 "$@" tests/web/web.test.mjs
