#!/usr/bin/env python3
"""Makes 30 mistakes, one at a time, and checks the first line in which the program reports each.

    ARMCAL=target/release/armcal python3 tests/journeys/refusals.py [FOLDER]

Prints, for each, the exit code, whether that line has the words for cause and remedy, and the lines, as Markdown. Ends
with 1 where one has not what is expected of it. About two minutes; Python's own library only. FOLDER keeps what was
made.
"""

import copy
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
ARMCAL = str(pathlib.Path(os.environ.get("ARMCAL", "target/release/armcal")).resolve())
FOLDER = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp()).resolve()
ROBOT = REPOSITORY / "robots/titan4"
ROUTINE = REPOSITORY / "routines/titan4-quickstart.toml"
TAGS = tomllib.loads((ROBOT / "robot.toml").read_text())["tag"]


def armcal(*args):
    """Exit code, and the first line that says what is wrong."""
    done = subprocess.run([ARMCAL, *map(str, args)], cwd=FOLDER, capture_output=True, text=True)
    says = re.compile(r"(error|calibration +(REFUSED|ACCEPTED, )|warning)\b")
    lines = (done.stderr + done.stdout).splitlines()
    for start in ("error", "calibration", "warning"):
        for line in lines:
            if line.startswith(start) and says.match(line):
                return done.returncode, line
    return done.returncode, ""


def run(name, *settings, seed=1):
    sets = [word for setting in settings for word in ("--set", setting)]
    return armcal("run", ROUTINE, "--seed", seed, *sets, "--out", name)


def calibrate(*more, recording="quick/run.mcap", robot=ROBOT):
    return armcal("calibrate", recording, "--robot", robot, *more, "--out", "result")


def with_map(change):
    """The survey, changed, as a tag map."""
    tags = copy.deepcopy(TAGS)
    change(tags)
    lines = ['version = 1\nkind = "tag_map"\nframe = "base_link"\n']
    keys = ("id", "size_m", "position_m", "quaternion_wxyz", "position_std_m", "rotation_std_rad")
    for tag in tags:
        three = {key: [tag.get(key, 0.0)] * 3 for key in keys[4:]}
        lines += ["[[tag]]"] + [f"{key} = {three.get(key) or tag[key]}" for key in keys] + [""]
    (FOLDER / "changed.toml").write_text("\n".join(lines))
    return calibrate("--tag-map", "changed.toml")


def with_robot(file, *changes):
    """A copy of the robot folder with `changes`, pairs of a pattern and what takes its place."""
    folder = FOLDER / "changed-robot"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROBOT, folder)
    text = (folder / file).read_text()
    for old, new in changes:
        text, n = re.subn(old, new, text)
        assert n == 1, f"{old}: {n} times in {file}"
    (folder / file).write_text(text)
    return calibrate(robot=folder)


def moved(by_m):
    """`by_m` has tag ids and ways, m."""

    def change(tags):
        for tag in tags:
            tag["position_m"] = [a + b for a, b in zip(tag["position_m"], by_m.get(tag["id"], (0, 0, 0)))]

    return change


def sized(size_m, ids=range(100)):
    return lambda tags: [tag.update(size_m=size_m) for tag in tags if tag["id"] in ids]


def ring(n):
    """The first n tags have the next one's id."""
    return lambda tags: [tag.update(id=(tag["id"] + 1) % n) for tag in tags if tag["id"] < n]


def another_site(tags):
    """The same tags in other places."""
    for k, tag in enumerate(tags):
        tag["position_m"] = [1.5 * math.cos(2.4 * k), 1.5 * math.sin(2.4 * k), 0.3 * k - 1.0]


def turned(tags):
    """By 90 deg about z."""
    half = math.sqrt(0.5)
    for tag in tags:
        x, y, z = tag["position_m"]
        tag["position_m"] = [-y, x, z]
        w, i, j, k = tag["quaternion_wxyz"]
        tag["quaternion_wxyz"] = [half * (w - k), half * (i - j), half * (i + j), half * (w + k)]


def other_order(tags):
    for tag in tags:
        w, *xyz = tag["quaternion_wxyz"]
        tag["quaternion_wxyz"] = [*xyz, w]


def other_ids(tags):
    for tag in tags:
        tag["id"] += 20


def fault(at_s, kind, keys):
    return f'world.fault=[{{at_s={at_s},kind="{kind}",{keys}}}]'


LINK = r'(<joint name="{}"[^>]*>(?:(?!</joint>)[\s\S])*?<origin xyz=")([^"]*)(" rpy=")([^"]*)'
FIVE = {0: (0.1, 0.02, 0), 1: (0, 0.06, 0.03), 2: (-0.04, 0, 0.09), 5: (0, 0.03, -0.08), 6: (0.136, 0, 0)}
LENS = {
    "focal": r"focal_px = \[387.33, 387.06\]",
    "centre": r"center_px = \[633.605, 510.9\]",
    "size": r"resolution_px = \[1224, 1024\]",
    "model": r'model = "equidistant"',
    "distortion": r"distortion = \[0.02268, -0.01345, 0.01296, -0.00418\]",
}
HALF = [(LENS["focal"], "focal_px = [193.665, 193.53]"), (LENS["centre"], "center_px = [316.8, 255.45]")]
WRONG_MAP = ["tag map"]

# Number, what is wrong, what makes it, exit code, words of the cause, words of the remedy: as patterns.
CASES = [
    (1, "one tag moved by 50 mm", lambda: with_map(moved({1: (0.05, 0, 0)})), 0, ["tag 1 hangs 50"], ["correct the survey"]),
    (1, "five of eight tags moved", lambda: with_map(moved(FIVE)), 0, ["tag 1 ", "tags [0-9, and]*5"], ["correct the survey"]),
    (1, "a tag moved by 100 mm while the arm looked around",
     lambda: run("moved", fault(180.0, "tag_moved", "id=0,by_m=[0.1,0.0,0.0]")), 0, ["tag 0 hangs 10"], ["correct the survey"]),
    (2, "all tags 120 mm in the map, 150 mm in truth", lambda: with_map(sized(0.12)), 0, ["all tags are 25"], ["measure"]),
    (2, "one tag 100 mm in the map", lambda: with_map(sized(0.1, [2])), 0, [r"tag 2 is 50\.\d % larger"], ["measure"]),
    (3, "focal length 40 % too long", lambda: with_robot("robot.toml", (LENS["focal"], "focal_px = [542.26, 541.88]")),
     0, ["focal length is 28.* shorter"], ["measure the intrinsics again"]),
    (3, "a pinhole lens for a fisheye",
     lambda: with_robot("robot.toml", (LENS["model"], 'model = "pinhole"'),
                        (LENS["distortion"], "distortion = [0.0, 0.0, 0.0, 0.0, 0.0]"),
                        (r"max_view_angle_rad = 1.4\n", "")),
     4, ["not of the model"], ["state the model"]),
    (3, "the lens of an image of half the size",
     lambda: with_robot("robot.toml", (LENS["size"], "resolution_px = [612, 512]"), *HALF),
     4, ["612 x 512"], ["state the lens of the recorded image size"]),
    (3, "the same, with the image's full size stated", lambda: with_robot("robot.toml", *HALF),
     4, ["0.5 times the size"], ["state the lens of the recorded image size"]),
    (4, "upper arm 50 mm longer",
     lambda: with_robot("titan4.urdf", (LINK.format("forearm_pitch"), r"\1-0.17691 0.88228 0\3\4")),
     0, ["upperarm_link"], ["correct the drawing"]),
    (4, "two links 300 mm longer, two twisted by 23 deg",
     lambda: with_robot("titan4.urdf", (LINK.format("forearm_pitch"), r"\1-0.17691 1.13228 0\g<3>\4"),
                        (LINK.format("wrist_pitch"), r"\1-0.71087 -0.25316 0\g<3>\4"),
                        (LINK.format("shoulder_pitch"), r"\g<1>\g<2>\g<3>0.4 0 0.030024"),
                        (LINK.format("wrist_yaw"), r"\g<1>\g<2>\g<3>-1.144 1.2303 0.017368")),
     4, ["link is not as drawn"], ["correct the drawing"]),
    (5, "a sensor slips in the middle of the capture",
     lambda: run("slip", fault(200.0, "sensor_jump", 'joint="wrist_pitch",by_rad=0.1')),
     0, ["wrist_pitch slipped"], ["fasten"]),
    (5, "a sensor slips two views before the end",
     lambda: run("late-slip", fault(285.0, "sensor_jump", 'joint="wrist_pitch",by_rad=0.1')),
     4, ["wrist_pitch", "slipped"], ["fasten"]),
    (6, "8 views", lambda: run("few", "capture.poses=8", "capture.held_out=0"), 4, ["8 views"], ["capture more views"]),
    (7, "a prior of another arm", lambda: calibrate("--prior", "other-arm/calibration.toml"),
     4, ["contradict the prior"], ["without the prior"]),
    (7, "a prior from before a sensor slipped by 5.7 deg",
     lambda: calibrate("--prior", "quick/calibration.toml", recording="slipped-before/run.mcap"),
     4, ["contradict the prior", "wrist_pitch"], ["without the prior"]),
    (7, "a prior from the same recording", lambda: calibrate("--prior", "quick/calibration.toml"),
     4, ["these very messages"], ["other views"]),
    (8, "no tag at the site", lambda: run("none", "site.tags=[]"), 2, ["site.tags"], ["needs one tag"]),
    (8, "two tags, and views must show three", lambda: run("two", "site.tags=[0,1]"), 2, ["3 of the 2"], ["add tags"]),
    (8, "the camera sees nothing from 60 s on",
     lambda: run("silt", fault(60.0, "silt", "seconds=10000.0")), 1, ["saw no tag"], ["check camera, light, water"]),
    (8, "its recording calibrated", lambda: calibrate(recording="silt/run-cut-1.mcap"),
     2, ["no tag at all|no surveyed tag"], ["check its images"]),
    (8, "ids of the map that no view shows", lambda: with_map(other_ids), 2, ["no surveyed tag", "seen: \\[0"], ["correct"]),
    (9, "ids of two tags exchanged", lambda: with_map(ring(2)), 0, ["one another's places"], ["correct their ids"]),
    (9, "ids of three tags exchanged in a ring", lambda: with_map(ring(3)), 0, ["one another's places"], ["correct"]),
    (9, "ids of five tags exchanged in a ring", lambda: with_map(ring(5)), 0, ["one another's places"], ["correct"]),
    (9, "ids of all eight tags exchanged in a ring", lambda: with_map(ring(8)), 4, WRONG_MAP, ["check the tags' ids"]),
    (9, "the map of another site", lambda: with_map(another_site), 4, WRONG_MAP, ["give the tag map of this site"]),
    (9, "the map's frame turned by 90 deg", lambda: with_map(turned), 4, ["turned by [89]"], ["correct the map"]),
    (9, "quaternions written x, y, z, w", lambda: with_map(other_order), 4, ["order x, y, z, w"], ["write"]),
    (10, "a sensor that counts the other way", lambda: run("reversed", "world.gear_ratio.shoulder_pitch=-1.0"),
     4, ["shoulder_pitch is reversed"], ["swap its ends"]),
]


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    for made, args in (("quick", []), ("slipped-before", [fault(0.0, "sensor_jump", 'joint="wrist_pitch",by_rad=0.1')])):
        run(made, *args)
    run("other-arm", seed=2)
    rows = []
    for number, what, make, expected, cause, remedy in CASES:
        code, line = make()
        has = [how_many(words, line) for words in (cause, remedy)]
        rows.append((number, what, code, *has, shortened(line, cause), code == expected and "NO" not in has))
    print("| # | what was done | code | cause | remedy |\n|--:|---|--:|---|---|")
    for number, what, code, cause, remedy, _, is_met in rows:
        print(f"| {number} | {what} | {code} | {cause} | {remedy} |{'' if is_met else ' <- not as expected'}")
    print("\n## The lines\n\n```text")
    for _, what, *_, line, _ in rows:
        print(f"{what}:\n    {line}")
    print("```")
    short = sum(not row[-1] for row in rows)
    print(f"{len(rows) - short} of {len(rows)} as expected", file=sys.stderr)
    return short > 0


def how_many(words, line):
    found = [bool(re.search(word, line)) for word in words]
    return "yes" if all(found) else "in part" if any(found) else "NO"


def shortened(line, words):
    """Without this folder, and without what is said besides, where that has none of `words`."""
    line = line.replace(f"{FOLDER}/", "").replace(f"{REPOSITORY}/", "")
    first = re.sub(r"; besides, .*", "; besides, ..", line)
    return first if how_many(words, first) == how_many(words, line) else line


if __name__ == "__main__":
    sys.exit(main())
