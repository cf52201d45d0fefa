#!/bin/sh
# Closed loops of one frozen program, block by block, over as many sittings as it takes.
#
#   benches/loops/run.sh ARMCAL FOLDER [SECONDS] [FIRST]
#
# ARMCAL: the program, built once and not touched since; its hash is kept in FOLDER, and another program is refused.
# FOLDER: gets one table a block of 50 seeds, NAME-BLOCK.csv with its .parquet and -summary.json. Blocks that are there
# are not made again, a block that was broken off goes on. No block begins after SECONDS. The first FIRST (10) blocks of
# the first stratum come first, then all strata by turns. THREADS: one if not set. Run it from the root of the repository.
set -eu
armcal=$1 folder=$2 seconds=${3:-1000000000} first=${4:-10}
strata=$(dirname "$0")/strata.txt
mkdir -p "$folder"
hash=$(sha256sum < "$armcal" | cut -d' ' -f1)
[ -f "$folder/program.sha256" ] || echo "$hash" > "$folder/program.sha256"
if [ "$hash" != "$(cat "$folder/program.sha256")" ]; then
    echo "$folder: its blocks are of another program; take that one, or another folder" >&2
    exit 2
fi
began=$(date +%s)

# All blocks in their order: number of the block, then the stratum's line.
order() {
    awk -v first="$first" '
        /^#/ { next }
        { line[++n] = $0; blocks[n] = $3; if ($3 > most) most = $3 }
        END {
            for (k = 1; k <= first && k <= blocks[1]; k++) print k, line[1]
            for (k = 1; k <= most; k++)
                for (s = 1; s <= n; s++)
                    if (k <= blocks[s] && (s > 1 || k > first)) print k, line[s]
        }' "$strata"
}

order | while read -r block name from blocks routine options; do
    out=$folder/$name-$block.csv from=$((from + 50 * (block - 1)))
    if [ -f "$out" ] && [ ! -f "$out.partial" ]; then continue; fi
    if [ $(($(date +%s) - began)) -ge "$seconds" ]; then
        echo "time is over before $out; of $blocks blocks of $name"
        exit 0
    fi
    # Refused and failed runs are rows; what counts is that the table is there. Options are words.
    # shellcheck disable=SC2086
    "$armcal" --quiet campaign "$routine" $options --seeds "$from..$((from + 49))" --threads "${THREADS:-1}" --out "$out" \
        > /dev/null < /dev/null || true
    if [ ! -f "$out" ] || [ -f "$out.partial" ]; then
        echo "$out: broken off" >&2
        exit 1
    fi
    echo "$(date -u +%FT%TZ) $out"
done
