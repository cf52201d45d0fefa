# What the journeys share. To be sourced; needs set -eu.
ARMCAL=${ARMCAL:-armcal}
case $ARMCAL in
*/*) ARMCAL=$(CDPATH='' cd "$(dirname "$ARMCAL")" && pwd)/$(basename "$ARMCAL") ;;
esac
REPOSITORY=$(CDPATH='' cd "$(dirname "$0")/../.." && pwd)
FOLDER=$(mktemp -d)
trap 'rm -rf "$FOLDER"' EXIT
trap 'exit 130' INT TERM HUP

# Says what the user does next.
step() {
    printf '%s\n' "- $1"
}

# Ends the journey: what the page promised did not come.
dead_end() {
    printf 'DEAD END: %s\n' "$1" >&2
    if [ -f "$FOLDER/said" ]; then cat "$FOLDER/said" >&2; fi
    exit 1
}

# expect CODE COMMAND...: runs it; its stdout and stderr stay in $FOLDER/said.
expect() {
    code=$1
    shift
    got=0
    "$@" >"$FOLDER/said" 2>&1 || got=$?
    [ "$got" -eq "$code" ] || dead_end "\`$*\` ended with $got, $code was promised"
}

# sees TEXT: the last command said this.
sees() {
    grep -qF -- "$1" "$FOLDER/said" || dead_end "nothing said: $1"
}

# finds FILE [TEXT]: the file is there, is not empty, and has this text.
finds() {
    [ -s "$1" ] || dead_end "$1 is missing or empty"
    grep -qF -- "${2:-}" "$1" || dead_end "$1 does not have: $2"
}
