#!/usr/bin/env bash
# Renders the five path-traced reference scenes and prints the mean FLIP of each picture.
#
#     scripts/reference.sh FOLDER [--set PASS.NAME=VALUE ...]
#
# FOLDER holds scenes/*.toml and pictures/*.png of the same names, 1024x768 or --size; FOLDER/PREFIX_ takes
# PREFIX_scenes and PREFIX_pictures. Scenes that cannot be drawn get no figure. Pictures and differences are left in
# target/reference/.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:?"usage: scripts/reference.sh FOLDER [--set PASS.NAME=VALUE ...]"}
shift
cargo build --release --locked --quiet
limpid=${CARGO_TARGET_DIR:-target}/release/limpid
[ ! -d "$folder" ] || folder=$folder/
out=${CARGO_TARGET_DIR:-target}/reference
mkdir -p "$out"

printf '%-26s' samples
for truth in "$folder"pictures/*.png; do printf '%-26s' "$(basename "$truth" .png)"; done
echo mean
for samples in 1 4; do
    printf '%-26s' "$samples"
    sum=0
    count=0
    for truth in "$folder"pictures/*.png; do
        name=$(basename "$truth" .png)
        "$limpid" render "${folder}scenes/$name.toml" -o "$out/$name.png" --samples "$samples" "$@" || {
            printf '%-26s' -
            continue
        }
        flip=$("$limpid" compare "$truth" "$out/$name.png" --diff "$out/$name.diff.png" --json |
            sed -n 's/.*"mean_flip": \([0-9.e-]*\).*/\1/p')
        printf '%-26.4f' "$flip"
        sum=$(awk "BEGIN { print $sum + $flip }")
        count=$((count + 1))
    done
    awk "BEGIN { printf \"%.4f\n\", $sum / $count }"
done
