#!/usr/bin/env bash
# Builds the viewer for browsers: static files in web/dist, which any server can serve.
#
#   scripts/web.sh            builds
#   scripts/web.sh --serve    builds, and serves them on http://localhost:8000 (PORT sets another port)
#   scripts/web.sh --draft    builds in a fraction of the time a module that is larger and slower
#
# It uses rustup's target wasm32-unknown-unknown where there is one, or can be had, and else Debian's packages
# rustc-web, cargo-web and rust-web-src with lld, which it installs.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

serve=false
draft=false
for argument in "$@"; do
    case $argument in
        --serve) serve=true ;;
        --draft) draft=true ;;
        *)
            echo "web: unknown argument $argument; --serve, --draft or none expected" >&2
            exit 2
            ;;
    esac
done

say() { echo "web: $*" >&2; }
has() { command -v "$1" >/dev/null; }

folder=${CARGO_TARGET_DIR:-$PWD/target}/web
tools=$folder/tools
dist=$PWD/web/dist
triple=wasm32-unknown-unknown
mkdir -p "$tools" "$dist"

scripts/setup.sh

# ---- The module.

# The standard library of the target, where this cargo's compiler has it.
has_target() { [[ -d $(rustc --print sysroot)/lib/rustlib/$triple/lib ]]; }

if ! has_target && has rustup; then
    rustup target add "$triple" >/dev/null 2>&1 || say "rustup cannot add $triple here"
fi

# All browsers with WebGPU have these instructions.
export RUSTFLAGS="-C target-feature=+simd128"
profile=web
if $draft; then profile=web-draft; fi
build=(build --profile $profile --locked --package limpid-web --target "$triple" --target-dir "$folder")
if has_target; then
    cargo "${build[@]}"
else
    if ! [[ -x /usr/bin/rustc && -x /usr/bin/cargo ]] || ! has wasm-ld || ! ls -d /usr/lib/rustlib/src/rust >/dev/null 2>&1; then
        if ! has apt-get; then
            say "missing: the target $triple (rustup target add $triple)"
            exit 1
        fi
        scripts/apt.sh rustc-web cargo-web rust-web-src lld
    fi
    # The packages have no library for the target, but its source.
    RUSTC_BOOTSTRAP=1 RUSTC=/usr/bin/rustc CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=wasm-ld \
        /usr/bin/cargo "${build[@]}" -Z build-std=std,panic_abort
fi

# ---- Its JavaScript, by the bindings' own program in the same version.

version=$(sed -n '/^name = "wasm-bindgen"$/{n;s/version = "\(.*\)"/\1/p}' Cargo.lock)
if [[ $("$tools/bin/wasm-bindgen" --version 2>/dev/null) != "wasm-bindgen $version" ]]; then
    say "building wasm-bindgen $version"
    # With newer versions of what it depends on than it was published with, of which some are withdrawn.
    env -u RUSTFLAGS cargo install --quiet --root "$tools" --target-dir "$folder/tools-target" \
        "wasm-bindgen-cli@$version"
fi
rm -rf "${dist:?}"/*
"$tools/bin/wasm-bindgen" "$folder/$triple/$profile/limpid_web.wasm" --out-dir "$dist" --target web --no-typescript \
    --remove-name-section --remove-producers-section

# ---- Smaller.

optimiser=$tools/node_modules/.bin/wasm-opt
if ! $draft && ! [[ -x $optimiser ]] && has npm; then
    npm install --silent --no-audit --no-fund --prefix "$tools" binaryen@132 >/dev/null 2>&1 || true
fi
if $draft; then
    :
elif [[ -x $optimiser ]]; then
    # Features that browsers with WebGPU understand, and the module uses.
    features=(simd bulk-memory bulk-memory-opt sign-ext mutable-globals nontrapping-float-to-int reference-types multivalue)
    "$optimiser" -O2 "${features[@]/#/--enable-}" "$dist/limpid_web_bg.wasm" -o "$dist/limpid_web_bg.wasm"
else
    say "without wasm-opt (npm: binaryen) the module is larger than it need be"
fi

cp crates/limpid-web/page/* "$dist"
# For browsers that cannot draw.
cp crates/limpid-viewer/demos/lagoon.jpg "$dist/still.jpg"

size() { printf '%d KiB' "$(($(wc -c) / 1024))"; }
packed=$(gzip -9 <"$dist/limpid_web_bg.wasm" | wc -c)
say "module: $(size <"$dist/limpid_web_bg.wasm"), by gzip $((packed / 1024)) KiB"
say "files: web/dist"
# Visitors wait for it.
if ! $draft && [[ -x $optimiser ]] && ((packed > 4300000)); then
    say "the module has $packed bytes by gzip, more than 4,300,000"
    exit 1
fi

if $serve; then
    say "http://localhost:${PORT:-8000}"
    exec python3 -m http.server --bind localhost --directory "$dist" "${PORT:-8000}"
fi
