#!/bin/sh
# Renews docs/before-after.svg, docs/replay.png and docs/report.png from a run of the quickstart. Takes two minutes.
#
#   docs/renew-pictures.sh [PROGRAM]      # armcal on PATH, if left out
#
# Needs armcal with the viewer's files (features `sim` and `viewer`, as `cargo build --release` has them), and on PATH:
# python3 with numpy and rosbags, rerun 0.36 (pip install rerun-sdk), chromium and pngquant. No window opens; without a
# graphics card the viewer needs a software Vulkan (mesa-vulkan-drivers).
set -eu

armcal=$(command -v "${1:-armcal}") || { echo "${1:-armcal} is no program" >&2; exit 2; }
case $armcal in /*) ;; *) armcal=$PWD/$armcal ;; esac
for tool in python3 rerun chromium pngquant; do
    command -v "$tool" >/dev/null || { echo "$tool is not on PATH; the first lines of $0 say what is needed" >&2; exit 2; }
done
cd "$(dirname "$0")/.."
work=$(mktemp -d)
viewer=
trap 'test -z "$viewer" || kill "$viewer" 2>/dev/null; rm -rf "$work"' EXIT INT TERM

"$armcal" run routines/titan4-quickstart.toml --out "$work/run" --quiet
python3 docs/before_after.py "$work/run" robots/titan4/titan4.urdf manipulator_link 0,-0.253,0 docs/before-after.svg

# One picture of the viewer: the arm at a target after calibration.
seconds=325 port=9976
RUST_LOG=error rerun "$work/run/run.rrd" --headless --bind 127.0.0.1 --port $port --renderer vulkan \
    --window-size 1600x1000 >"$work/viewer.log" 2>&1 &
viewer=$!
sleep 10
ask() { # ID METHOD PARAMETERS
    printf '{"jsonrpc":"2.0","id":%s,"method":"%s","params":%s}\n' "$1" "$2" "$3"
}
use() { # ID TOOL ARGUMENTS
    ask "$1" tools/call "{\"name\":\"$2\",\"arguments\":$3}"
}
{
    ask 1 initialize '{"protocolVersion":"2025-03-26","capabilities":{},"clientInfo":{"name":"pictures","version":"1"}}'
    printf '{"jsonrpc":"2.0","method":"notifications/initialized","params":{}}\n'
    use 2 connect "{\"endpoint\":\"http://127.0.0.1:$port\"}"
    sleep 5
    use 3 set_time "{\"timeline\":\"sim_time\",\"time\":${seconds}000000000}"
    sleep 5
    use 4 screenshot "{\"save_path\":\"$work/replay.png\",\"pixels_per_point\":1.0}"
    sleep 5
} | rerun viewer-mcp >"$work/answers.log" 2>&1
test -s "$work/replay.png" || { cat "$work/viewer.log" "$work/answers.log" >&2; exit 1; }

picture() { # PAGE WIDTH HEIGHT OUT: the top of a page, in light colors
    chromium --headless=new --no-sandbox --disable-gpu --hide-scrollbars --blink-settings=preferredColorScheme=1 \
        --user-data-dir="$work/chromium" --window-size="$2,$3" --screenshot="$work/page.png" \
        "file://$1" >"$work/chromium.log" 2>&1
    test -s "$work/page.png" || { cat "$work/chromium.log" >&2; exit 1; }
    # With a palette they are a third of the size.
    pngquant --force --strip --output "$4" 256 "$work/page.png"
    rm "$work/page.png"
}

# Without the viewer's own title bar.
echo '<body style="margin:-26px 0 0"><img src="replay.png" width="1400"></body>' >"$work/replay.html"
picture "$work/replay.html" 1400 849 docs/replay.png
picture "$work/run/report.html" 1000 1330 docs/report.png
ls -l docs/before-after.svg docs/replay.png docs/report.png
