"""Bodies in water: closed forms beside numeric integration -> tests/golden/water.json.

A body of mass m and volume V in water of density rho, drag -c |v| v with c = 1/2 rho Cd A against the water, added mass ma (sphere: rho V/2),
buoyancy rho V g at the centre of buoyancy. Where there is a closed form the numeric solution (DOP853) must agree with it.
The last section repeats cases of gz-sim's integration tests; their expected figures and tolerances stand beside ours.
"""

import json
from pathlib import Path

import numpy as np
import scipy
from scipy.integrate import solve_ivp
from scipy.special import ellipk

ROOT = Path(__file__).resolve().parents[2]
G = 9.80665
RHO = 1025.0
RTOL, ATOL = 1e-12, 1e-14


def integrate(f, state, times):
    solution = solve_ivp(f, (0.0, times[-1]), state, method="DOP853", t_eval=times, rtol=RTOL, atol=ATOL)
    assert solution.success
    return solution.y.T


def agree(numeric, closed, tolerance=1e-10):
    worst = float(np.abs(np.asarray(numeric) - closed).max())
    assert worst < tolerance, worst
    return worst


def sphere(radius_m, mass_kg):
    volume = 4.0 / 3.0 * np.pi * radius_m**3
    area = np.pi * radius_m**2
    cd = 0.5
    return {
        "radius_m": radius_m,
        "mass_kg": mass_kg,
        "volume_m3": volume,
        "displaced_kg": RHO * volume,
        "added_mass_kg": 0.5 * RHO * volume,
        "drag_coefficient": cd,
        "drag_area_m2": area,
        "drag_n_s2_m2": 0.5 * RHO * cd * area,
    }


def sinking():
    """(m + ma) v' = (m - rho V) g - c v2, down; v = vt tanh(t/T), z = vt T ln cosh(t/T), T = (m + ma)/(c vt)."""
    body, times = sphere(0.1, 12.0), np.linspace(0.0, 5.0, 11)
    m, ma, c = body["mass_kg"], body["added_mass_kg"], body["drag_n_s2_m2"]
    weight = (m - body["displaced_kg"]) * G
    terminal = np.sqrt(weight / c)
    scale = (m + ma) / (c * terminal)
    v, z = terminal * np.tanh(times / scale), terminal * scale * np.log(np.cosh(times / scale))
    numeric = integrate(lambda t, s: [s[1], (weight - c * abs(s[1]) * s[1]) / (m + ma)], [0.0, 0.0], times)
    return {
        "about": sinking.__doc__ + " From rest; depth_m and speed_m_s downwards.",
        **body,
        "terminal_speed_m_s": terminal,
        "time_constant_s": scale,
        "largest_difference_of_numeric": agree(numeric, np.stack([z, v], 1)),
        "columns": ["time_s", "depth_m", "speed_m_s"],
        "samples": np.stack([times, z, v], 1),
    }


def coasting():
    """Neutrally buoyant, thrown: v = v0/(1 + k v0 t), x = ln(1 + k v0 t)/k, k = c/(m + ma)."""
    radius = 0.15
    body = sphere(radius, RHO * 4.0 / 3.0 * np.pi * radius**3)
    times, v0 = np.linspace(0.0, 3.0, 7), 1.5
    k = body["drag_n_s2_m2"] / (body["mass_kg"] + body["added_mass_kg"])
    v, x = v0 / (1.0 + k * v0 * times), np.log(1.0 + k * v0 * times) / k
    numeric = integrate(lambda t, s: [s[1], -k * abs(s[1]) * s[1]], [0.0, v0], times)
    return {
        "about": coasting.__doc__,
        **body,
        "initial_speed_m_s": v0,
        "largest_difference_of_numeric": agree(numeric, np.stack([x, v], 1)),
        "columns": ["time_s", "distance_m", "speed_m_s"],
        "samples": np.stack([times, x, v], 1),
    }


def pushed():
    """No drag, no gravity, force F from rest: v = F t/(m + ma): the added mass counts in full."""
    body, times, force = sphere(0.2, 20.0), np.linspace(0.0, 2.0, 5), 30.0
    a = force / (body["mass_kg"] + body["added_mass_kg"])
    return {
        "about": pushed.__doc__,
        **body,
        "force_n": force,
        "acceleration_m_s2": a,
        "columns": ["time_s", "distance_m", "speed_m_s"],
        "samples": np.stack([times, 0.5 * a * times**2, a * times], 1),
    }


def oscillating_flow():
    """Water moves as u = U sin(w t) everywhere. (m + ma) v' = (rho V + ma) u' - c |v - u|(v - u); no gravity.
    With c = 0 and v(0) = 0: v = (rho V + ma)/(m + ma) u. Froude-Krylov force rho V u', added mass on u' - v'."""
    body, times = sphere(0.15, 25.0), np.linspace(0.0, 10.0, 21)
    amplitude, rate = 0.6, 2.0 * np.pi / 8.0
    m, ma, c, displaced = body["mass_kg"], body["added_mass_kg"], body["drag_n_s2_m2"], body["displaced_kg"]
    share = (displaced + ma) / (m + ma)

    def f(drag):
        def rates(t, s):
            u, du = amplitude * np.sin(rate * t), amplitude * rate * np.cos(rate * t)
            return [s[1], share * du - drag / (m + ma) * abs(s[1] - u) * (s[1] - u)]

        return rates

    free = integrate(f(0.0), [0.0, 0.0], times)
    v, x = share * amplitude * np.sin(rate * times), share * amplitude / rate * (1.0 - np.cos(rate * times))
    worst = agree(free, np.stack([x, v], 1))
    dragged = integrate(f(c), [0.0, 0.0], times)
    return {
        "about": oscillating_flow.__doc__,
        **body,
        "flow_amplitude_m_s": amplitude,
        "flow_rate_rad_s": rate,
        "share_of_the_flow_without_drag": share,
        "largest_difference_of_numeric": worst,
        "columns": ["time_s", "x_without_drag_m", "v_without_drag_m_s", "x_with_drag_m", "v_with_drag_m_s"],
        "samples": np.column_stack([times, x, v, dragged]),
    }


def hanging():
    """A neutrally buoyant body, its centre of buoyancy h above its centre of mass, both free: it stays where it is and rolls as a
    pendulum, (I + Ia) phi'' = -m g h sin phi. Small swings: T = 2 pi sqrt((I + Ia)/(m g h)); T4K is the period at this amplitude."""
    m, h, inertia, start = 1000.0, 0.08, 120.0, 0.3
    times = np.linspace(0.0, 4.0, 9)
    numeric = integrate(lambda t, s: [s[1], -m * G * h / inertia * np.sin(s[0])], [start, 0.0], times)
    small = 2.0 * np.pi * np.sqrt(inertia / (m * G * h))
    period = small * 2.0 / np.pi * ellipk(np.sin(start / 2.0) ** 2)
    back = integrate(lambda t, s: [s[1], -m * G * h / inertia * np.sin(s[0])], [start, 0.0], np.array([0.0, period]))[-1]
    return {
        "about": hanging.__doc__,
        "mass_kg": m,
        "center_of_buoyancy_above_com_m": h,
        "roll_inertia_with_added_kg_m2": inertia,
        "initial_roll_rad": start,
        "small_period_s": small,
        "period_s": period,
        "largest_difference_of_numeric": agree(back[0], start),
        "columns": ["time_s", "roll_rad", "roll_rate_rad_s"],
        "samples": np.column_stack([times, numeric]),
    }


# ----------------------------------------------------------------------------------------------------------------- gz

# gz-sim, test/integration/added_mass.cc: position, angle, axis, velocities at 1 s, in world axes.
GZ_ELLIPSOIDS = {
    "body1": (
        [0.1615036362557803, 0.10710173528687592, -0.0024940422102210013],
        0.31351100787675423,
        [0.9487133476959254, 0.2967465880246766, -0.10901580802481375],
        [0.32087488227940963, 0.212772641112832, -0.010283659814296216],
        [0.0031500380024329826, 0.0022451901112414984, -0.052564274312245286],
    ),
    "body2": (
        [0.19339397146633158, 0.18238590690754014, -0.0006146904921505786],
        0.3185857744101227,
        [0.9309057658841812, 0.3615623345327693, -0.051837566405069514],
        [0.386607475883442, 0.36477533916100213, -0.002544369239292084],
        [0.0005006537195657914, 0.0007044864197475587, -0.012889587224151892],
    ),
    "body3": (
        [0.0616809222579082, 0.020951194425796703, -0.0006836779301496875],
        0.2990323477528498,
        [0.992866493007573, 0.11317163977508175, -0.03752741682373132],
        [0.12296544056644206, 0.04157265120194949, -0.002832810385198371],
        [0.0017159692398096078, 0.00022402938638815302, -0.014274584996716126],
    ),
}
GZ_TOLERANCES = {"position_m": 1e-3, "angle_rad": 1e-5, "axis": 1e-4, "velocity_m_s": 2e-5, "angular_velocity_rad_s": 1e-4}


def ellipsoids():
    """A spheroid (a = 1 m, b = c = 0.5 m, 1025 kg/m3) in fluid of 1025, 102.5 and 10250 kg/m3, no gravity or drag, from rest at the origin, pushed
    by force (2000, 2000, 0) sin(3 pi t) N and torque (200, 200, 0) sin(2 pi t) N m in world axes about its centre; at t = 1 s.
    Kirchhoff: d/dt of linear and angular momentum of body and fluid in body axes. a, b: DOP853; gz: its expected figures."""
    mass = 1025.0 * 4.0 / 3.0 * np.pi * 0.25
    inertia = mass / 5.0 * np.array([0.5, 1.25, 1.25])
    cases = []
    for name, density in (("body1", 1025.0), ("body2", 102.5), ("body3", 10250.0)):
        ball = 4.0 / 3.0 * np.pi * density * 0.25
        added = np.array([0.22, 0.84, 0.84]) * ball
        added_turning = np.array([0.0, 1.0, 1.0]) * 0.24 * 4.0 / 15.0 * np.pi * density * 0.25 * 1.25
        linear, angular = mass + added, inertia + added_turning

        def rates(t, s):
            position, q, v, w = s[:3], s[3:7], s[7:10], s[10:]
            r = matrix(q / np.linalg.norm(q))
            force = r.T @ (np.array([2000.0, 2000.0, 0.0]) * np.sin(3.0 * np.pi * t))
            torque = r.T @ (np.array([200.0, 200.0, 0.0]) * np.sin(2.0 * np.pi * t))
            dv = (force - np.cross(w, linear * v)) / linear
            dw = (torque - np.cross(w, angular * w) - np.cross(v, linear * v)) / angular
            dq = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
            return np.concatenate([r @ v, dq, dv, dw])

        end = integrate(rates, np.array([0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0], float), np.array([0.0, 1.0]))[-1]
        q = end[3:7] / np.linalg.norm(end[3:7])
        sine = np.linalg.norm(q[1:])
        r = matrix(q)
        ours = [end[:3], 2.0 * np.arctan2(sine, q[0]), q[1:] / sine, r @ end[7:10], r @ end[10:]]
        gz = GZ_ELLIPSOIDS[name]
        differences = [float(np.linalg.norm(np.asarray(a) - b)) for a, b in zip(ours, gz)]
        cases.append(
            {
                "name": name,
                "mass_kg": mass,
                "inertia_kg_m2": inertia,
                "added_mass_kg": added,
                "added_inertia_kg_m2": added_turning,
                **dict(zip(GZ_TOLERANCES, ours)),
                "gz": dict(zip(GZ_TOLERANCES, gz)),
                "difference_of_gz": dict(zip(GZ_TOLERANCES, differences)),
            }
        )
    return {"about": ellipsoids.__doc__, "gz_tolerances": GZ_TOLERANCES, "cases": cases}


def matrix(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rising_and_sinking():
    """gz-sim's buoyancy.cc, UniformWorldMovement, after 1 s in 1000 kg/m3 with gravity 9.8 m/s2, no drag, no added mass, from rest:
    z = g (rho V/m - 1) t2/2; gz's own steps of 1 ms add (1 + 1 ms)/t."""
    blades = 4 * 0.5 * 0.05455
    hull = np.pi * 0.3**2 * 2.6
    bodies = (
        ("submarine", 251.32741228718348 + 21.82, np.pi * 0.04 * 2.0 + blades * 0.2, 0.0),
        ("submarine_sinking", 1102.6990214100174 + 25.2312297, hull + blades * 0.154178, -1.64),
        ("submarine_buoyant", 367.5663404700058 + 8.4104099, hull + blades * 0.154178, 4.90),
    )
    cases = []
    for name, mass, volume, gz in bodies:
        z = 0.5 * 9.8 * (1000.0 * volume / mass - 1.0)
        assert abs(z * 1.001 - gz) < 0.01, (name, z, gz)
        cases.append({"name": name, "mass_kg": mass, "volume_m3": volume, "z_at_1_s_m": z, "gz_z_m": gz, "gz_tolerance_m": 0.01})
    return {"about": rising_and_sinking.__doc__, "gravity_m_s2": 9.8, "density_kg_m3": 1000.0, "cases": cases}


def plain(value):
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return float(value) if isinstance(value, np.floating) else value


def main():
    golden = {
        "what": "Bodies in water: closed forms, and DOP853 where there is none. Units m, kg, s, rad, N; quaternions Hamilton.",
        "tools": {"scipy": scipy.__version__, "numpy": np.__version__},
        "gravity_m_s2": G,
        "density_kg_m3": RHO,
    }
    for section in (sinking, coasting, pushed, oscillating_flow, hanging, ellipsoids, rising_and_sinking):
        golden[section.__name__] = {"about": ""} | section()
        golden[section.__name__]["about"] = " ".join(section.__doc__.split())
    out = ROOT / "tests" / "golden" / "water.json"
    golden = plain(golden)
    out.write_text("{\n" + ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in golden.items()) + "\n}\n")
    print(f"{out.relative_to(ROOT)}: {out.stat().st_size // 1000} kB")
    for key, section in golden.items():
        if isinstance(section, dict) and "largest_difference_of_numeric" in section:
            print(f"  {key}: closed form and numeric differ by {section['largest_difference_of_numeric']:.1e}")
    for case in golden["ellipsoids"]["cases"]:
        print(f"  {case['name']}: gz differs by", {k: f"{v:.1e}" for k, v in case["difference_of_gz"].items()})
    for case in golden["rising_and_sinking"]["cases"]:
        print(f"  {case['name']}: {case['z_at_1_s_m']:.4f} m, gz {case['gz_z_m']}")


if __name__ == "__main__":
    main()
