#!/bin/sh
# A test engineer's job around `regress`: a baseline, a green run, a deliberate worsening that turns it red.
# After docs/guide/in-ci.md. About half a minute; two seeds.
#   ARMCAL=target/release/armcal sh tests/journeys/test-engineer.sh
set -eu
. "$(dirname "$0")/steps.sh"
cd "$REPOSITORY"
BASELINE=$FOLDER/baseline.csv

step 'check the inputs'
expect 0 "$ARMCAL" check robots/titan4 routines/regression.toml

step 'make a baseline'
expect 0 "$ARMCAL" regress routines/regression.toml --write-baseline "$BASELINE" --seeds 1..2
sees '2 runs: 2 accepted'
finds "$BASELINE" '# armcal baseline'

step 'compare the unchanged program with it: green'
expect 0 "$ARMCAL" regress routines/regression.toml --baseline "$BASELINE" --out "$FOLDER/new.csv" \
    --report "$FOLDER/green.xml" --report "$FOLDER/green.md"
sees 'every figure of every run is the same as in the baseline'
finds "$FOLDER/green.xml" 'failures="0"'
finds "$FOLDER/green.md" 'not worse than the baseline'
finds "$FOLDER/new.csv"

step 'make the camera worse on purpose: red, exit code 4'
expect 4 "$ARMCAL" regress routines/regression.toml --baseline "$BASELINE" --set world.camera.corner_noise_px=0.9 \
    --report "$FOLDER/red.xml"
sees 'regress      WORSE than the baseline'
sees 'armcal run routines/regression.toml --seed 1 --set world.camera.corner_noise_px=0.9'
finds "$FOLDER/red.xml" '<failure message='

step 'take another robot folder: that is no comparison, exit code 2'
cp -r robots/titan4 "$FOLDER/worse"
sed 's/^noise_std_counts = .*/noise_std_counts = 20.0/' robots/titan4/robot.toml >"$FOLDER/worse/robot.toml"
expect 2 "$ARMCAL" regress routines/regression.toml --baseline "$BASELINE" --robot "$FOLDER/worse"
sees 'robot `titan4` has changed since it was made'

echo 'test engineer: no dead end'
