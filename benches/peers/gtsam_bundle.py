"""The bundle as one writes it with GTSAM: corners, gains, offsets, mount and tags under the datasheet's sigmas, analytic derivatives.

Two graphs. "corners": each corner is off by its pixels alone. "and joints": each joint of a view is off by its datasheet's linearity, too,
five more unknowns a view. Neither has nonlinearity, temperature, backlash or drift, nor are sizes fitted: that is what armcal adds.
"""

import time
import tomllib

import gtsam
import numpy as np
from recordings import forward, reprojection_px, rms_px, skew, tool_errors_mm

N_FOLDS = 5
SENSORS, MOUNT = gtsam.symbol("s", 0), gtsam.symbol("m", 0)


def tag_key(tag):
    return gtsam.symbol("t", tag)


def joint_key(view):
    return gtsam.symbol("e", view)


class Bundle:
    def __init__(self, drawing, views, joints_err):
        self.drawing, self.views, self.joints_err = drawing, views, joints_err
        self.n = len(drawing.joints)
        self.graph, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        self.add_priors()
        for k, view in enumerate(views):
            for tag in view.corners:
                self.add_observation(k, tag)

    def add_priors(self):
        drawing, sensors = self.drawing, self.drawing.sensors
        stds = np.array([s["gain_std"] for s in sensors] + [s["offset_std_rad"] for s in sensors])
        sigmas = gtsam.noiseModel.Diagonal.Sigmas
        self.values.insert(SENSORS, np.zeros(2 * self.n))
        self.graph.add(gtsam.PriorFactorVector(SENSORS, np.zeros(2 * self.n), sigmas(stds)))
        camera = drawing.camera
        self.values.insert(MOUNT, gtsam.Pose3())
        self.graph.add(gtsam.PriorFactorPose3(MOUNT, gtsam.Pose3(), sigmas(np.repeat([camera["mount_std_rad"], camera["mount_std_m"]], 3))))
        for tag in sorted({tag for view in self.views for tag in view.corners}):
            spec, place = drawing.tags[tag], gtsam.Pose3(drawing.base_from_tag(tag))
            self.values.insert(tag_key(tag), place)
            self.graph.add(gtsam.PriorFactorPose3(tag_key(tag), place, sigmas(np.repeat([spec["rotation_std_rad"], spec["position_std_m"]], 3))))
        if self.joints_err:
            linearity = np.array([s["linearity_std_rad"] for s in sensors])
            for k in range(len(self.views)):
                self.values.insert(joint_key(k), np.zeros(self.n))
                self.graph.add(gtsam.PriorFactorVector(joint_key(k), np.zeros(self.n), sigmas(linearity)))

    def angles(self, travel, sensors, errors):
        return self.drawing.center + (1 + sensors[:self.n]) * travel + sensors[self.n:] + errors

    def add_observation(self, k, tag):
        view = self.views[k]
        keys = [SENSORS, MOUNT, tag_key(tag)] + ([joint_key(k)] if self.joints_err else [])
        std = self.drawing.camera["corner_std_px"] / np.sqrt(view.frames[tag])
        noise = gtsam.noiseModel.Isotropic.Sigma(8, std)

        def error(this, values, jacobians):
            errors = values.atVector(joint_key(k)) if self.joints_err else np.zeros(self.n)
            angles = self.angles(view.travel, values.atVector(SENSORS), errors)
            return self.residuals(view, tag, angles, values.atPose3(MOUNT).matrix(), values.atPose3(tag_key(tag)).matrix(), jacobians)

        self.graph.add(gtsam.CustomFactor(noise, keys, error))

    def residuals(self, view, tag, angles, mount, place, jacobians):
        links = forward(self.drawing.camera_chain, angles)
        camera = links[-1] @ mount
        rotation, corners = camera[:3, :3], self.drawing.corners(tag)
        points = (corners @ place[:3, :3].T + place[:3, 3] - camera[:3, 3]) @ rotation
        pixels, slopes = self.drawing.project(points)
        if jacobians is not None:
            by_camera = [np.hstack([skew(p), -np.eye(3)]) for p in points]
            twists = self.twists(links, camera)
            turn = rotation.T @ place[:3, :3]
            by_joint = np.vstack([s @ c @ twists for s, c in zip(slopes, by_camera)])
            jacobians[0] = np.hstack([by_joint * view.travel, by_joint])
            jacobians[1] = np.vstack([s @ c for s, c in zip(slopes, by_camera)])
            jacobians[2] = np.vstack([s @ turn @ np.hstack([-skew(c), np.eye(3)]) for s, c in zip(slopes, corners)])
            if self.joints_err:
                jacobians[3] = by_joint
        return (pixels - view.corners[tag]).ravel()

    def twists(self, links, camera):
        """Of the camera in its own frame, rotation first, for a radian of each joint."""
        axes = [axis / np.linalg.norm(axis) for _, name, axis in self.drawing.camera_chain if name]
        out = []
        for link, axis in zip(links, axes):
            about = link[:3, :3] @ axis
            out.append(np.concatenate([camera[:3, :3].T @ about, camera[:3, :3].T @ np.cross(about, camera[:3, 3] - link[:3, 3])]))
        return np.array(out).T

    def solve(self):
        params = gtsam.LevenbergMarquardtParams()
        params.setMaxIterations(100)
        optimizer = gtsam.LevenbergMarquardtOptimizer(self.graph, self.values, params)
        self.values = optimizer.optimize()
        self.sensors, self.mount = self.values.atVector(SENSORS), self.values.atPose3(MOUNT).matrix()
        seen = {tag for view in self.views for tag in view.corners}
        self.places = {tag: self.values.atPose3(tag_key(tag)).matrix() for tag in seen}
        return self

    def link(self, travel):
        return forward(self.drawing.camera_chain, self.angles(travel, self.sensors, 0.0))[-1]

    def tool(self, travel):
        return (self.link(travel) @ np.append(self.drawing.camera_from_tool, 1.0))[:3]

    def held_out_px(self, view):
        return reprojection_px(self.drawing, view, self.link(view.travel) @ self.mount, self.places)


class Comparison:
    """Figures of both graphs; and how far their gains are from armcal's."""

    WAYS = [("GTSAM, corners", False), ("GTSAM, corners and joints", True)]

    def __init__(self):
        self.gains = {name: [] for name, _ in self.WAYS}
        self.sheet = []

    def measure(self, drawing, views, rests, recording):
        joints = {j["name"]: j for j in tomllib.loads((recording / "calibration.toml").read_text())["joint"]}
        per_count = [np.degrees(s["scale_counts_per_deg"]) for s in drawing.sensors]
        gains = np.array([joints[name]["gain_rad_per_count"] * per for name, per in zip(drawing.joints, per_count)]) - 1
        stds = np.array([joints[name]["gain_std_rad_per_count"] * per for name, per in zip(drawing.joints, per_count)])
        self.sheet.append(gains)
        for name, joints_err in self.WAYS:
            began = time.process_time()
            bundle = Bundle(drawing, views, joints_err).solve()
            seconds = time.process_time() - began
            self.gains[name].append((bundle.sensors[:len(gains)], gains, stds))
            pixels = []
            for fold in range(N_FOLDS):
                held = Bundle(drawing, [v for k, v in enumerate(views) if k % N_FOLDS != fold], joints_err).solve()
                pixels += [held.held_out_px(v) for k, v in enumerate(views) if k % N_FOLDS == fold]
            parameters = bundle.values.dim()
            yield name, (tool_errors_mm(rests, bundle.tool), rms_px(pixels), seconds, parameters)

    def write(self):
        print("\nGains of the five joints before the camera (a tenth of a percent; armcal's own sigma):\n")
        print("| fit | size, rms, 0.1 % | from armcal's, median | largest | in armcal's sigma, median | largest |\n|---|--:|--:|--:|--:|--:|")
        print(f"| armcal | {1e3 * np.sqrt((np.array(self.sheet) ** 2).mean()):.2f} | | | | |")
        for name, rows in self.gains.items():
            theirs, ours, stds = (np.array(column) for column in zip(*rows))
            off, sigmas = 1e3 * abs(theirs - ours), abs(theirs - ours) / stds
            size = 1e3 * np.sqrt((theirs ** 2).mean())
            print(f"| {name} | {size:.2f} | {np.median(off):.2f} | {off.max():.2f} | {np.median(sigmas):.2f} | {sigmas.max():.2f} |", flush=True)
