#!/bin/sh
# A pilot's first hour: the quickstart, a look at its result, and two refusals to act on by their own words.
# After docs/guide/first-hour.md, reading-results.md and troubleshooting.md. About a minute.
#   ARMCAL=target/release/armcal sh tests/journeys/pilot.sh
set -eu
. "$(dirname "$0")/steps.sh"
cd "$REPOSITORY"

step 'run the first command of the README'
expect 0 "$ARMCAL" run routines/titan4-quickstart.toml --out "$FOLDER/dive"
sees '14 of 14'
sees 'calibration  ACCEPTED'
sees 'with priors  tool error'

step 'look at the run: the replay as a file, the report, the validity'
expect 0 "$ARMCAL" replay "$FOLDER/dive/run.mcap" --save "$FOLDER/dive.rrd"
finds "$FOLDER/dive.rrd"
finds "$FOLDER/dive/report.html" 'ACCEPTED'
expect 0 "$ARMCAL" check "$FOLDER/dive/calibration.toml"
sees 'valid for'

step 'calibrate in a hurry, from 8 poses'
expect 4 "$ARMCAL" run routines/titan4-quickstart.toml --set capture.poses=8 --set capture.held_out=0 --out "$FOLDER/hurry"
sees 'calibration  REFUSED: 8 views to fit are too few for 10 parameters'
sees 'capture more views'
finds "$FOLDER/hurry/report.html" 'too few'

step 'do what it says: capture more views'
expect 0 "$ARMCAL" run routines/titan4-quickstart.toml --set capture.poses=16 --set capture.held_out=0 --out "$FOLDER/more"
sees 'calibration  ACCEPTED'

step 'ask for 3.4 mm at the tool'
expect 4 "$ARMCAL" run routines/titan4-quickstart.toml --set task.tolerance_m=0.0034 --out "$FOLDER/fine"
sees 'calibration  REFUSED: predicted tool error with what no view shows is'
sees 'put a tag on the gripper'

step 'do what it says: put a tag on the gripper'
expect 0 "$ARMCAL" run routines/titan4-quickstart.toml --set task.tolerance_m=0.0034 --robot robots/titan4-gripper-tag --details --out "$FOLDER/gripper"
sees 'calibration  ACCEPTED'
sees 'the one on the gripper'

echo 'pilot: no dead end'
