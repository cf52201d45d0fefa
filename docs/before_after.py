"""Draws before-after.svg from a simulated run: the arm at one target, and the tool errors at all targets.

    before_after.py RUN_FOLDER ARM.urdf TOOL_LINK X,Y,Z OUT.svg

The tool is the point X,Y,Z (m) of TOOL_LINK. docs/renew-pictures.sh calls this. Needs numpy and rosbags.
"""

import json
import sys
import xml.etree.ElementTree as ET
from itertools import product
from pathlib import Path

import numpy as np
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

INK, FAINT, BLUE, GHOST, RED, GREEN = "#1b2733", "#5b6b79", "#2f7fc1", "#cfe4f6", "#c62828", "#0a7a3b"
WIDTH, HEIGHT, COLUMN, ARM_WIDTH, ARM_HEIGHT, SIDE = 1000, 400, 505, 310, 285, 405
DIAL_RADIUS, DIAL_MM = 74, 160


def numbers(element, key, default="0 0 0"):
    found = element.get(key) if element is not None else None
    return np.array([float(value) for value in (found or default).split()])


def turn(axis, angle):
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def pose(element):
    """The pose of an element's <origin>."""
    origin = element.find("origin")
    roll, pitch, yaw = numbers(origin, "rpy")
    out = np.eye(4)
    out[:3, :3] = turn(np.array([0, 0, 1]), yaw) @ turn(np.array([0, 1, 0]), pitch) @ turn(np.array([1, 0, 0]), roll)
    out[:3, 3] = numbers(origin, "xyz")
    return out


def corners(geometry):
    """Points whose convex hull is the shape, and nearly so for round ones."""
    ring = [(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 24, endpoint=False)]
    kind = geometry[0]
    size = numbers(kind, "size") / 2
    radius, half = float(kind.get("radius", 0)), float(kind.get("length", 0)) / 2
    if kind.tag == "box":
        return np.array([np.multiply(size, sign) for sign in product((-1, 1), repeat=3)])
    if kind.tag == "cylinder":
        return np.array([[radius * c, radius * s, z] for c, s in ring for z in (-half, half)])
    tilts = np.linspace(0, np.pi, 13)
    return radius * np.array([[np.sin(t) * c, np.sin(t) * s, np.cos(t)] for t in tilts for c, s in ring])


class Arm:
    """Links, joints and visual shapes of a URDF."""

    def __init__(self, urdf):
        self.root = ET.parse(urdf).getroot()
        self.joint_of = {joint.find("child").get("link"): joint for joint in self.root.findall("joint")}
        self.colors = {m.get("name"): numbers(m.find("color"), "rgba", "")[:3] for m in self.root.findall("material")}

    def link(self, name, angles):
        """base_from_link."""
        joint = self.joint_of.get(name)
        if joint is None:
            return np.eye(4)
        at = self.link(joint.find("parent").get("link"), angles) @ pose(joint)
        if joint.get("type") != "fixed":
            at[:3, :3] = at[:3, :3] @ turn(numbers(joint.find("axis"), "xyz"), angles[joint.get("name")])
        return at

    def shapes(self, angles):
        """(points in the base frame, color) of every shape."""
        for link in self.root.findall("link"):
            at = self.link(link.get("name"), angles)
            for visual in link.findall("visual"):
                points = corners(visual.find("geometry"))
                placed = at @ pose(visual)
                yield points @ placed[:3, :3].T + placed[:3, 3], self.colors[visual.find("material").get("name")]


def turns_left(a, b, c):
    return (b[0] - a[0]) * (c[1] - b[1]) > (b[1] - a[1]) * (c[0] - b[0])


def hull(points):
    """Corners of the convex hull in a plane, in order."""
    points = sorted(map(tuple, points))
    around = []
    for row in (points, points[::-1]):
        half = []
        for p in row:
            while len(half) > 1 and not turns_left(half[-2], half[-1], p):
                half.pop()
            half.append(p)
        around += half[:-1]
    return around


def messages(path):
    """(topic, message) of a recording."""
    store = get_typestore(Stores.ROS2_JAZZY)
    reader = McapReader(path)
    reader.open()
    wanted = [c for c in reader.connections if not c.msgtype.startswith("foxglove")]
    for connection in wanted:
        store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
    for connection, _, data in reader.messages(wanted):
        yield connection.topic, store.deserialize_cdr(data, connection.msgtype)


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


def rests(run):
    """By attempt and target: its position, and the arm's true and estimated angles at rest there."""
    marks, states, targets = [], {"/joint_states": [], "/truth/joint_states": []}, []
    for topic, message in [*messages(run / "run.mcap"), *messages(run / "truth.mcap")]:
        if topic == "/marks" and message.kind.startswith("reach_"):
            span = seconds(message.start), seconds(message.end)
            marks.append((message.kind.removeprefix("reach_"), message.index, *span))
        elif topic == "/task":
            targets = [np.array([p.x, p.y, p.z]) for p in message.targets]
        elif topic in states:
            states[topic].append((seconds(message.header.stamp), message.position))
            names = message.name
    out = {}
    for attempt, index, start, end in marks:
        mean = lambda topic: np.mean([p for time, p in states[topic] if start <= time <= end], axis=0)
        angles = [dict(zip(names, mean(topic))) for topic in ("/truth/joint_states", "/joint_states")]
        out.setdefault(attempt, {})[index] = (targets[index], *angles)
    return out


class View:
    """The arm from the side: the horizontal direction `right` to the right, up is up."""

    def __init__(self, arm, right, left_px, low, high):
        self.arm, self.right, self.left_px, self.low = arm, right, left_px, low
        self.per_m = min(ARM_WIDTH / (high[0] - low[0]), ARM_HEIGHT / (high[1] - low[1]))

    def place(self, point):
        x, y = self.per_m * (flat(self.right, point) - self.low)
        return self.left_px + x, HEIGHT - 50 - y

    def outlines(self, angles):
        """(points, color) of every shape, from far to near."""
        away = np.array([-self.right[1], self.right[0], 0])
        for points, color in sorted(self.arm.shapes(angles), key=lambda shape: -(shape[0] @ away).mean()):
            yield " ".join(f"{x:.1f},{y:.1f}" for x, y in hull([self.place(point) for point in points])), color

    def solid(self, angles):
        shade = lambda rgb: "#%02x%02x%02x" % tuple(int(255 * (0.25 + 0.75 * value)) for value in rgb)
        return [f'<polygon points="{outline}" fill="{shade(color)}" stroke="{INK}" stroke-width="0.8"/>'
                for outline, color in self.outlines(angles)]

    def ghost(self, angles):
        """One silhouette: the fills hide the strokes between shapes."""
        outlines = [outline for outline, _ in self.outlines(angles)]
        strokes = [f'<polygon points="{outline}" stroke="{BLUE}" stroke-width="3"/>' for outline in outlines]
        return strokes + [f'<polygon points="{outline}" fill="{GHOST}"/>' for outline in outlines]


def flat(right, point):
    return np.array([point @ right, point[2]])


def text(x, y, words, size=14, color=FAINT, weight=400, anchor="start"):
    return (f'<text x="{x:.0f}" y="{y:.0f}" font-size="{size}" fill="{color}" font-weight="{weight}" '
            f'text-anchor="{anchor}">{words}</text>')


def dial(x, y, errors, color):
    """Errors (to the right, up; m) around the middle."""
    per_mm = DIAL_RADIUS / DIAL_MM
    out = [f'<circle cx="{x}" cy="{y}" r="{mm * per_mm:.1f}" fill="none" stroke="#b9c4ce"/>' for mm in (50, 100, 150)]
    out += [f'<path d="M{x - 6} {y}h12M{x} {y - 6}v12" stroke="{BLUE}" stroke-width="2"/>']
    out += [f'<circle cx="{x + 1e3 * per_mm * e[0]:.1f}" cy="{y - 1e3 * per_mm * e[1]:.1f}" r="4" fill="{color}" '
            f'fill-opacity="0.8"/>' for e in errors]
    return out + [text(x, y + mm * per_mm + 11, mm, 10, anchor="middle") for mm in (50, 100, 150)]


def legend(n_targets):
    y = HEIGHT - 10
    mark = lambda x, fill, edge: f'<rect x="{x}" y="{y - 11}" width="18" height="12" fill="{fill}" stroke="{edge}"/>'
    dot = lambda x, color: f'<circle cx="{x}" cy="{y - 5}" r="4" fill="{color}"/>'
    return [f'<path d="M0 {y - 24}h{WIDTH}M{COLUMN - 5} 10v{y - 44}" stroke="#d5dce3"/>',
            mark(10, "#b5b6b8", INK), text(34, y, "real arm"),
            mark(118, GHOST, BLUE), text(142, y, "arm as the controller estimates it"),
            ring(412, y - 5, 7), text(426, y, "target"),
            dot(497, RED), dot(509, GREEN),
            text(520, y, f"real tool relative to the estimated tool (+), {n_targets} targets, in mm")]


def ring(x, y, radius):
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="none" stroke="{INK}" stroke-width="2.5"/>'


def radial(target):
    """The horizontal direction from the base to a target."""
    return np.array([target[0], target[1], 0]) / np.hypot(target[0], target[1])


def on_dial(target, error):
    """An error as seen from the base: its whole length, in the direction to the right and up."""
    across = np.array([radial(target)[1], -radial(target)[0], 0])
    seen = flat(across, error)
    return np.linalg.norm(error) * seen / np.linalg.norm(seen)


def main():
    run, urdf, link, point, out = sys.argv[1:]
    arm, tool = Arm(urdf), np.append([float(v) for v in point.split(",")], 1.0)
    tool_at = lambda angles: (arm.link(link, angles) @ tool)[:3]
    found = rests(Path(run))
    score = json.loads((Path(run) / "summary.json").read_text())["score"]
    errors = {attempt: {index: tool_at(truth) - tool_at(estimate) for index, (_, truth, estimate) in rows.items()}
              for attempt, rows in found.items()}
    median_m = {attempt: score[attempt]["tool_error_m"]["median"] for attempt in found}
    for attempt, rows in errors.items():
        drawn_m = np.median([np.linalg.norm(error) for error in rows.values()])
        assert abs(drawn_m - median_m[attempt]) < 1e-3, f"{attempt}: {drawn_m} m, summary.json {median_m[attempt]} m"
    # The target whose error, seen from the side, is nearest to the median.
    seen_m = lambda index: np.linalg.norm(flat(radial(found["before"][index][0]), errors["before"][index]))
    chosen = min(errors["before"], key=lambda index: abs(seen_m(index) - median_m["before"]))
    right = radial(found["before"][chosen][0])
    seen = np.array([flat(right, p) for rows in found.values() for angles in rows[chosen][1:]
                     for points, _ in arm.shapes(angles) for p in points])
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
           'font-family="DejaVu Sans,Verdana,Arial,sans-serif">',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>', *legend(len(errors["before"]))]
    for left, attempt, color in [(10, "before", RED), (10 + COLUMN, "after", GREEN)]:
        view = View(arm, right, left, seen.min(axis=0) - 0.03, seen.max(axis=0) + 0.03)
        target, truth, estimate = found[attempt][chosen]
        (x, y), (tx, ty) = view.place(tool_at(truth)), view.place(target)
        svg += view.ghost(estimate) + view.solid(truth)
        svg += [f'<path d="M{tx:.1f} {ty:.1f}L{x:.1f} {y:.1f}" stroke="{color}" stroke-width="4"/>', ring(tx, ty, 9)]
        svg += [text(left, 30, f"{attempt.capitalize()} calibration", 24, color, 700),
                text(left + SIDE, 96, f"{1e3 * median_m[attempt]:.1f} mm", 28, color, 700, "middle"),
                text(left + SIDE, 116, "median tool error", 13, anchor="middle"),
                text(left + SIDE, 140, f"{score[attempt]['hits']} of {score[attempt]['targets']} targets hit", 15, INK,
                     anchor="middle")]
        dots = [on_dial(found[attempt][index][0], error) for index, error in errors[attempt].items()]
        svg += dial(left + SIDE, 256, dots, color)
    Path(out).write_text("\n".join([*svg, "</svg>"]) + "\n")


main()
