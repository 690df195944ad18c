#!/bin/sh
# Measures the networks of examples/models and writes the tables of their cards, docs/models/*.md: what stands
# above the line "## Measured" of a card is kept. Takes some minutes.
# sh docs/make_cards.sh [NAME...]      needs ../shared/data and build/examples/ascc
# SPDX-License-Identifier: MIT
set -eu
cd "$(dirname "$0")/.."
ascc=build/examples/ascc
data=../shared/data
csv=$(mktemp)
trap 'rm -f "$csv" "$csv".*' EXIT

# row LABEL MODEL EVERY SEQUENCE: one line of the table.
row() {
    $ascc eval --quiet --velocity difference --every "$3" --csv "$csv" "$2" "$4" >/dev/null 2>&1
    awk -F, -v name="$1" -v sequence="$(basename "$4" .safetensors)" '
        { value[$3] = $4 }
        function mm(x) { return x == "" ? "" : sprintf("%.2f", 1000 * x) }
        END {
            last = value["last_frame"]
            printf "| %s | %s | %s / %s | %s | %.1f %% | %d of %d | %.3g J |\n", sequence, name,
                mm(value["err_n1_difference"]), mm(value["err_n2_difference"]),
                mm(value["gt2pred_mean"]), 100 * value["density_max_error"], value["escaped_max"],
                value["fluid"], value["kinetic_" last] != "" ? value["kinetic_" last] : value["kinetic_final"]
        }' "$csv"
}

table() {
    model=$1
    name=$(basename "$model" .safetensors)
    echo "| sequence | method | errors after one / two frames, mm | truth to prediction, mm | max. density error | escaped | kinetic energy at the end |"
    echo "|---|---|---|---|---|---|---|"
    case $name in
    *3d*)
        for sequence in test/test_000 test/test_001 general/dam_break general/hydrostatic_column; do
            row "$name" "$model" 1 "$data/liquid3d/$sequence.safetensors"
            for published in dmcf cconv; do
                row "$published" "$data/weights/$published-liquid3d.safetensors" 1 \
                    "$data/liquid3d/$sequence.safetensors"
            done
        done ;;
    *2d*)
        for sequence in test/test_00 test/test_01; do
            row "$name" "$model" 2 "$data/wbc2d/$sequence.safetensors"
        done ;;
    esac
}

droplets() {
    case $1 in *3d*) scene="droplets-3d --size 10" ;; *) scene="droplets-2d --size 24" ;; esac
    # shellcheck disable=SC2086
    $ascc sim "$1" $scene -n 300 -o "$csv.droplets" 2>/dev/null |
        grep -E '^(momentum error|angular mom. error|energy)' | sed 's/^/    /'
}

[ $# -gt 0 ] || set -- $(cd examples/models && ls *.safetensors | sed 's/\.safetensors//')
for name in "$@"; do
    model=examples/models/$name.safetensors
    card=docs/models/$name.md
    [ -f "$card" ] || echo "# $name" >"$card"
    sed '/^## Measured/,$d' "$card" >"$csv.card"
    {
        cat "$csv.card"
        echo "## Measured"
        echo
        echo "By \`sh docs/make_cards.sh $name\`; the first two figures start from true states with velocities by frame difference, the others are of a"
        echo "rollout from the first frame to the end. The data is described in docs/measures.md; none of these sequences was looked at while training."
        echo
        table "$model"
        echo
        echo "Two drops that collide without gravity and walls, 300 steps:"
        echo
        droplets "$model"
        echo
        $ascc info "$model" | sed 's/^/    /; s|examples/models/||'
    } >"$csv.new"
    cp "$csv.new" "$card"
done
