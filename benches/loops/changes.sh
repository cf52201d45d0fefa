#!/bin/sh
# What `armcal regress` catches: five things made worse on purpose, each over the seeds of one block, one after the other.
#
#   benches/loops/changes.sh ARMCAL BASELINE.csv FOLDER [SEEDS]
#
# BASELINE.csv: a block of the quickstart that run.sh left, with its summary beside it. SEEDS: fewer of them, as A..B. FOLDER gets
# NAME.csv (the runs) and NAME.md (the comparison) of each change; a change whose runs are there is compared anew without running.
set -eu
armcal=$1 baseline=$2 folder=$3 routine=routines/titan4-quickstart.toml
mkdir -p "$folder"
all=$(tail -n +2 "$baseline" | cut -d, -f3 | sort -n)
seeds=${4:-$(echo "$all" | head -1)..$(echo "$all" | tail -1)}

change() {
    name=$1
    shift
    "$armcal" --quiet campaign "$routine" --seeds "$seeds" --threads "${THREADS:-1}" --out "$folder/$name.csv" "$@" > /dev/null || true
    code=0
    "$armcal" --quiet regress "$routine" --baseline "$baseline" --rows "$folder/$name.csv" --report "$folder/$name.md" > /dev/null || code=$?
    echo "$name: exit code $code ($(sed -n 3p "$folder/$name.md"))"
}

change noise --set world.camera.corner_noise_px=0.36                      # 0.3 px and 20 %
change bias --set world.hydraulics.controller_bias_rad=0.0034907          # 0.2 deg at each joint
change clearance --set capture.clearance_m=0.04                           # 10 mm less
change skipped --set 'step.3.targets=[0,1,2,3,4,5,6,7,8,9,10,11,12]'      # the last target of the second reach
change time --set capture.dwell_s=2.6                                     # about a fifth more simulated time: the table says how much
