#!/bin/sh
# Trains the networks of examples/train/ablation-*.json where they are not there yet, measures them on the valid
# sequences and writes docs/ablations.md. Half an hour on one core.
# sh docs/make_ablations.sh      needs ../shared/data and build/examples/ascc
# SPDX-License-Identifier: MIT
set -eu
cd "$(dirname "$0")/.."
ascc=build/examples/ascc
data=../shared/data/liquid3d/valid
csv=$(mktemp)
trap 'rm -f "$csv"' EXIT
names="base no-ascc single-scale farthest no-warm-up grid projection-off direction-seen no-damping"

for name in $names; do
    config=examples/train/ablation-$name.json
    model=examples/train/runs/ablation-$name-latest.safetensors
    trained=examples/train/runs/ablation-$name.csv
    [ -f "$trained" ] && grep -q '^360,' "$trained" || "$ascc" train "$config" --resume --threads 1 >&2
    seconds=$(awk -F, 'END { printf "%.0f", $8 }' "$trained")
    cost=$("$ascc" info "$model" | awk '$1 == "cost" { print $3 }')
    "$ascc" eval --quiet --velocity difference --csv "$csv" "$model" "$data"/valid_00*.safetensors >/dev/null 2>&1
    text=$(sed -n 's/.*"description": "\(.*\)".*/\1/p' "$config")
    awk -F, -v name="$name" -v text="$text" -v cost="$cost" -v seconds="$seconds" '
        { value[$3] += $4; count[$3]++ }
        function mean(key) { return count[key] ? value[key] / count[key] : 0 }
        END {
            printf "| `%s` | %s | %s | %s | %.2f / %.2f | %.1f | %.0f | %.0f %% | %.1e |\n", name, text, cost, seconds,
                1000 * mean("err_n1_difference"), 1000 * mean("err_n2_difference"), 1000 * mean("gt2pred_mean"),
                value["escaped_max"], 100 * mean("published_density_error"), mean("wall_balance_max")
        }' "$csv"
done >"$csv.rows"
{
    cat <<'TEXT'
# Ablations

What each part of a network is worth when training is short: every network differs from `base` in one thing, has 8 channels and two coarser levels, and was trained
for 360 iterations of four rollouts (240 of one step, 120 of two steps after up to six without gradient), one seed, on `../shared/data/liquid3d/train`. Figures are of the
two valid sequences (150 frames, 4,796 particles together): errors after one and two frames from true states, then of rollouts from the first frame to the end, the mean of both; escapes are the sum; momentum not accounted for is `wall_balance_max` of docs/measures.md, 1e-10 is rounding of that measure.
`sh docs/make_ablations.sh` trains and measures; seconds are of one thread.

| name | what is different | multiply-adds | training, s | errors after one / two frames, mm | truth to prediction, mm | escaped | max. density error | momentum not accounted for |
|---|---|---|---|---|---|---|---|---|
TEXT
    cat "$csv.rows"
    [ ! -f docs/ablations.md ] || sed -n '/^## /,$p' docs/ablations.md | sed '1i\\'
} >"$csv.page"
mv "$csv.page" docs/ablations.md
rm -f "$csv.rows"
