#!/usr/bin/env bash
# Measures two commits against each other: the same command with both, alternately, in one run, and
# how far apart the pictures are that they draw.
#
#     scripts/compare.sh BEFORE AFTER [ARGUMENTS OF limpid ...]
#     scripts/compare.sh main . render sims/cascade.toml --size 640x480 --samples 4
#
# A commit is named as git names it; `.` is what the files that git knows say now. Without arguments
# it is `render` of the reference scene `front` at 1024x768, or of the demo where the reference
# scenes are not. `render` is given its `-o` here.
#
# Variables: RUNS, pairs of runs, default 9; TRUTH, a picture that both are compared with (of `front`,
# the path tracer's); LIMPID_REFERENCE, the folder of the reference scenes, default
# ../shared/reference beside the checkout.
#
# Needs git, cargo, awk and bash 5. A commit is built once: its program is kept in
# $XDG_CACHE_HOME/limpid-compare (default ~/.cache), with one target folder for all of them. Delete
# it at will.
set -euo pipefail

die() {
    echo "compare: $*" >&2
    exit 2
}

((BASH_VERSINFO[0] >= 5)) || die "bash 5 or newer is needed, this is $BASH_VERSION"
for tool in git cargo awk; do
    command -v "$tool" >/dev/null || die "$tool is needed"
done
(($# >= 2)) || die "usage: scripts/compare.sh BEFORE AFTER [ARGUMENTS OF limpid ...]"

runs=${RUNS:-9}
[[ $runs =~ ^[1-9][0-9]*$ ]] || die "RUNS is $runs; a number of pairs expected"
root=$(git -C "$(dirname "${BASH_SOURCE[0]}")" rev-parse --show-toplevel)
cache=${XDG_CACHE_HOME:-$HOME/.cache}/limpid-compare

commit() {
    local found
    if [[ $1 == . ]]; then
        # Nothing is changed by this; without changes it says nothing.
        found=$(git -C "$root" stash create)
        echo "${found:-$(git -C "$root" rev-parse HEAD)}"
    else
        git -C "$root" rev-parse --verify --quiet "$1^{commit}" || die "$1 is no commit"
    fi
}

before=$(commit "$1")
after=$(commit "$2")
shift 2

truth=${TRUTH-}
if (($# == 0)); then
    reference=${LIMPID_REFERENCE:-$root/../shared/reference}
    front=$reference/scenes/double_dam_break_front.toml
    if [[ -e $front ]]; then
        set -- render "$front" --size 1024x768
        truth=${truth:-$reference/pictures/double_dam_break_front.png}
    else
        echo "compare: no reference scenes in $reference; this is the demo" >&2
        set -- render --size 1024x768
    fi
fi

temporary=$(mktemp -d)
cleanup() {
    if [[ -d $temporary/source ]]; then
        git -C "$root" worktree remove --force "$temporary/source"
    fi
    rm -rf "$temporary"
}
trap cleanup EXIT

# The program of a commit, built if it is not there.
build() {
    local program=$cache/$1/limpid
    [[ -x $program ]] && return
    echo "compare: building ${1:0:10}" >&2
    git -C "$root" worktree add --quiet --detach "$temporary/source" "$1"
    (cd "$temporary/source" && CARGO_TARGET_DIR=$cache/target cargo build --release --locked --quiet)
    git -C "$root" worktree remove --force "$temporary/source"
    mkdir -p "$cache/$1"
    # Renamed once it is whole.
    cp "$cache/target/release/limpid" "$program.new"
    mv "$program.new" "$program"
}

build "$before"
build "$after"

declare -A program=([before]=$cache/$before/limpid [after]=$cache/$after/limpid)
pictures=false
[[ $1 == render ]] && pictures=true

# Runs one of them and adds its seconds to its file.
run() {
    local which=$1 output=()
    shift
    $pictures && output=(-o "$temporary/$which.png")
    local start=$EPOCHREALTIME
    "${program[$which]}" "$@" "${output[@]}" >"$temporary/$which.out"
    local end=$EPOCHREALTIME
    # Microseconds, whatever the locale's decimal point is.
    echo "$((${end/[.,]/} - ${start/[.,]/}))" >>"$temporary/$which.times"
}

# Once each for the caches of shaders and files.
run before "$@"
run after "$@"
rm "$temporary"/*.times
for ((i = 0; i < runs; i++)); do
    # Turn about, so that neither is always the one that comes second.
    if ((i % 2)); then
        run after "$@"
        run before "$@"
    else
        run before "$@"
        run after "$@"
    fi
done

# Of a column of numbers: least, quartiles and greatest.
quartiles() {
    sort -g | awk '
        { x[NR] = $1 }
        function at(share,   i, f) {
            i = 1 + share * (NR - 1); f = i - int(i)
            return f > 0 ? x[int(i)] * (1 - f) + x[int(i) + 1] * f : x[int(i)]
        }
        END { print x[1], at(0.25), at(0.5), at(0.75), x[NR] }'
}

echo "limpid $*"
for which in before after; do
    read -r least _ median _ most < <(quartiles <"$temporary/$which.times")
    commit=${!which}
    printf '%-6s  %s  %-40.40s  %s\n' "$which" "${commit:0:10}" \
        "$(git -C "$root" log -1 --format=%s "$commit")" \
        "$(awk "BEGIN { printf \"%.3f s (%.3f to %.3f)\", $median / 1e6, $least / 1e6, $most / 1e6 }")"
done
read -r _ low middle high _ < <(
    paste "$temporary/after.times" "$temporary/before.times" | awk '{ print $1 / $2 }' | quartiles
)
printf 'after / before, median of %d pairs: %.3f (quartiles %.3f to %.3f)\n' \
    "$runs" "$middle" "$low" "$high"

$pictures || exit 0
apart() {
    "${program[after]}" compare "$1" "$2" --json |
        awk -F '[:,]' '/"mean_flip"/ { flip = $2 } /"rmse"/ { rmse = $2 } /"max_channel/ { most = $2 }
            END {
                if (most == 0) print "the same, all pixels"
                else printf "mean FLIP %.5f, RMSE %.5f, at most %d of 255\n", flip, rmse, most
            }'
}
echo "pictures: $(apart "$temporary/before.png" "$temporary/after.png")"
if [[ -n $truth ]]; then
    for which in before after; do
        echo "$which against the truth: $(apart "$truth" "$temporary/$which.png")"
    done
fi
