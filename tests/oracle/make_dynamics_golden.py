"""Dynamics of the arms by Pinocchio, beside MuJoCo -> tests/golden/dynamics*.json.

Pinocchio's figures go into the files. The same states are put to MuJoCo, which shares no code with it; its joint accelerations
stand beside Pinocchio's for the fixed base, and the largest differences of both are written into the files.
Added mass and prescribed bases are built here on Pinocchio's Jacobians, and each is checked against another derivation.
"""

import json
import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import scipy
from scipy.integrate import solve_ivp

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = {"titan4": "dynamics.json", "kraft-predator": "dynamics-kraft-predator.json"}
SEED = 20240119
GRAVITY_M_S2 = 9.80665
DAMPING_N_M_S_RAD = 20.0
RTOL, ATOL = 1e-12, 1e-14
# Of the vehicle, added to base_link where a section says so; base axes.
HEAVY = {"mass_kg": 4000.0, "inertia_about_com_kg_m2": [2000.0, 3500.0, 4000.0], "com_m": [0.1, -0.05, 0.2]}
LIGHT = {"mass_kg": 400.0, "inertia_about_com_kg_m2": [60.0, 90.0, 110.0], "com_m": [-0.6, 0.2, 0.1]}

ABOUT = [
    "Units m, kg, s, rad, N. World z up, gravity 9.80665 m/s2 along -z unless a section says 0. q, qd, qdd, tau: one figure per joint, "
    "in the order of joint_names; tau is what the drive gives the joint. Links as in the URDF, without friction, limits or contacts.",
    "Base: the frame of base_link, its mass included wherever the base moves. base_position_m, base_quaternion_wxyz: world_from_base "
    "(Hamilton; base axes to world axes). Vectors never share a list: linear and angular parts have keys of their own, and every "
    "base_* velocity, acceleration, force and torque is in BASE (body) AXES, of or about the base frame's origin.",
    "base_linear_velocity: d position/dt, turned into base axes. base_linear_acceleration_classical: d2 position/dt2, turned into base "
    "axes (what an accelerometer at the origin feels, plus gravity). base_linear_acceleration_spatial: the derivative of the COMPONENTS "
    "of base_linear_velocity in base axes = classical - angular_velocity x linear_velocity. base_angular_acceleration: both at once.",
    "6 x 6 matrices: rows and columns linear x y z, then angular x y z.",
]


class Arm:
    """A URDF in Pinocchio, on a fixed base or (with a vehicle's inertia or none) on a flying one."""

    def __init__(self, name, flying=False, vehicle=None, gravity=GRAVITY_M_S2):
        folder = ROOT / "robots" / name
        robot = tomllib.loads((folder / "robot.toml").read_text())
        self.urdf = folder / robot["urdf"]
        self.joints = [s["joint"] for s in robot["joint_sensor"]]
        self.vehicle, self.flying = vehicle, flying
        self.model = pin.buildModelFromUrdf(str(self.urdf), pin.JointModelFreeFlyer()) if flying else pin.buildModelFromUrdf(str(self.urdf))
        first = 2 if flying else 1
        assert self.joints == [self.model.names[i] for i in range(first, self.model.njoints)]
        if vehicle:
            self.model.inertias[1] += pin.Inertia(
                vehicle["mass_kg"], np.array(vehicle["com_m"]), np.diag(vehicle["inertia_about_com_kg_m2"])
            )
        self.model.gravity.linear = np.array([0.0, 0.0, -gravity])
        self.data = self.model.createData()
        self.of_joint = [self.model.joints[i] for i in range(first, self.model.njoints)]
        self.ids = list(range(first, self.model.njoints))
        self.lower = np.array([-np.pi if j.nq == 2 else self.model.lowerPositionLimit[j.idx_q] for j in self.of_joint])
        self.upper = np.array([np.pi if j.nq == 2 else self.model.upperPositionLimit[j.idx_q] for j in self.of_joint])
        self.effort = np.array([self.model.effortLimit[j.idx_v] for j in self.of_joint])

    def q(self, theta, position=None, wxyz=None):
        """Pinocchio's configuration vector."""
        parts = [[np.cos(t), np.sin(t)] if j.nq == 2 else [t] for t, j in zip(theta, self.of_joint)]
        base = [position, [wxyz[1], wxyz[2], wxyz[3], wxyz[0]]] if self.flying else []
        return np.concatenate(base + parts)

    def mass_matrix(self, q):
        upper = np.triu(pin.crba(self.model, self.data, q))
        return upper + np.triu(upper, 1).T


class Engine:
    """The same arm in MuJoCo, without shapes, limits, damping or constraints."""

    def __init__(self, arm):
        tree = ElementTree.parse(arm.urdf)
        root = tree.getroot()
        for link in root.findall("link"):
            if link.get("name") == "fisheye":
                root.remove(link)
            for shape in link.findall("visual") + link.findall("collision"):
                link.remove(shape)
        for joint in root.findall("joint"):
            if joint.find("child").get("link") == "fisheye":
                root.remove(joint)
        extension = ElementTree.SubElement(root, "mujoco")
        ElementTree.SubElement(extension, "compiler", fusestatic="false", inertiafromgeom="false", balanceinertia="false", boundmass="0")
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
        if arm.flying:
            base = spec.body("base_link")
            base.add_freejoint()
            body = arm.model.inertias[1]
            base.mass, base.ipos = body.mass, body.lever
            i = body.inertia
            base.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
            base.inertia = [0, 0, 0]
        self.model = spec.compile()
        self.flying = arm.flying
        self.model.opt.gravity[:] = [0.0, 0.0, arm.model.gravity.linear[2]]
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.model.dof_damping[:] = 0.0
        self.model.dof_armature[:] = 0.0
        self.data = mujoco.MjData(self.model)

    def accelerations(self, qpos, qvel, tau):
        self.data.qpos[:], self.data.qvel[:], self.data.qfrc_applied[:] = qpos, qvel, tau
        mujoco.mj_forward(self.model, self.data)
        return self.data.qacc.copy()


def largest(a, b):
    """Relative to the norm of b."""
    return float(np.linalg.norm(np.asarray(a) - b) / np.linalg.norm(b))


def random_rotation(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def rotation(wxyz):
    return pin.Quaternion(*wxyz).toRotationMatrix()


# ---------------------------------------------------------------------------------------------------- fixed base


def gravity_torques(name, rng):
    arm = Arm(name)
    cases = []
    for _ in range(20):
        theta = rng.uniform(arm.lower, arm.upper)
        tau = pin.computeGeneralizedGravity(arm.model, arm.data, arm.q(theta))
        cases.append({"q": theta, "gravity_torque": tau.copy()})
    return {"about": "Pinocchio computeGeneralizedGravity: the drive's torques that hold the arm at rest, base at the world's origin.", "cases": cases}


def accelerations(name, rng):
    arm = Arm(name)
    engine, cases, worst = Engine(arm), [], 0.0
    for _ in range(100):
        theta = rng.uniform(arm.lower, arm.upper)
        rate, tau = rng.uniform(-1.0, 1.0, 6), rng.uniform(-1.0, 1.0, 6) * arm.effort / 3.0
        qdd = pin.aba(arm.model, arm.data, arm.q(theta), rate, tau).copy()
        other = engine.accelerations(theta, rate, tau)
        worst = max(worst, largest(other, qdd))
        cases.append({"q": theta, "qd": rate, "tau": tau, "qdd": qdd, "qdd_mujoco": other})
    assert worst < 1e-10, worst
    return {
        "about": "Forward dynamics on a fixed base: qdd by Pinocchio's aba, qdd_mujoco by MuJoCo's mj_forward of the same URDF.",
        "largest_relative_difference_of_mujoco": worst,
        "cases": cases,
    }


def mass_matrices(name, rng):
    arm, cases = Arm(name), []
    for _ in range(5):
        theta = rng.uniform(arm.lower, arm.upper)
        cases.append({"q": theta, "mass_matrix_rows": arm.mass_matrix(arm.q(theta))})
    return {"about": "Joint-space inertia by Pinocchio's crba, fixed base, kg m2.", "cases": cases}


# ------------------------------------------------------------------------------------------------------ moving base


def base_state(rng):
    return {
        "base_position_m": rng.uniform(-2.0, 2.0, 3),
        "base_quaternion_wxyz": random_rotation(rng),
        "base_linear_velocity": rng.uniform(-1.0, 1.0, 3),
        "base_angular_velocity": rng.uniform(-1.0, 1.0, 3),
    }


def inverse_dynamics(name, rng):
    arm, cases = Arm(name, flying=True), []
    for _ in range(50):
        state = base_state(rng)
        v, w = state["base_linear_velocity"], state["base_angular_velocity"]
        classical, alpha = rng.uniform(-2.0, 2.0, 3), rng.uniform(-2.0, 2.0, 3)
        spatial = classical - np.cross(w, v)
        theta, rate, qdd = rng.uniform(arm.lower, arm.upper), rng.uniform(-1.0, 1.0, 6), rng.uniform(-5.0, 5.0, 6)
        q = arm.q(theta, state["base_position_m"], state["base_quaternion_wxyz"])
        tau = pin.rnea(arm.model, arm.data, q, np.concatenate([v, w, rate]), np.concatenate([spatial, alpha, qdd])).copy()
        cases.append(
            state
            | {
                "base_linear_acceleration_classical": classical,
                "base_linear_acceleration_spatial": spatial,
                "base_angular_acceleration": alpha,
                "q": theta,
                "qd": rate,
                "qdd": qdd,
                "tau": tau[6:],
                "base_force": tau[:3],
                "base_torque": tau[3:6],
            }
        )
    about = (
        "Inverse dynamics by Pinocchio's rnea with a JointModelFreeFlyer at base_link, no vehicle's mass. base_force, base_torque: what must "
        "act on base_link from outside (gravity not counted) for this motion, about the base frame's origin."
    )
    return {"about": about, "cases": cases}


def flying_accelerations(name, rng):
    arm = Arm(name, flying=True, vehicle=HEAVY)
    engine, cases, worst = Engine(arm), [], 0.0
    for _ in range(50):
        state = base_state(rng)
        v, w = state["base_linear_velocity"], state["base_angular_velocity"]
        theta, rate = rng.uniform(arm.lower, arm.upper), rng.uniform(-1.0, 1.0, 6)
        tau = rng.uniform(-1.0, 1.0, 6) * arm.effort / 3.0
        position, wxyz = state["base_position_m"], state["base_quaternion_wxyz"]
        q = arm.q(theta, position, wxyz)
        qdd = pin.aba(arm.model, arm.data, q, np.concatenate([v, w, rate]), np.concatenate([np.zeros(6), tau])).copy()
        classical = qdd[:3] + np.cross(w, v)
        # MuJoCo: the base's linear part in world axes (classical), the angular in body axes.
        to_world = rotation(wxyz)
        other = engine.accelerations(
            np.concatenate([position, wxyz, theta]), np.concatenate([to_world @ v, w, rate]), np.concatenate([np.zeros(6), tau])
        )
        other[:3] = to_world.T @ other[:3]
        worst = max(worst, largest(other, np.concatenate([classical, qdd[3:]])))
        cases.append(
            state
            | {
                "q": theta,
                "qd": rate,
                "tau": tau,
                "base_linear_acceleration_classical": classical,
                "base_linear_acceleration_spatial": qdd[:3],
                "base_angular_acceleration": qdd[3:6],
                "qdd": qdd[6:],
            }
        )
    assert worst < 1e-10, worst
    return {
        "about": "Forward dynamics by Pinocchio's aba, base free with the vehicle's mass added to base_link, no force on the base but gravity.",
        "vehicle": HEAVY,
        "largest_relative_difference_of_mujoco": worst,
        "cases": cases,
    }


# ------------------------------------------------------------------------------------------------------- added mass


def motion_cross_force(v, f):
    """v x* f of a motion v and a force f, both linear before angular."""
    return np.concatenate([np.cross(v[3:], f[:3]), np.cross(v[:3], f[:3]) + np.cross(v[3:], f[3:])])


def added_terms(arm, matrices, q, v):
    """M and h of added mass in water at rest: sum of J^T A J, and of J^T (A dJ v + V x* (A V)) (Kirchhoff)."""
    pin.computeJointJacobiansTimeVariation(arm.model, arm.data, q, v)
    pin.forwardKinematics(arm.model, arm.data, q, v, np.zeros(arm.model.nv))
    m, h = np.zeros((arm.model.nv, arm.model.nv)), np.zeros(arm.model.nv)
    first = [1] if arm.flying else []
    for joint, added in zip(first + arm.ids, matrices):
        jacobian = pin.getJointJacobian(arm.model, arm.data, joint, pin.ReferenceFrame.LOCAL)
        motion, drift = arm.data.v[joint].vector, arm.data.a[joint].vector
        m += jacobian.T @ added @ jacobian
        h += jacobian.T @ (added @ drift + motion_cross_force(motion, added @ motion))
    return m, h


def random_added(rng, scale_kg):
    """A full symmetric positive matrix: no real body's, but every entry counts."""
    size = np.sqrt(scale_kg) * np.array([1.0, 1.0, 1.0, 0.3, 0.3, 0.3])
    root = rng.normal(size=(6, 6)) * size[:, None]
    return root @ root.T / 6.0


def kirchhoff_by_lagrange(arm, matrices, theta, rate):
    """h of added mass by d/dt(dT/dqd) - dT/dq with central differences of T = qd M(q) qd/2; fixed base."""
    step = 1e-5
    mass = lambda t: added_terms(arm, matrices, arm.q(t), np.zeros(6))[0]
    slopes = [(mass(theta + step * e) - mass(theta - step * e)) / (2 * step) for e in np.eye(6)]
    drift = sum(slope * r for slope, r in zip(slopes, rate)) @ rate
    return drift - 0.5 * np.array([rate @ slope @ rate for slope in slopes])


def check_added_terms(name, rng):
    """With rigid bodies' inertias for added masses, the free base must move as if they were bolted on."""
    arm, heavier = (Arm(name, flying=True, vehicle=HEAVY) for _ in range(2))
    bolted = [pin.Inertia.Random() for _ in [1] + arm.ids]
    for joint, inertia in zip([1] + arm.ids, bolted):
        heavier.model.inertias[joint] += inertia
    heavier.model.gravity.linear = np.zeros(3)
    dry = Arm(name, flying=True, vehicle=HEAVY, gravity=0.0)
    worst = 0.0
    for _ in range(10):
        q = arm.q(rng.uniform(arm.lower, arm.upper), rng.uniform(-1.0, 1.0, 3), random_rotation(rng))
        v = rng.uniform(-1.0, 1.0, arm.model.nv)
        m, h = added_terms(dry, [inertia.matrix() for inertia in bolted], q, v)
        worst = max(worst, largest(dry.mass_matrix(q) + m, heavier.mass_matrix(q)))
        bias = pin.nonLinearEffects(dry.model, dry.data, q, v) + h
        worst = max(worst, largest(bias, pin.nonLinearEffects(heavier.model, heavier.data, q, v)))
    assert worst < 1e-12, worst


def added_mass(name, rng):
    check_added_terms(name, np.random.default_rng(SEED))
    fixed, flying = Arm(name), Arm(name, flying=True, vehicle=HEAVY)
    links = [random_added(rng, scale) for scale in (8.0, 12.0, 9.0, 3.0, 4.0, 3.0)]
    vehicle = random_added(rng, 3000.0)
    cases, worst = [], 0.0
    for _ in range(20):
        state = base_state(rng)
        theta, rate = rng.uniform(fixed.lower, fixed.upper), rng.uniform(-1.0, 1.0, 6)
        tau = rng.uniform(-1.0, 1.0, 6) * fixed.effort / 3.0
        q = fixed.q(theta)
        m, h = added_terms(fixed, links, q, rate)
        worst = max(worst, largest(kirchhoff_by_lagrange(fixed, links, theta, rate), h))
        still = np.linalg.solve(fixed.mass_matrix(q) + m, tau - pin.nonLinearEffects(fixed.model, fixed.data, q, rate) - h)
        q = flying.q(theta, state["base_position_m"], state["base_quaternion_wxyz"])
        v = np.concatenate([state["base_linear_velocity"], state["base_angular_velocity"], rate])
        m, h = added_terms(flying, [vehicle] + links, q, v)
        bias = pin.nonLinearEffects(flying.model, flying.data, q, v)
        free = np.linalg.solve(flying.mass_matrix(q) + m, np.concatenate([np.zeros(6), tau]) - bias - h)
        cases.append(
            state
            | {
                "q": theta,
                "qd": rate,
                "tau": tau,
                "qdd_fixed_base": still,
                "base_linear_acceleration_classical": free[:3] + np.cross(v[3:6], v[:3]),
                "base_linear_acceleration_spatial": free[:3],
                "base_angular_acceleration": free[3:6],
                "qdd": free[6:],
            }
        )
    assert worst < 1e-7, worst
    return {
        "about": "Forward dynamics in water at rest with a 6 x 6 added mass A per link, at the LINK FRAME's origin in link axes, and one of the vehicle at "
        "the base frame. The water's force on a body of velocity V: -(A dV/dt + V x* (A V)). qdd_fixed_base: base held still at the "
        "origin (the base_* state unused); the others: base free with the vehicle's mass. No buoyancy, no drag, dry weight.",
        "largest_relative_difference_of_lagrange": worst,
        "vehicle": HEAVY,
        "vehicle_added_mass_rows": vehicle,
        "link_names": link_names(fixed),
        "link_added_mass_rows": links,
        "cases": cases,
    }


def moving_water(name, rng):
    """The world seen from the water: a frame that moves with it, in which it is at rest and gravity is g - du/dt."""
    arm = Arm(name, flying=True, vehicle=HEAVY)
    links = [random_added(rng, scale) for scale in (8.0, 12.0, 9.0, 3.0, 4.0, 3.0)]
    matrices = [random_added(rng, 3000.0)] + links
    cases = []
    for _ in range(12):
        state = base_state(rng)
        theta, rate = rng.uniform(arm.lower, arm.upper), rng.uniform(-1.0, 1.0, 6)
        tau = rng.uniform(-1.0, 1.0, 6) * arm.effort / 3.0
        water, slope = rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, 3)
        to_base = rotation(state["base_quaternion_wxyz"]).T
        arm.model.gravity.linear = np.array([0.0, 0.0, -GRAVITY_M_S2]) - slope
        q = arm.q(theta, state["base_position_m"], state["base_quaternion_wxyz"])

        def solve(base_velocity, of):
            """Of the coordinates `of`, the base's spatial acceleration against the water being -slope where it is not among them."""
            v = np.concatenate([base_velocity[:3] - to_base @ water, base_velocity[3:], rate])
            m, h = added_terms(arm, matrices, q, v)
            m, h = m + arm.mass_matrix(q), h + pin.nonLinearEffects(arm.model, arm.data, q, v)
            if of.start:
                h = h + m[:, :3] @ (-to_base @ slope)
            forces = np.concatenate([np.zeros(6), tau])
            return np.linalg.solve(m[of, of], (forces - h)[of])

        v, w = state["base_linear_velocity"], state["base_angular_velocity"]
        free = solve(np.concatenate([v, w]), slice(0, 12))
        classical = free[:3] + np.cross(w, v - to_base @ water) + to_base @ slope
        cases.append(
            state
            | {
                "water_velocity_m_s": water,
                "water_acceleration_m_s2": slope,
                "q": theta,
                "qd": rate,
                "tau": tau,
                "qdd_held_base": solve(np.zeros(6), slice(6, 12)),
                "base_linear_acceleration_classical": classical,
                "base_linear_acceleration_spatial": classical - np.cross(w, v),
                "base_angular_acceleration": free[3:6],
                "qdd": free[6:],
            }
        )
    return {
        "about": "As added_mass, but the water moves: velocity and acceleration (WORLD axes) the same everywhere, acting on the added mass only: the displaced "
        "mass is 0 and there is no drag. qdd_held_base: base at rest in the world at the given place; the others: base free.",
        "vehicle": HEAVY,
        "vehicle_added_mass_rows": matrices[0],
        "link_names": link_names(arm),
        "link_added_mass_rows": links,
        "cases": cases,
    }


def link_names(arm):
    """The body that each joint moves."""
    return [next(f.name for f in arm.model.frames if f.type == pin.FrameType.BODY and f.parentJoint == i) for i in arm.ids]


# ----------------------------------------------------------------------------------------------------- trajectories


def integrate(f, state, times, rtol=RTOL):
    solution = solve_ivp(f, (0.0, times[-1]), state, method="DOP853", t_eval=times, rtol=rtol, atol=ATOL * rtol / RTOL)
    assert solution.success
    return solution.y.T


def twice(f, state, times):
    """The samples, and by how much they differ from those of a hundred times the tolerance."""
    fine, coarse = integrate(f, state, times), integrate(f, state, times, 100.0 * RTOL)
    return fine, float(np.abs(fine - coarse).max())


def start(arm):
    """A quarter of the way up each joint's range: no limit's neighbour."""
    return (arm.lower + 0.4 * (arm.upper - arm.lower)).round(3)


def falling(name):
    arm, times = Arm(name), np.linspace(0.0, 0.5, 6)
    q0 = start(arm)

    def f(_, s):
        return np.concatenate([s[6:], pin.aba(arm.model, arm.data, arm.q(s[:6]), s[6:], -DAMPING_N_M_S_RAD * s[6:])])

    states, loose = twice(f, np.concatenate([q0, np.zeros(6)]), times)
    return {
        "about": "The arm falls from rest on a fixed base with viscous joint damping (tau = -damping qd) and no other torque; DOP853 on aba.",
        "damping_n_m_s_rad": DAMPING_N_M_S_RAD,
        "largest_difference_at_100_times_the_tolerance": loose,
        "samples": [{"time_s": t, "q": s[:6], "qd": s[6:]} for t, s in zip(times, states)],
    }


def quaternion_rate(wxyz, w):
    a, b, c, d = wxyz
    x, y, z = w
    return 0.5 * np.array([-b * x - c * y - d * z, a * x + c * z - d * y, a * y - b * z + d * x, a * z + b * y - c * x])


def momentum(arm, q, v):
    """Linear, and angular about the world's origin; world axes."""
    pin.computeCentroidalMomentum(arm.model, arm.data, q, v)
    h, com = arm.data.hg, pin.centerOfMass(arm.model, arm.data, q)
    return np.concatenate([h.linear, h.angular + np.cross(com, h.linear)])


def rocking(name):
    """Base free, no gravity, no water."""
    arm, times = Arm(name, flying=True, vehicle=LIGHT, gravity=0.0), np.linspace(0.0, 2.0, 11)
    amplitude = (0.08 * arm.effort).round(1)
    rate = np.array([3.1, 2.6, 3.7, 4.3, 4.9, 5.5])

    def split(s):
        wxyz = s[3:7] / np.linalg.norm(s[3:7])
        return s[:3], wxyz, s[7:13], s[13:19], s[19:]

    def f(t, s):
        position, wxyz, theta, base, qd = split(s)
        tau = np.concatenate([np.zeros(6), amplitude * np.sin(rate * t) - DAMPING_N_M_S_RAD * qd])
        a = pin.aba(arm.model, arm.data, arm.q(theta, position, wxyz), np.concatenate([base, qd]), tau)
        return np.concatenate([rotation(wxyz) @ base[:3], quaternion_rate(s[3:7], base[3:]), qd, a])

    q0 = start(arm)
    # A base that already drifts and turns: its momentum is not zero and must stay.
    sections = {}
    for key, base in (("from_rest", np.zeros(6)), ("drifting", np.array([0.1, -0.05, 0.02, 0.05, -0.08, 0.1]))):
        s0 = np.concatenate([[0, 0, 0, 1, 0, 0, 0], q0, base, np.zeros(6)])
        states, loose = twice(f, s0, times)
        samples, momenta, by_momentum = [], [], 0.0
        for t, s in zip(times, states):
            position, wxyz, theta, base_velocity, qd = split(s)
            q, v = arm.q(theta, position, wxyz), np.concatenate([base_velocity, qd])
            h = momentum(arm, q, v)
            momenta.append(h)
            if key == "from_rest" and t > 0:
                m = arm.mass_matrix(q)
                by_momentum = max(by_momentum, np.abs(base_velocity + np.linalg.solve(m[:6, :6], m[:6, 6:] @ qd)).max())
            samples.append(
                {
                    "time_s": t,
                    "base_position_m": position,
                    "base_quaternion_wxyz": wxyz,
                    "q": theta,
                    "base_linear_velocity": base_velocity[:3],
                    "base_angular_velocity": base_velocity[3:],
                    "qd": qd,
                    "linear_momentum_kg_m_s": h[:3],
                    "angular_momentum_kg_m2_s": h[3:],
                }
            )
        drift = float(np.abs(np.array(momenta) - momenta[0]).max())
        assert drift < 1e-8 and by_momentum < 1e-10, (drift, by_momentum)
        sections[key] = {
            "largest_momentum_change_of_the_oracle": drift,
            "largest_difference_at_100_times_the_tolerance": loose,
            "samples": samples,
        }
        if key == "from_rest":
            sections[key]["largest_base_velocity_beyond_minus_inverse_mbb_mbq_qd"] = float(by_momentum)
    return {
        "about": "Free base with a light vehicle, no gravity, dry: tau_j = amplitude_j sin(rate_j t) - damping qd_j on the joints, nothing on the base. "
        "DOP853 on aba, 0 to 2 s. Momenta of arm and vehicle in world axes, angular about the world's origin.",
        "vehicle": LIGHT,
        "damping_n_m_s_rad": DAMPING_N_M_S_RAD,
        "tau_amplitude_n_m": amplitude,
        "tau_rate_rad_s": rate,
        **sections,
    }


# ------------------------------------------------------------------------------------------------- prescribed motion

# amplitude, rate rad/s, phase of each sinusoid; x, y, z in m in the world, then roll, pitch, yaw.
SHAKE = [
    [[0.12, 2.1, 0.3], [0.05, 4.7, 1.9]],
    [[0.10, 1.7, 2.2], [0.04, 5.3, 0.4]],
    [[0.15, 2.9, 1.1], [0.03, 6.1, 2.7]],
    [[0.20, 1.9, 0.7], [0.06, 4.1, 0.2]],
    [[0.15, 2.3, 1.6], [0.05, 5.1, 2.9]],
    [[0.30, 1.3, 0.9], [0.08, 3.7, 1.4]],
]


def jets(t):
    """Value, first and second derivative of the six sums."""
    sums = np.zeros((3, 6))
    for k, axis in enumerate(SHAKE):
        for amplitude, rate, phase in axis:
            s, c = np.sin(rate * t + phase), np.cos(rate * t + phase)
            sums[:, k] += amplitude * np.array([s, rate * c, -rate * rate * s])
    return sums


def turn(roll, pitch, yaw):
    return pin.rpy.rpyToMatrix(roll, pitch, yaw)


def shaken_base(t):
    """Rotation, spatial velocity and spatial acceleration of the base, base axes."""
    p, dp, ddp = jets(t)
    r = turn(*p[3:])
    w = pin.rpy.computeRpyJacobian(p[3:], pin.ReferenceFrame.LOCAL) @ dp[3:]
    alpha = (
        pin.rpy.computeRpyJacobian(p[3:], pin.ReferenceFrame.LOCAL) @ ddp[3:]
        + pin.rpy.computeRpyJacobianTimeDerivative(p[3:], dp[3:], pin.ReferenceFrame.LOCAL) @ dp[3:]
    )
    v = r.T @ dp[:3]
    return p[:3], r, np.concatenate([v, w]), np.concatenate([r.T @ ddp[:3] - np.cross(w, v), alpha])


def check_shaken_base():
    """The closed forms against central differences."""
    worst, h = 0.0, 1e-4
    for t in (0.1, 0.43, 0.9):
        (p0, r0, v0, _), (_, r, v, a), (p1, r1, v1, _) = (shaken_base(t + d) for d in (-h, 0.0, h))
        numeric = np.concatenate([r.T @ (p1 - p0), pin.log3(r0.T @ r1)]) / (2 * h)
        worst = max(worst, np.abs(numeric - v).max(), np.abs((v1 - v0) / (2 * h) - a).max())
    assert worst < 1e-6, worst


def shaken(name):
    check_shaken_base()
    arm, times = Arm(name, flying=True), np.linspace(0.0, 1.0, 11)

    def f(t, s):
        position, r, v, a = shaken_base(t)
        wxyz = pin.Quaternion(r).coeffs()[[3, 0, 1, 2]]
        q, rate = arm.q(s[:6], position, wxyz), s[6:]
        h = pin.rnea(arm.model, arm.data, q, np.concatenate([v, rate]), np.concatenate([a, np.zeros(6)]))[6:].copy()
        m = arm.mass_matrix(q)[6:, 6:]
        return np.concatenate([rate, np.linalg.solve(m, -DAMPING_N_M_S_RAD * rate - h)])

    states, loose = twice(f, np.concatenate([start(arm), np.zeros(6)]), times)
    samples = []
    for t, s in zip(times, states):
        position, r, v, a = shaken_base(t)
        samples.append(
            {
                "time_s": t,
                "base_position_m": position,
                "base_quaternion_wxyz": pin.Quaternion(r).coeffs()[[3, 0, 1, 2]],
                "base_linear_velocity": v[:3],
                "base_angular_velocity": v[3:],
                "base_linear_acceleration_classical": a[:3] + np.cross(v[3:], v[:3]),
                "base_angular_acceleration": a[3:],
                "q": s[:6],
                "qd": s[6:],
            }
        )
    return {
        "about": "Base moved as prescribed, arm swinging with joint damping (tau = -damping qd), from rest against the base. x, y, z (world, m) and "
        "roll, pitch, yaw (R = Rz(yaw) Ry(pitch) Rx(roll), rad) are each a sum of amplitude sin(rate t + phase); base_motion has [amplitude, "
        "rate_rad_s, phase_rad] in this order of axes. DOP853 on rnea and crba with the base's accelerations.",
        "damping_n_m_s_rad": DAMPING_N_M_S_RAD,
        "base_motion": SHAKE,
        "largest_difference_at_100_times_the_tolerance": loose,
        "samples": samples,
    }


# ------------------------------------------------------------------------------------------------------------- files


def plain(value):
    """Arrays to lists of the shortest figures that read back exactly (17 digits at most)."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return float(value) if isinstance(value, np.floating) else value


def dump(value, depth=0):
    """Compact; a case or sample per line, so that differences stay readable."""
    if isinstance(value, dict) and depth < 3:
        rows = (f"{json.dumps(k)}: {dump(v, depth + 1)}" for k, v in value.items())
        return "{\n" + ",\n".join(rows) + "\n}"
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(json.dumps(v, separators=(",", ":")) for v in value) + "\n]"
    return json.dumps(value, separators=(",", ":"))


def make(name, out):
    golden = {
        "what": f"Dynamics of robots/{name}.",
        "about": ABOUT,
        "tools": {"pin": pin.__version__, "mujoco": mujoco.__version__, "scipy": scipy.__version__, "numpy": np.__version__},
        "seed": SEED,
        "gravity_m_s2": GRAVITY_M_S2,
        "joint_names": Arm(name).joints,
    }
    sections = (gravity_torques, accelerations, mass_matrices, inverse_dynamics, flying_accelerations, added_mass, moving_water)
    for k, section in enumerate(sections):
        golden[section.__name__] = section(name, np.random.default_rng([SEED, k]))
    for trajectory in (falling, rocking, shaken):
        golden[trajectory.__name__] = trajectory(name)
    golden = plain(golden)
    out.write_text(dump(golden) + "\n")
    print(f"{out.relative_to(ROOT)}: {out.stat().st_size // 1000} kB")
    for key, section in golden.items():
        for label, part in [(key, section)] + ([(f"{key}.{k}", v) for k, v in section.items()] if isinstance(section, dict) else []):
            if isinstance(part, dict):
                [print(f"  {label}: {k} {v:.1e}") for k, v in part.items() if k.startswith("largest")]


def main():
    for name, out in ROBOTS.items():
        make(name, ROOT / "tests" / "golden" / out)


if __name__ == "__main__":
    main()
