#!/usr/bin/env bash
# Measures everything that is worth measuring on a graphics adapter, and writes one Markdown file: the goals
# beside what was measured, then all tables.
#
#     scripts/gpu.sh [--quick] [OUT.md]
#
# `--quick` draws small pictures and few methods: a try without a GPU. OUT.md is target/gpu.md by default. The
# adapter is the one that limpid chooses; WGPU_BACKEND and WGPU_ADAPTER_NAME choose another.
# LIMPID_REFERENCE is the folder of the reference scenes, default ../shared/reference beside the checkout.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

quick=()
size=1024x768
frames=15
width=2000
if [[ ${1-} == --quick ]]; then
    shift
    quick=(--quick)
    size=320x240
    frames=3
    width=320
fi
target=${CARGO_TARGET_DIR:-target}
out=${1:-$target/gpu.md}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

step() { printf 'gpu: %s\n' "$*" >&2; }

step build
scripts/setup.sh >&2
cargo build --release --locked --quiet
limpid=$target/release/limpid
bench() { cargo bench --locked --quiet --bench passes -- "$@" frames=$frames size=$size; }

step "passes of single frames"
bench front million >"$work/passes"
bench front refract.samples=4 >"$work/samples"
step "frame time by the number of particles"
bench curve >"$work/curve"
step "intersectors, ${width} pixels wide"
"$limpid" report --kinds intersect --scenes pool "${quick[@]}" --width $width --out "$work/intersect" >&2
step "report"
"$limpid" report "${quick[@]}" --out "$work/report" >&2
step "settings by error and time"
"$limpid" report --curve "$work/settings.toml" --out "$work/curve-report" >&2

# Milliseconds of a row of a Markdown table, by scene, method and the beginning of its settings.
row() {
    awk -F ' *[|] *' -v scene="$2" -v method="$3" -v settings="$4" \
        '$2 == scene && $3 == method && index($4, settings) == 1 { print $5; exit }' "$1"
}
# Milliseconds on the device of the row of the curve with about this many particles.
particles() { awk -v count="$1" '$1 > 0.9 * count && $1 < 1.1 * count { print $3; exit }' "$work/curve"; }
# A line of the table of goals: name, goal, measured, and whether the goal is met.
goal() {
    awk -v name="$1" -v goal="$2" -v found="${3:-none}" 'BEGIN {
        met = found == "none" ? "not measured" : found + 0 <= goal ? "yes" : "no"
        printf "| %s | %s | %s | %s |\n", name, goal, found, met
    }'
}

guarded=$(row "$work/intersect/report.md" pool guarded "")
march=$(row "$work/intersect/report.md" pool march "stride=1")
map=1024
[[ ${#quick[@]} == 0 ]] || map=256
grid=$((map / 2))/2
forward=$(row "$work/report/report.md" pool forward "map $map grid $grid")
gather=$(row "$work/report/report.md" pool gather "map $map")
{
    echo "# Measured on a graphics adapter"
    echo
    "$limpid" --version --verbose | sed 's/^/- /'
    echo "- $(date -u +%Y-%m-%d), pictures of $size, medians of $frames frames"
    echo
    echo "| | goal, ms | measured, ms | met |"
    echo "|---|--:|--:|---|"
    goal "all passes, 40,000 particles, $size" 0.6 "$(particles 39128)"
    goal "all passes, 1,056,000 particles, $size" 1.5 "$(particles 1056000)"
    goal "\`guarded\`, pool, $width pixels wide" 0.02 "$guarded"
    goal "the same as a share of \`march\`" 0.0333 "$(awk -v a="$guarded" -v b="$march" 'BEGIN { if (b > 0) printf "%.4f", a / b }')"
    goal "forward caustics, pool, map of $map², grid $grid" 0.3 "$forward"
    goal "gather caustics, pool, map of $map²" 0.6 "$gather"
    echo
    for table in passes samples curve; do
        [[ $table != samples ]] || printf 'With `refract.samples=4`:\n\n'
        printf '```text\n%s\n```\n\n' "$(cat "$work/$table")"
    done
    echo "## Intersectors, $width pixels wide"
    echo
    sed -n '/^| scene/,/^$/p' "$work/intersect/report.md"
    echo "## Settings by error and time"
    echo
    printf '```toml\n%s\n```\n\n' "$(cat "$work/settings.toml")"
    echo "## Report"
    echo
    cat "$work/report/report.md"
} >"$work/out.md"
mkdir -p "$(dirname "$out")"
mv "$work/out.md" "$out"
step "wrote $out"
