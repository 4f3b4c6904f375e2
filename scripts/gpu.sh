#!/usr/bin/env bash
# Measures a graphics adapter in a few minutes, and writes one Markdown file: the goals beside what was measured, each pass
# beside the least time that its bytes and operations take there, and the intersectors and caustics beside their errors.
#
#     scripts/gpu.sh [--quick] [--against BEFORE.md] [OUT.md]
#     scripts/gpu.sh --tests
#
# `--against` compares the goals with those of an earlier file. `--quick` draws small pictures: a try without a GPU.
# `--tests` runs the tests of the renderer and the golden frames instead. OUT.md is target/gpu.md by default. The adapter
# is the one that limpid chooses; WGPU_BACKEND and WGPU_ADAPTER_NAME choose another.
# LIMPID_REFERENCE is the folder of the reference scenes, default ../shared/reference beside the checkout.
# LIMPID, LIMPID_PASSES and LIMPID_PARTICLES are a program and the benches `passes` and `particles` that were built elsewhere,
# for a machine without cargo.
set -euo pipefail
# Numbers with points.
export LC_ALL=C
cd "$(dirname "${BASH_SOURCE[0]}")/.."

quick=()
against=
size=1024x768
large=1920x1080
frames=15
counts=(40000 million views)
width=1024
map=1024
tests=false
target=${CARGO_TARGET_DIR:-target}
out=$target/gpu.md
while (($#)); do
    case $1 in
        --quick)
            quick=(--quick) size=160x120 large=240x135 frames=3 width=160 map=256
            counts=(40000 views)
            ;;
        --against) against=${2:?gpu: --against needs a file} && shift ;;
        --tests) tests=true ;;
        -*)
            echo "gpu: unknown argument $1; --quick, --against FILE, --tests or a file expected" >&2
            exit 2
            ;;
        *) out=$1 ;;
    esac
    shift
done
if [[ -n $against && ! -f $against ]]; then
    echo "gpu: $against: no such file; --against takes one that this script wrote" >&2
    exit 2
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

step() { printf 'gpu: %s\n' "$*" >&2; }

if [[ -z ${LIMPID-} ]]; then
    step build
    scripts/setup.sh >&2
    cargo build --release --locked --quiet
fi
limpid=${LIMPID-$target/release/limpid}

if $tests; then
    export LIMPID_REQUIRE_GPU=1
    cargo test --release --locked --no-fail-fast --test renderer
    "$limpid" check tests/golden/limpid.toml --out "$target/gpu-golden"
    exit
fi

# A bench by its name, or by the program that was built elsewhere.
bench() {
    local name=$1 built=$2
    shift 2
    if [[ -n $built ]]; then
        "$built" "$@" frames=$frames
    else
        cargo bench --locked --quiet --bench "$name" -- "$@" frames=$frames
    fi
}
passes() { bench passes "${LIMPID_PASSES-}" "$@"; }

front=${LIMPID_REFERENCE-../shared/reference}/scenes/double_dam_break_front.toml
[[ -f $front ]] || step "without $front: its rows are missing"
step "frames"
passes front cascade sims/vase.toml sims/pool.toml million size=$size >"$work/frames"
passes front refract.samples=4 size=$size >"$work/samples"
passes front size=$large >"$work/large"
step "particles that stay on the device, and views"
bench particles "${LIMPID_PARTICLES-}" "${counts[@]}" size=$size >"$work/particles"
if [[ -f $front ]]; then
    step "all frames of a sequence"
    sequence() { "$limpid" render "$front" --size $size --frames all -o "$work/sequence/" -q 2>&3; }
    sequence 3>&2
    rm -r "$work/sequence"
    TIMEFORMAT=%R
    { time sequence; } 3>&2 2>"$work/sequence-seconds"
fi
step "each pass against its floor"
scenes=cascade,vase,pool
[[ ! -f $front ]] || scenes=$scenes,$front
"$limpid" report --passes --scenes "$scenes" --width $width --out "$work/passes" -q >&2
step "intersectors"
"$limpid" report --kinds intersect --scenes pool,breaker,reef,demo,cascade --width $width "${quick[@]}" \
    --out "$work/intersect" -q >&2
step "caustics"
"$limpid" report --kinds caustics --scenes pool "${quick[@]}" --out "$work/caustics" -q >&2

# Median of a row of a bench's output, of the scene whose name or number of particles begins so, ms.
ms() {
    awk -v scene="$2" -v row="$3" '
        / particles/ { here = index($0, scene) == 1 }
        here && index($0, row) { sub(row, ""); print $1; exit }' "$work/$1"
}
# A column of a row of a Markdown table, by scene, method and the beginning of its settings.
cell() {
    awk -F ' *[|] *' -v scene="$2" -v method="$3" -v settings="$4" -v wanted="$5" '
        $2 == "scene" { for (i = 2; i < NF; i++) if ($i == wanted) column = i }
        column && $2 == scene && $3 == method && index($4, settings) == 1 { print $column; exit }' "$1"
}
seconds() { [[ ! -f $work/sequence-seconds ]] || tail -n 1 "$work/sequence-seconds"; }
# A line of the table of goals: name, the most, measured, and whether the goal is met.
goal() {
    awk -v name="$1" -v goal="$2" -v found="${3:-none}" 'BEGIN {
        met = found == "none" ? "not measured" : found + 0 <= goal ? "yes" : "no"
        printf "| %s | %s | %s | %s |\n", name, goal, found, met
    }'
}
difference() { [[ -z $1 || -z $2 ]] || awk -v a="$1" -v b="$2" 'BEGIN { printf "%.2f", a - b }'; }

goals() {
    echo "| | goal, ms | measured, ms | met |"
    echo "|---|--:|--:|---|"
    goal "all passes, \`front\`, $size" 1.0 "$(ms frames front "all passes")"
    goal "all passes, \`cascade\`" 3 "$(ms frames cascade "all passes")"
    goal "all passes, \`vase\`" 3 "$(ms frames sims/vase "all passes")"
    goal "all passes, \`pool\`" 3 "$(ms frames sims/pool "all passes")"
    goal "all passes, a million particles" 1.6 "$(ms frames swell "all passes")"
    goal "all passes, \`front\`, four samples" 2.5 "$(ms samples front "all passes")"
    goal "all passes, \`front\`, $large" 2.0 "$(ms large front "all passes")"
    goal "\`front\`, frame with read-back without its passes" 1 \
        "$(difference "$(ms frames front frame)" "$(ms frames front "all passes")")"
    goal "40,000 particles from host memory, and the picture back" 3 "$(ms particles 39128 "host to host")"
    goal "a million from host memory, and the picture back" 8 "$(ms particles 1056000 "host to host")"
    goal "40,000 on the device, the picture too" 2 "$(ms particles 39128 "device to texture")"
    goal "a million on the device, the picture too" 5 "$(ms particles 1056000 "device to texture")"
    goal "classification of a million on the device" 2 "$(ms particles 1056000 classification)"
    goal "a picture of 128×128 among many views" 1 "$(ms particles "39128 particles, " views)"
    goal "pictures of all frames of \`front\`, a process, s" 0.5 "$(seconds)"
    goal "forward caustics, \`pool\`, map of $map², grid $((map / 2))/2" 0.6 \
        "$(cell "$work/caustics/report.md" pool forward "map $map grid $((map / 2))/2" ms)"
    goal "\`guarded\` on \`pool\`, $width pixels wide" 0.1 "$(cell "$work/intersect/report.md" pool guarded "" ms)"
}
# Goals of an earlier file beside those of this one.
compared() {
    awk -F ' *[|] *' '
        $5 != "yes" && $5 != "no" { next }
        FNR == NR { before[$2] = $4; next }
        $2 in before { printf "| %s | %s | %s | %.2f |\n", $2, before[$2], $4, (before[$2] > 0 ? $4 / before[$2] : 0) }
    ' "$against" "$work/goals"
}

goals >"$work/goals"
{
    echo "# Measured on a graphics adapter"
    echo
    "$limpid" --version --verbose | sed 's/^/- /'
    echo "- $(date -u +%Y-%m-%d), pictures of $size, medians of $frames frames"
    echo
    cat "$work/goals"
    echo
    if [[ -n $against ]]; then
        printf '| against %s | before | now | ratio |\n|---|--:|--:|--:|\n' "$(basename "$against")"
        compared
        echo
    fi
    for table in frames samples large particles; do
        case $table in
            samples) printf 'With `refract.samples=4`:\n\n' ;;
            particles) printf 'From particles to pictures:\n\n' ;;
            large) printf 'Pictures of %s:\n\n' "$large" ;;
        esac
        printf '```text\n%s\n```\n\n' "$(cat "$work/$table")"
    done
    for report in passes intersect caustics; do
        sed '/^Measured on/d' "$work/$report/report.md"
        echo
    done
} >"$work/out.md"
mkdir -p "$(dirname "$out")"
mv "$work/out.md" "$out"
step "wrote $out"
