#!/usr/bin/env bash
# Installs what limpid needs and this machine lacks: a C++ compiler (for a reference
# implementation that one test compares with), the Vulkan loader, and a Vulkan driver.
# It may run any number of times; where nothing is missing it does nothing.
set -euo pipefail

rust_needed=1.95

say() { echo "setup: $*" >&2; }

# ---- What is missing?

has_file() {
    local file
    for file in "$@"; do
        if [[ -e $file ]]; then return 0; fi
    done
    return 1
}

has_compiler() { command -v cc >/dev/null && command -v c++ >/dev/null; }

has_loader() {
    has_file /usr/lib*/libvulkan.so.1 /usr/lib/*/libvulkan.so.1 /usr/local/lib*/libvulkan.so.1 ||
        { command -v ldconfig >/dev/null && ldconfig -p | grep -q 'libvulkan\.so\.1'; }
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

packages=()
case $(uname -s) in
    Linux)
        has_compiler || packages+=(build-essential)
        has_loader || packages+=(libvulkan1)
        has_driver || packages+=(mesa-vulkan-drivers)
        ;;
    Darwin)
        # Metal is part of the system.
        if ! has_compiler; then
            say "a C++ compiler is missing; install it with: xcode-select --install"
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
        say "Arch: base-devel vulkan-icd-loader vulkan-swrast."
        exit 1
    fi
    as_root=()
    if ((EUID != 0)); then
        if ! command -v sudo >/dev/null; then
            say "run this as root: apt-get install ${packages[*]}"
            exit 1
        fi
        as_root=(sudo)
    fi
    say "installing ${packages[*]}"
    # `env` last, so that the variable passes sudo. The ${x[@]+…} is for the bash of macOS.
    apt=(${as_root[@]+"${as_root[@]}"} env DEBIAN_FRONTEND=noninteractive apt-get)
    "${apt[@]}" update -qq
    "${apt[@]}" install -y -qq --no-install-recommends "${packages[@]}" >&2
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
