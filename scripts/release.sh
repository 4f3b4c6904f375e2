#!/usr/bin/env bash
# Makes what people without Rust install, and tries it:
#
#     target/release-archives/limpid-VERSION-x86_64-linux.tar.gz   program, manual, completions, licences
#     target/release-archives/limpid_VERSION_amd64.deb             the same, with icon and file types
#
# The program contains the window of `limpid view`. It needs glibc alone when it starts, 2.28 or newer (GLIBC
# names another version: Debian 10, Ubuntu 20.04 and RHEL 8 have this one); it looks for Vulkan and for the window
# system's libraries when it uses them. MAINTAINER is the package's: "Name <mail address>".
#
# Needs cargo, python3, dpkg-deb, objdump and strip. Installs cargo-about if it is missing, and cargo-zigbuild,
# which links with an old glibc, into an environment of its own. Uses desktop-file-validate and lintian where
# they are.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

die() {
    echo "release: $*" >&2
    exit 1
}

for tool in cargo python3 dpkg-deb objdump strip; do
    command -v "$tool" >/dev/null || die "$tool is needed"
done
command -v cargo-about >/dev/null || cargo install --locked --features cli cargo-about

version=$(cargo pkgid -p limpid-cli)
version=${version##*[@#]}
target=${CARGO_TARGET_DIR:-target}
out=$target/release-archives
most=${GLIBC:-2.28}
triple=x86_64-unknown-linux-gnu
maintainer=${MAINTAINER:-The limpid authors <limpid@localhost>}
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH

if ! command -v cargo-zigbuild >/dev/null; then
    tools=$PWD/$target/release-tools
    [[ $target == /* ]] && tools=$target/release-tools
    [[ -x $tools/bin/cargo-zigbuild ]] || {
        python3 -m venv "$tools"
        "$tools/bin/pip" install --quiet cargo-zigbuild ziglang
    }
    PATH=$tools/bin:$PATH
fi
cargo zigbuild --release --locked -p limpid-cli --features viewer --target "$triple.$most"
rm -rf "$out"
mkdir -p "$out"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# ---- What both contain

name=limpid-$version-x86_64-linux
folder=$work/$name
mkdir -p "$folder"/{man,completions}
strip --strip-debug -o "$folder/limpid" "$target/$triple/release/limpid"
cp README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$folder"
# Prints a warning for each package without a licence file of its own.
cargo about generate --locked --features viewer --manifest-path crates/limpid-cli/Cargo.toml \
    --config scripts/packaging/about.toml scripts/packaging/about.hbs -o "$folder/THIRD-PARTY.txt"
"$folder/limpid" man "$folder/man"
for shell in bash zsh fish; do
    "$folder/limpid" completions "$shell" >"$folder/completions/limpid.$shell"
done

glibc=$(objdump -T "$folder/limpid" | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -1)
glibc=${glibc#GLIBC_}
[[ $(printf '%s\n' "$glibc" "$most" | sort -V | tail -1) == "$most" ]] ||
    die "the program needs glibc $glibc, newer than $most"
libraries=$(objdump -p "$folder/limpid" | awk '/NEEDED/ { print $2 }' | sort | xargs)
for library in $libraries; do
    case $library in
        libc.so.6 | libm.so.6 | libdl.so.2 | libpthread.so.0 | ld-linux-x86-64.so.2) ;;
        *) die "the program needs $library, which not every system has" ;;
    esac
done

# ---- The archive

packed() {
    tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$SOURCE_DATE_EPOCH" "$@"
}
packed -C "$work" -c "$name" | gzip -9n >"$out/$name.tar.gz"

# ---- The Debian package

root=$work/deb
share=$root/usr/share
install -D "$folder/limpid" "$root/usr/bin/limpid"
strip "$root/usr/bin/limpid"
install -Dm644 scripts/packaging/limpid.desktop -t "$share/applications"
install -Dm644 scripts/packaging/limpid.svg -t "$share/icons/hicolor/scalable/apps"
install -Dm644 scripts/packaging/limpid.xml -t "$share/mime/packages"
install -Dm644 "$folder/completions/limpid.bash" "$share/bash-completion/completions/limpid"
install -Dm644 "$folder/completions/limpid.zsh" "$share/zsh/vendor-completions/_limpid"
install -Dm644 "$folder/completions/limpid.fish" -t "$share/fish/vendor_completions.d"
install -Dm644 "$folder"/man/*.1 -t "$share/man/man1"
install -Dm644 CHANGELOG.md -t "$share/doc/limpid"
cat >"$share/doc/limpid/changelog" <<END
limpid ($version) stable; urgency=medium

  * The changes are in CHANGELOG.md.gz, beside this file.

 -- $maintainer  $(date --utc -R --date="@$SOURCE_DATE_EPOCH")
END
install -Dm644 "$folder/THIRD-PARTY.txt" -t "$share/doc/limpid"
gzip -9n "$share"/man/man1/*.1 "$share"/doc/limpid/{changelog,CHANGELOG.md} "$share/doc/limpid/THIRD-PARTY.txt"
{
    echo "limpid is licensed under the MIT license or the Apache License 2.0, at your choice."
    echo "The latter is in /usr/share/common-licenses/Apache-2.0, those of the packages that limpid is"
    echo "built from in THIRD-PARTY.txt.gz beside this file. The former:"
    echo
    cat LICENSE-MIT
} >"$share/doc/limpid/copyright"
size=$(du -sk "$root/usr" | cut -f1)
mkdir "$root/DEBIAN"
cat >"$root/DEBIAN/control" <<END
Package: limpid
Version: $version
Architecture: amd64
Maintainer: $maintainer
Installed-Size: $size
Depends: libc6 (>= $glibc), libvulkan1
Recommends: mesa-vulkan-drivers, libxkbcommon0, libwayland-client0, libx11-6, libx11-xcb1, libxcursor1, libxi6, libxkbcommon-x11-0
Suggests: ffmpeg
Section: graphics
Priority: optional
Description: draws clear liquid from particles
 limpid makes pictures and films of the particle files that liquid simulations
 write, with refraction, absorption and caustics, and plays them in a window.
END
find "$root" -exec touch --no-dereference --date="@$SOURCE_DATE_EPOCH" {} +
chmod -R u=rwX,go=rX "$root"
deb=$out/limpid_${version}_amd64.deb
dpkg-deb --build --root-owner-group -Zxz "$root" "$deb" >/dev/null

# ---- Do they work, on their own?

try() {
    local folder
    folder=$(mktemp -d -p "$work")
    (
        cd "$folder"
        env -i "$1" --version --verbose
        env -i "$1" render --size 160x120 -o try.png
        test -s try.png
    )
}
mkdir "$work/empty"
tar -C "$work/empty" -xzf "$out/$name.tar.gz"
test -s "$work/empty/$name/man/limpid-render.1"
try "$work/empty/$name/limpid"
dpkg-deb -x "$deb" "$work/empty/deb"
try "$work/empty/deb/usr/bin/limpid"
if command -v desktop-file-validate >/dev/null; then
    desktop-file-validate "$work/empty/deb/usr/share/applications/limpid.desktop"
fi
if command -v lintian >/dev/null; then
    # Without MAINTAINER there is no mail address.
    lintian --fail-on error --suppress-tags bogus-mail-host,bogus-mail-host-in-debian-changelog "$deb"
fi

echo "needs glibc $glibc and: $libraries"
ls -l "$out"
