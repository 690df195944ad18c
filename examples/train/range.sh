# Makes a set over the whole range of scenes, and configs that train from it alone; data2d.sh and data3d.sh say of
# what. SPDX-License-Identifier: MIT
# Sourced in examples/train, with $ascc, $out (under runs), $share (per cent of every kind) and $threads.

# kind NAME COUNT [OPTIONS]: sequences of a kind into $out/made, and into $out/train where the linter passes them; of
# $seed, or 1.
# Files that exist stay: the same command goes on where it was stopped.
kind() {
    name=$1
    count=$((($2 * share + 99) / 100))
    shift 2
    "$ascc" generate "$name" -o "$out/made" --seed ${seed:-1} --count $count --threads "$threads" "$@"
    keep "$out/train" "$out/made/${name}_${seed:-1}_"
}

# valid NAME [OPTIONS]: one sequence of another seed into $out/valid.
valid() {
    name=$1
    shift
    "$ascc" generate "$name" -o "$out/made" --seed $((${seed:-1} + 1000)) --count 1 "$@"
    keep "$out/valid" "$out/made/${name}_$((${seed:-1} + 1000))_"
}

# keep FOLDER PREFIX: links there for the files that pass.
keep() {
    mkdir -p "$1"
    for file in "$2"*.safetensors; do
        [ -e "$1/${file##*/}" ] && continue
        if "$ascc" lint "$file" >"$out/lint.txt"; then
            ln "$file" "$1/"
        else
            sed -n 2p "$out/lint.txt"
        fi
    done
}

# configs PATTERN [EVERY]: every config that matches, as runs/plain/NAME.json, with $out in place of its data: it trains
# in a plain clone, without sequences made elsewhere.
configs() {
    mkdir -p runs/plain
    every=${2:-1}
    for config in $1; do
        awk -v out="../${out#runs/}" -v every="$every" '
            /^  "data": \{/ {
                printf "  \"data\": {\n    \"train\": [{\"path\": \"%s/train/*.safetensors\", \"every\": %d}],\n", out, every
                printf "    \"valid\": [{\"path\": \"%s/valid/*.safetensors\", \"every\": %d}]\n  },\n", out, every
                inside = 1
            }
            !inside { gsub(/"runs\//, "\""); gsub(/"\.\.\/models\//, "\"../../../models/"); print }
            /^  },/ { inside = 0 }' "$config" >"runs/plain/$config"
    done
    echo "configs for a clone without other data: $(cd runs/plain && echo *.json)"
}

# spent: CPU time of all that this shell has run, and how many sequences there are.
spent() {
    echo "$(ls "$out"/train | wc -l) sequences to learn from, $(ls "$out"/valid | wc -l) to choose by, of $(ls "$out"/made | wc -l) made"
    times >"$out/times.txt" # not through a pipe: that would be another shell's
    awk 'END { split($1, a, /[ms]/); printf "CPU time of this run: %.4f core-hours\n", (60 * a[1] + a[2]) / 3600 }' \
        "$out/times.txt"
}
