#!/usr/bin/env bash
# Builds the page and the program, and tests the page in Chromium; on Debian and Ubuntu it installs what is missing.
# Arguments are those of `node --test`, such as --test-name-pattern.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

browser=${LIMPID_CHROMIUM:-/usr/bin/chromium}
if ! [[ -x $browser ]] && command -v apt-get >/dev/null; then
    scripts/apt.sh chromium
fi

# LIMPID_WEB_BUILT=1 tests what is in web/dist, such as the smaller module of `scripts/web.sh`.
[[ -n ${LIMPID_WEB_BUILT-} ]] || scripts/web.sh --draft
cargo build --release --locked --package limpid-cli
(cd tests/web && npm ci --silent --no-audit --no-fund)

export LIMPID=${CARGO_TARGET_DIR:-$PWD/target}/release/limpid
exec node --test --test-concurrency=1 "$@" tests/web/web.test.mjs
