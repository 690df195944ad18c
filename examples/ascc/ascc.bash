# Completion of ascc for bash: commands, options, models and scenes, as the program itself tells them.
# SPDX-License-Identifier: MIT

_ascc_models() {
    local program folder file
    program=$(readlink -f "$(type -P "$1")")
    while IFS= read -r -d : folder; do
        for file in "$folder"/*.safetensors; do
            [[ -e $file ]] && file=${file##*/} && echo "${file%.safetensors}"
        done
    done <<<"${ASCC_MODEL_PATH:-}:${program%/*}:${program%/*}/models:${program%/*}/../share/ascc/models:"
}

_ascc() {
    local current=${COMP_WORDS[COMP_CWORD]} program=${COMP_WORDS[0]} command=${COMP_WORDS[1]:-} words
    COMPREPLY=()
    if ((COMP_CWORD == 1)); then
        words=$("$program" --help 2>/dev/null | sed -n 's/^  \([a-z]*\)  .*/\1/p')
    elif [[ $current == -* ]]; then
        words=$("$program" "$command" --help 2>/dev/null | grep -oE '(^|[[ ])--?[a-z]+(-[a-z]+)*' | tr -d '[ ')
    else
        case $command in
        sim | view) words="demo $(_ascc_models "$program") $("$program" sim --help | grep -oE '[a-z-]+-[23]d')" ;;
        eval) words="ballistic sph: pbf: demo $(_ascc_models "$program")" ;;
        info | relax | trust) words=$(_ascc_models "$program") ;;
        generate) words=$("$program" generate --help | sed -n 's/^  \([a-z0-9-]*\)  .*/\1/p') ;;
        *) words= ;;
        esac
        mapfile -t COMPREPLY < <(compgen -f -- "$current")
    fi
    mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -W "$words" -- "$current")
}
complete -o filenames -F _ascc ascc
