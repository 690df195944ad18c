#!/bin/sh
# Measures the networks of examples/models and writes the tables of their cards, docs/models/*.md: what stands
# above the line "## Measured" of a card is kept. Those of examples/models/baselines share one, `baselines`.
# sh docs/make_cards.sh [NAME...]      needs ../shared/data and build/examples/ascc; takes some minutes
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
        function mm(x) { return sprintf("%.2f", 1000 * x) }
        END {
            last = value["last_frame"]
            energy = ("kinetic_" last) in value ? sprintf("%.3g J", value["kinetic_" last]) : ""
            printf "| %s | %s | %s / %s | %s | %.0f %% | %d of %d | %s |\n", sequence, name,
                mm(value["err_n1_difference"]), mm(value["err_n2_difference"]),
                mm(value["gt2pred_mean"]), 100 * value["published_density_error"],
                value["escaped_max"], value["fluid"], energy
        }' "$csv"
}

# The published networks' figures as they were given with the data.
published() {
    python3 - "$1" "$data/golden/pretrained-errors.json" <<'PYTHON'
import json, sys
scene = json.load(open(sys.argv[2]))["scenes"][sys.argv[1]]
for name in "dmcf", "cconv":
    error, r = scene["one_and_two_step"]["fd"].get(name), scene["rollout_" + name]
    errors = "%.2f / %.2f" % (1e3 * error["err_n1"], 1e3 * error["err_n2"]) if error else "not given"
    print("| %s | published %s | %s | %.2f | %.0f %% | %d of %d | %.3g J |" % (
        sys.argv[1].split("/")[1], name.upper(), errors,
        1e3 * r["gt2pred_mean"], 100 * r["max_density_error_vs_truth_max"], r["escaped_final"],
        scene["fluid"], r["kinetic_J"][str(r["final_frame"])]))
PYTHON
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
            published "$sequence"
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

# What was measured of a model file.
measured() {
    table "$1"
    echo
    echo "Two drops that collide without gravity and walls, 300 steps:"
    echo
    droplets "$1"
    echo
    $ascc info "$1" | sed "s/^/    /; s|$(dirname "$1")/||"
}

[ $# -gt 0 ] || set -- $(cd examples/models && ls *.safetensors | sed 's/\.safetensors//') baselines
for name in "$@"; do
    card=docs/models/$name.md
    [ -f "$card" ] || echo "# $name" >"$card"
    sed '/^## Measured/,$d' "$card" >"$csv.card"
    {
        cat "$csv.card"
        echo "## Measured"
        echo
        echo "By \`sh docs/make_cards.sh $name\`; the first two figures start from true states with velocities by frame difference, the others are of a"
        echo "rollout from the first frame to the end (density with walls counted; figures as in docs/measures.md). None of these sequences was looked at"
        echo "while training. Figures of published networks came with the data."
        echo
        if [ "$name" = baselines ]; then
            for model in examples/models/baselines/*.safetensors; do
                printf '### %s\n\n' "$(basename "$model" .safetensors)"
                measured "$model"
                echo
            done
        else
            measured "examples/models/$name.safetensors"
        fi
    } >"$csv.new"
    cp "$csv.new" "$card"
done
