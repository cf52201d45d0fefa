// An arm whose links are not as drawn and that bends under its weight: poses and, by hand, their derivatives.
//
// Columns of the body: six a joint before the camera (shift and turn of its place in the parent link's axes, the turn
// a rotation vector), each one's compliance, the base's about three axes, a load at the tool.
#pragma once
#include "bundle.h"

constexpr int kBody = 39;

using Vector6 = Eigen::Matrix<double, 6, 1>;

// The sag's part of the columns, for `n` joints.
template <typename T>
struct Sag {
  const T *joints, *base, *load;
  Sag(const T* body, int n) : joints(body + 6 * n), base(joints + n), load(base + 3) {}
};

// exp of SO(3).
template <typename T>
std::array<T, 9> exp_so3(const T* turn) {
  const T delta[6] = {T(0.0), T(0.0), T(0.0), turn[0], turn[1], turn[2]};
  return exp_se3(delta).r;
}

// Base first; axes in the base's frame.
template <typename T>
struct Links {
  std::array<Pose<T>, kMaxJoints + 1> at;
  std::array<std::array<T, 3>, kMaxJoints> axis;
};

// Torques (N m), or angles, about joints and base.
template <typename T>
struct AboutAxes {
  std::array<T, kMaxJoints> joints;
  std::array<T, 3> base;
};

// First moment of what each joint carries about its origin, and of all about the base's.
template <typename T>
struct Moments {
  std::array<std::array<T, 3>, kMaxJoints> joints;
  std::array<T, 3> base;
};

template <typename T>
Links<T> links_at(const Bundle& b, const T* body, const std::array<T, 9>* turns, const T* angles, const std::array<T, 9>& base) {
  Links<T> out;
  out.at[0] = {base, {T(0.0), T(0.0), T(0.0)}};
  for (int j = 0; j < b.n_moving(); ++j) {
    Pose<T> step = b.joint(j).parent_from_child(angles[j]);
    if (j < b.n_links()) {
      step.r = product(turns[j], step.r);
      for (int i = 0; i < 3; ++i) step.t[i] += body[6 * j + i];
    }
    out.at[j + 1] = out.at[j] * step;
    const auto& axis = b.joint(j).axis;
    out.axis[j] = rotated(out.at[j + 1].r, {T(axis[0]), T(axis[1]), T(axis[2])});
  }
  return out;
}

template <typename T>
Moments<T> moments(const Bundle& b, const Links<T>& links, double of_links, const T& tool_n) {
  Moments<T> out;
  T weight(0.0);
  std::array<T, 3> sum{T(0.0), T(0.0), T(0.0)};
  for (int k = b.n_moving(); k >= 0; --k) {
    const auto& [r, t] = links.at[k];
    const Load& load = b.body.loads[k];
    const auto& m = load.moment_nm;
    const auto moment = rotated(r, {T(m[0]), T(m[1]), T(m[2])});
    weight += of_links * load.weight_n;
    for (int i = 0; i < 3; ++i) sum[i] += of_links * (moment[i] + t[i] * load.weight_n);
    if (k == b.body.tool_joints) {
      const auto& at = b.body.tool_m;
      const auto tool = rotated(r, {T(at[0]), T(at[1]), T(at[2])});
      weight += tool_n;
      for (int i = 0; i < 3; ++i) sum[i] += (tool[i] + t[i]) * tool_n;
    }
    if (k > 0)
      for (int i = 0; i < 3; ++i) out.joints[k - 1][i] = sum[i] - t[i] * weight;
  }
  out.base = sum;
  return out;
}

template <typename T, typename U>
auto dot(const std::array<T, 3>& a, const std::array<U, 3>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// up x v.
template <typename T>
std::array<T, 3> up_cross(const Bundle& b, const std::array<T, 3>& v) {
  const auto& u = b.body.up;
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

template <typename T>
AboutAxes<T> torques(const Bundle& b, const Links<T>& links, const Moments<T>& of) {
  AboutAxes<T> out;
  out.base = up_cross(b, of.base);
  for (int j = 0; j < b.n_moving(); ++j) out.joints[j] = dot(links.axis[j], up_cross(b, of.joints[j]));
  return out;
}

// The arm bent by the torques of the arm bent by those of the straight one.
template <typename T>
Links<T> bent_links(const Bundle& b, int view, const T* common, const T* body, const std::array<T, 9>* turns) {
  const int n = b.n_links();
  const Sag<T> sag(body, n);
  T angles[kMaxJoints], bent[kMaxJoints];
  for (int j = 0; j < n; ++j) angles[j] = b.angle(view, j, common);
  for (int j = n; j < b.n_moving(); ++j) bent[j] = angles[j] = T(b.body.beyond_rad[view][j - n]);
  const T none[3] = {T(0.0), T(0.0), T(0.0)};
  Links<T> links = links_at(b, body, turns, angles, exp_so3(none));
  for (int pass = 0; pass < 2; ++pass) {
    const auto by = torques(b, links, moments(b, links, 1.0, *sag.load));
    T base[3];
    for (int i = 0; i < 3; ++i) base[i] = sag.base[i] * by.base[i];
    for (int j = 0; j < n; ++j) bent[j] = angles[j] + sag.joints[j] * by.joints[j];
    links = links_at(b, body, turns, bent, exp_so3(base));
  }
  return links;
}

// Of the arm at one state, for all views.
struct BodyState {
  std::array<std::array<double, 9>, kMaxJoints> turns;
  // A link turned by `phi` turns by J(phi) of a change of phi: left Jacobians of SO(3).
  std::array<Eigen::Matrix3d, kMaxJoints> by_turn;

  void prepare(const Bundle& b, const double* body) {
    for (int j = 0; j < b.n_links(); ++j) {
      const double* phi = body + 6 * j + 3;
      turns[j] = exp_so3(phi);
      // J_left(phi) = J_right(-phi).
      const double back[6] = {0.0, 0.0, 0.0, -phi[0], -phi[1], -phi[2]};
      by_turn[j] = right_jacobian(back).block<3, 3>(3, 3);
    }
  }
};

// Twists of the camera (right, its frame) by the angles and by the body's columns. As ours, without how a link's shift
// or turn changes the sag.
inline void body_twists(const Bundle& b, const BodyState& state, const double* body, const Links<double>& links,
                        const Pose<double>& camera, Eigen::Matrix<double, 6, kMaxJoints>& by_angle,
                        Eigen::Matrix<double, 6, kBody>& by_body) {
  const int n = b.n_links();
  const Sag<double> sag(body, n);
  const auto& [r, t] = camera;
  auto twist = [&r = r, &t = t](const std::array<double, 3>& axis, const std::array<double, 3>& at) {
    const auto moved = rotated_back(r, cross(axis, {t[0] - at[0], t[1] - at[1], t[2] - at[2]}));
    const auto turned = rotated_back(r, axis);
    return Vector6(moved[0], moved[1], moved[2], turned[0], turned[1], turned[2]);
  };
  Eigen::Matrix<double, 6, kMaxJoints> rigid;
  Eigen::Matrix<double, 6, 3> base;
  for (int j = 0; j < n; ++j) rigid.col(j) = twist(links.axis[j], links.at[j + 1].t);
  for (int i = 0; i < 3; ++i) base.col(i) = twist({i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0}, {0.0, 0.0, 0.0});
  const auto carried = moments(b, links, 1.0, *sag.load);
  const auto by_all = torques(b, links, carried);
  const auto by_tool = torques(b, links, moments(b, links, 0.0, 1.0));
  for (int j = 0; j < n; ++j) {
    by_angle.col(j) = rigid.col(j);
    for (int k = 0; k < n; ++k) {
      const int near = std::min(j, k), far = std::max(j, k);
      const double change = dot(links.axis[near], up_cross(b, cross(links.axis[far], carried.joints[far])));
      by_angle.col(j) += sag.joints[k] * change * rigid.col(k);
    }
    const auto change = up_cross(b, cross(links.axis[j], carried.joints[j]));
    for (int i = 0; i < 3; ++i) by_angle.col(j) += sag.base[i] * change[i] * base.col(i);
  }
  for (int j = 0; j < n; ++j) {
    const auto& parent = links.at[j].r;
    for (int i = 0; i < 3; ++i) {
      const auto along = rotated_back(r, {parent[i], parent[3 + i], parent[6 + i]});
      by_body.col(6 * j + i) << along[0], along[1], along[2], 0.0, 0.0, 0.0;
      const Eigen::Vector3d turn = state.by_turn[j].col(i);
      by_body.col(6 * j + 3 + i) = twist(rotated(parent, {turn[0], turn[1], turn[2]}), links.at[j + 1].t);
    }
  }
  auto by_load = by_body.col(7 * n + 3);
  by_load.setZero();
  for (int k = 0; k < n; ++k) {
    by_body.col(6 * n + k) = by_all.joints[k] * rigid.col(k);
    by_load += sag.joints[k] * by_tool.joints[k] * rigid.col(k);
  }
  for (int i = 0; i < 3; ++i) {
    by_body.col(7 * n + i) = by_all.base[i] * base.col(i);
    by_load += sag.base[i] * by_tool.base[i] * base.col(i);
  }
}
