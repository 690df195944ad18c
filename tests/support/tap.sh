# TAP from a shell script that has cd'ed to the root: check and skip count in $number and $failed, $folder is
# for scratch and goes when the script ends. SPDX-License-Identifier: MIT
number=0
failed=0
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT

# check NAME COMMAND...: passes when the command does; shows its output when it does not.
check() {
    number=$((number + 1))
    name=$1
    shift
    if "$@" >"$folder/out" 2>&1; then
        echo "ok $number - $name"
    else
        echo "not ok $number - $name"
        sed 's/^/# /' "$folder/out"
        failed=1
    fi
}

skip() {
    number=$((number + 1))
    echo "ok $number - $1 # SKIP $2"
}

have() { command -v "$1" >/dev/null 2>&1; }
