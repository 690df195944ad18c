#!/bin/sh
# A page of the manual from what a command says of itself, on stdout.
#   make_man.sh PROGRAM [COMMAND]
# SPDX-License-Identifier: MIT
set -eu
program=$1
command=${2:-}
version=$("$program" version | cut -d' ' -f2)
summary='learned particle fluids that conserve momentum to the bit'
[ -z "$command" ] || summary=$("$program" --help | sed -n "s/^  $command  *//p")
[ -n "$summary" ] || { echo "make_man.sh: ascc --help does not list $command" >&2; exit 1; }

# shellcheck disable=SC2086
"$program" $command --help | awk -v name="ascc${command:+-$command}" -v version="$version" -v summary="$summary" '
    # Text that troff prints as it stands.
    function plain(text) {
        gsub(/\\/, "\\e", text)
        gsub(/-/, "\\-", text)
        if (text ~ /^[.\x27]/) text = "\\\\&" text
        return text
    }
    function literal(on) {
        if (on != in_literal) print on ? ".PP\n.nf" : ".fi"
        in_literal = on
    }
    BEGIN {
        printf ".TH %s 1 \"\" \"ascc %s\" \"ascc\"\n.SH NAME\n%s \\- %s\n.SH SYNOPSIS\n.nf\n", toupper(name), version, plain(name), plain(summary)
        in_literal = 1
        synopsis = 1
    }
    synopsis && /^(usage: )?ascc / { sub(/^usage: /, ""); print plain($0); next }
    synopsis && /^        / { sub(/^ +/, "    "); print plain($0); next }
    synopsis { literal(0); print ".SH DESCRIPTION"; synopsis = 0 }
    # An option and what it does, two or more spaces between them; lines below that start where it does belong to it.
    /^ +-/ && match(substr($0, 4), /[^ ]  +[^ ]/) {
        literal(0)
        column = RSTART + RLENGTH + 1
        printf ".TP\n\\fB%s\\fR\n%s\n", plain(substr($0, 3, RSTART + 1)), plain(substr($0, column + 1))
        option = 1
        next
    }
    option && /^      / { sub(/^ +/, ""); print plain($0); next }
    { option = 0 }
    /^$/ { literal(0); next }
    { literal(1); print plain($0) }
    END {
        literal(0)
        print ".SH ENVIRONMENT\n.TP\n.B ASCC_MODEL_PATH"
        print "folders, with colons between them, in which models are looked for by name; then those beside the program and those installed with it"
        print ".SH EXIT STATUS\n0: done; 1: it failed; 2: wrong usage"
        print ".SH SEE ALSO"
        print name == "ascc" ? "\\fBascc COMMAND \\-\\-help\\fR and the page of each command, such as \\fBascc\\-sim\\fR(1)" : "\\fBascc\\fR(1)"
    }'
