"""OMPL's RRT-Connect and sampled edge check beside ours, on the scenes and queries of `armcal-lab edges` and `armcal-lab paths`.

Collisions and distances are Pinocchio's (coal, in C++), built from the same shapes with the margins as security margins and a dynamic
AABB tree as broad phase. Its times are of the processor; the checker is called from Python, which is a few us a state.
Usage: compare_ompl.py --edges recordings/study-edges/edges-titan4.json --paths recordings/study-paths/paths-*.json
"""

import argparse
import json
import time

import coal
import numpy as np
import pinocchio
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

LIMIT_S = 5.0
# Shares of the space's extent between two states that OMPL looks at; its default is the first.
RESOLUTIONS = [0.01, 0.005, 0.002, 0.001, 0.0005, 0.0002, 0.0001, 0.00005]


def placement(place):
    w, x, y, z = place["quaternion_wxyz"]
    return pinocchio.SE3(pinocchio.Quaternion(w, x, y, z).matrix(), np.array(place["position_m"]))


def geometry(shape):
    kind = shape["kind"]
    if kind == "box":
        return coal.Box(*shape["size_m"])
    if kind == "cylinder":
        return coal.Cylinder(shape["radius_m"], shape["length_m"])
    if kind == "capsule":
        return coal.Capsule(shape["radius_m"], shape["length_m"])
    if kind == "sphere":
        return coal.Sphere(shape["radius_m"])
    raise SystemExit(f"shapes of kind {kind} are not compared")


class Problem:
    """Arm, scene and which pairs keep which margin."""

    def __init__(self, problem):
        self.model = pinocchio.Model()
        parent = 0
        lower, upper = [], []
        for joint in problem["joints"]:
            model = pinocchio.JointModelRevoluteUnaligned(*joint["axis"])
            parent = self.model.addJoint(parent, model, placement(joint["parent_from_joint"]), joint["name"])
            limits = joint["limits_rad"] or [-np.pi, np.pi]
            lower.append(limits[0])
            upper.append(limits[1])
        self.lower, self.upper = np.array(lower), np.array(upper)
        self.data = self.model.createData()
        self.shapes = pinocchio.GeometryModel()
        moving, standing = [], []
        for body, entry in enumerate(problem["bodies"]):
            for k, shape in enumerate(entry["shapes"]):
                name = f"{entry['name']} {k}"
                moving.append((body, self.add(name, body, shape["shape"], placement(shape["place"]))))
        for k, shape in enumerate(problem["standing"]):
            standing.append(self.add(f"standing {k}", 0, shape["shape"], placement(shape["place"])))
        if problem["seafloor_z_m"] is not None:
            base_from_world = placement(problem["base_from_world"])
            at = base_from_world * pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, problem["seafloor_z_m"]]))
            floor = pinocchio.GeometryObject("seafloor", 0, at, coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0))
            standing.append(self.shapes.addGeometryObject(floor))
        margins = []
        for body, outer in moving:
            if body == 0:
                continue
            for other in standing:
                self.shapes.addCollisionPair(pinocchio.CollisionPair(outer, other))
                margins.append(problem["margin_m"])
            for inner_body, inner in moving:
                if inner_body + 2 <= body:
                    self.shapes.addCollisionPair(pinocchio.CollisionPair(outer, inner))
                    margins.append(problem["self_margin_m"])
        self.found = pinocchio.GeometryData(self.shapes)
        for request, margin in zip(self.found.collisionRequests, margins):
            request.security_margin = margin
        self.broad = pinocchio.BroadPhaseManager_DynamicAABBTreeCollisionManager(self.model, self.shapes, self.found)
        self.n_checks = 0

    def add(self, name, joint, shape, place):
        return self.shapes.addGeometryObject(pinocchio.GeometryObject(name, joint, place, geometry(shape)))

    def is_free(self, angles):
        self.n_checks += 1
        return not pinocchio.computeCollisions(self.model, self.data, self.broad, angles, True)

    def space(self, resolution):
        n = len(self.lower)
        space = ob.RealVectorStateSpace(n)
        bounds = ob.RealVectorBounds(n)
        for j in range(n):
            bounds.setLow(j, float(self.lower[j]))
            bounds.setHigh(j, float(self.upper[j]))
        space.setBounds(bounds)
        setup = og.SimpleSetup(space)
        angles = np.zeros(n)

        def valid(state):
            for j in range(n):
                angles[j] = state[j]
            return self.is_free(angles)

        setup.setStateValidityChecker(valid)
        information = setup.getSpaceInformation()
        information.setStateValidityCheckingResolution(resolution)
        information.setup()
        return space, setup, information

    def state(self, space, angles):
        state = space.allocState()
        for j, angle in enumerate(angles):
            state[j] = angle
        return state


def compare_edges(file):
    raw = json.load(open(file))
    problem = Problem(raw)
    edges = raw["queries"]
    blocked = [not edge["scanned_free"] for edge in edges]
    ours_us = np.mean([edge["certify_us"] for edge in edges])
    print(f"{file}: {len(edges)} edges, {sum(blocked)} blocked; ours: {ours_us:.0f} us an edge, none missed by the scan's account")
    # The two geometries agree at the ends.
    for resolution in RESOLUTIONS:
        space, _, information = problem.space(resolution)
        states = [(problem.state(space, e["from_rad"]), problem.state(space, e["to_rad"])) for e in edges]
        problem.n_checks = 0
        start = time.process_time()
        # DiscreteMotionValidator takes the first end for granted, a planner has checked it.
        free = [information.isValid(a) and information.checkMotion(a, b) for a, b in states]
        seconds = time.process_time() - start
        missed = sum(f and b for f, b in zip(free, blocked))
        false_alarms = sum(not f and not b for f, b in zip(free, blocked))
        extent = space.getMaximumExtent()
        print(
            f"  every {resolution * extent:.5f} rad ({100 * resolution:g} % of the extent): {missed} missed, {false_alarms} blocked"
            f" though free, {1e6 * seconds / len(edges):.0f} us an edge, {problem.n_checks / len(edges):.1f} states an edge"
        )
        if missed == 0:
            return resolution
    return RESOLUTIONS[-1]


def compare_paths(file, resolution):
    raw = json.load(open(file))
    problem = Problem(raw)
    times, solved, lengths = [], 0, []
    queries = raw["queries"]
    for query in queries:
        space, setup, _ = problem.space(resolution)
        setup.setStartAndGoalStates(problem.state(space, query["from_rad"]), problem.state(space, query["to_rad"]))
        setup.setPlanner(og.RRTConnect(setup.getSpaceInformation()))
        start = time.process_time()
        setup.solve(LIMIT_S)
        found = setup.haveExactSolutionPath()
        if found:
            setup.simplifySolution(1.0)
        times.append(1e3 * (time.process_time() - start))
        if found:
            solved += 1
            states = setup.getSolutionPath().getStates()
            angles = np.array([[state[j] for j in range(len(problem.lower))] for state in states])
            lengths.append(np.abs(np.diff(angles, axis=0)).max(axis=1).sum())
    ours = [query["plan_ms"] for query in queries]
    our_lengths = [query["length_rad"] for query in queries if query["found"]]
    row = "  {:<6} {:>4} of {}  median {:8.2f} ms  99 % {:8.1f} ms  max {:8.1f} ms  median length {:.2f} rad"
    n = len(queries)
    print(f"{file} at {100 * resolution:g} % of the extent")
    quantiles = lambda values: (np.median(values), np.quantile(values, 0.99), max(values))
    print(row.format("ours", sum(q["found"] for q in queries), n, *quantiles(ours), np.median(our_lengths)))
    print(row.format("OMPL", solved, n, *quantiles(times), np.median(lengths)))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edges", required=True, help="edges-ARM.json of `armcal-lab edges`")
    parser.add_argument("--paths", nargs="*", default=[], help="paths-SITE.json of `armcal-lab paths`")
    parser.add_argument("--resolution", type=float, help="share of the extent, instead of the coarsest that misses no edge")
    args = parser.parse_args()
    ou.setLogLevel(ou.LogLevel.LOG_ERROR)
    ou.RNG.setSeed(1)
    safe = compare_edges(args.edges)
    for file in args.paths:
        compare_paths(file, args.resolution or safe)


if __name__ == "__main__":
    main()
