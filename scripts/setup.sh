#!/usr/bin/env bash
# Installs what limpid needs and this machine lacks: a C++ compiler (for a reference
# implementation that one test compares with), the Vulkan loader, and a Vulkan driver.
# It may run any number of times; where nothing is missing it does nothing. On Debian and Ubuntu it installs by
# scripts/apt.sh, which waits for other programs that install.
#
#   scripts/setup.sh        what is needed
#   scripts/setup.sh --all  also ffmpeg, for .mp4 and .webm films, and what the tests of the
#                           viewer start it in: a display of its own, and tools to drive it;
#                           OpenGL, to test that it draws what Vulkan draws; and faketime, to test
#                           machines whose clock is wrong
set -euo pipefail

rust_needed=1.95

say() { echo "setup: $*" >&2; }

all=false
case ${1-} in
    "") ;;
    --all) all=true ;;
    *)
        say "unknown argument $1; --all or none expected"
        exit 2
        ;;
esac

# ---- What is missing?

has_file() {
    local file
    for file in "$@"; do
        if [[ -e $file ]]; then return 0; fi
    done
    return 1
}

has() { command -v "$1" >/dev/null; }

has_compiler() { has cc && has c++; }

has_loader() {
    has_file /usr/lib*/libvulkan.so.1 /usr/lib/*/libvulkan.so.1 /usr/local/lib*/libvulkan.so.1 ||
        { command -v ldconfig >/dev/null && ldconfig -p | grep 'libvulkan\.so\.1' >/dev/null; }
}

# Any driver will do where there is a graphics card; without one, it must be the software driver.
has_driver() {
    if [[ -n ${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-} ]]; then return 0; fi
    local folders=(/usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d)
    local folder
    for folder in "${folders[@]}"; do
        if has_file "$folder"/lvp_icd*.json; then return 0; fi
        if has_file /dev/dri/renderD* /dev/nvidiactl && has_file "$folder"/*.json; then return 0; fi
    done
    return 1
}

has_egl() { has_file /usr/lib*/libEGL.so.1 /usr/lib/*/libEGL.so.1; }

has_xkbcommon_x11() { has_file /usr/lib*/libxkbcommon-x11.so.0 /usr/lib/*/libxkbcommon-x11.so.0; }

packages=()
case $(uname -s) in
    Linux)
        has_compiler || packages+=(build-essential)
        has_loader || packages+=(libvulkan1)
        has_driver || packages+=(mesa-vulkan-drivers)
        if $all; then
            has ffmpeg || packages+=(ffmpeg)
            has faketime || packages+=(faketime)
            has Xvfb || packages+=(xvfb)
            has xauth || packages+=(xauth)
            has xdotool || packages+=(xdotool)
            has xwininfo || packages+=(x11-utils)
            has_egl || packages+=(libegl1 libgl1-mesa-dri)
            has_xkbcommon_x11 || packages+=(libxkbcommon-x11-0)
        fi
        ;;
    Darwin)
        # Metal is part of the system.
        if ! has_compiler; then
            say "a C++ compiler is missing; install it with: xcode-select --install"
            exit 1
        fi
        if $all && ! has ffmpeg; then
            say "ffmpeg is missing; install it with: brew install ffmpeg"
            exit 1
        fi
        ;;
    *)
        say "on this system, see to a C++ compiler and a Vulkan or DirectX 12 driver yourself"
        ;;
esac

# ---- Install it.

if ((${#packages[@]})); then
    if ! command -v apt-get >/dev/null; then
        say "missing, by the names of Debian's packages: ${packages[*]}"
        say "elsewhere: a C++ compiler, the Vulkan loader, and a Vulkan driver (Mesa has a"
        say "software one, lavapipe). Fedora: gcc-c++ vulkan-loader mesa-vulkan-drivers."
        say "Arch: base-devel vulkan-icd-loader vulkan-swrast. What --all adds has the same names"
        say "or nearly so."
        exit 1
    fi
    "$(dirname "${BASH_SOURCE[0]}")/apt.sh" "${packages[@]}"
fi

# ---- Rust.

# rustup installs cargo here, and a shell that was open before does not know it.
if ! command -v cargo >/dev/null && [[ -x $HOME/.cargo/bin/cargo ]]; then
    say "cargo is not in PATH; run: source \"\$HOME/.cargo/env\""
    exit 1
fi
if ! command -v cargo >/dev/null; then
    say "Rust is missing: $rust_needed or newer is needed. Get it from https://rustup.rs"
    exit 1
fi
rust_found=$(cargo --version | cut -d ' ' -f 2)
if [[ $(printf '%s\n' "$rust_needed" "$rust_found" | sort -V | head -n 1) != "$rust_needed" ]]; then
    say "Rust is $rust_found, $rust_needed or newer is needed: rustup update stable"
    exit 1
fi
