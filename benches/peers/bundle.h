// The problem of bundle_ceres: what is measured, poses, and the lens.
//
// Poses are prior * exp(delta), delta = (translation, rotation): priors are then linear in delta.
#pragma once
#include <Eigen/Dense>

#include "arm.h"

struct Sighting {
  int view, tag;
  // Root of the inverse of a coordinate's variance.
  double weight;
  std::array<std::array<double, 2>, 4> corners_px;
};

struct Parameter {
  int joint;
  double mean, std;
};

// Weight less buoyancy of a link, and its first moment in the link's frame.
struct Load {
  double weight_n;
  std::array<double, 3> moment_nm;
};

// What the drawing says of the whole arm, where links, sag and lens are free, too; else empty.
struct Body {
  // Beyond the camera: their links weigh.
  std::vector<Joint> beyond;
  std::vector<std::vector<double>> beyond_rad;
  std::array<double, 3> up;
  // Base first.
  std::vector<Load> loads;
  // Where a load hangs: behind so many joints, and there.
  int tool_joints;
  std::array<double, 3> tool_m;
  // Links joint by joint (shift, turn), each joint's compliance, the base's three, the load.
  std::vector<double> std;
  std::array<double, 8> lens_std;
};

struct Bundle {
  Arm arm;
  Body body;
  // Focal lengths, centre, four terms of the distortion.
  std::array<double, 8> lens;
  std::vector<Parameter> parameters;
  // First parameter of each joint, and the end.
  std::vector<int> first;
  // d(angle)/d(parameter) of each view.
  std::vector<std::vector<double>> basis;
  std::vector<Sighting> sightings;
  double relative_gain;

  explicit Bundle(const std::string& file) {
    Reader in(file);
    arm = in.arm();
    in.word("lens");
    for (double& x : lens) x = in.number();
    in.word("parameters");
    parameters.resize(in.count());
    first.assign(arm.joints.size() + 1, 0);
    for (Parameter& p : parameters) {
      p.joint = in.count();
      p.mean = in.number();
      p.std = in.number();
      ++first[p.joint + 1];
    }
    for (size_t j = 0; j < arm.joints.size(); ++j) first[j + 1] += first[j];
    in.word("views");
    basis.resize(in.count());
    for (size_t v = 0; v < basis.size(); ++v) {
      basis[v].resize(parameters.size());
      for (double& x : basis[v]) x = in.number();
      const int n_seen = in.count();
      for (int k = 0; k < n_seen; ++k) {
        Sighting s;
        s.view = static_cast<int>(v);
        s.tag = in.count();
        s.weight = std::sqrt(in.number());
        for (auto& corner : s.corners_px)
          for (double& x : corner) x = in.number();
        sightings.push_back(s);
      }
    }
    in.word("relative_gain");
    relative_gain = in.number();
    in.word("body");
    if (in.count() != 0) read_body(in);
  }

  void read_body(Reader& in) {
    body.beyond.resize(in.count());
    for (Joint& joint : body.beyond) joint = in.joint();
    for (double& x : body.up) x = in.number();
    body.loads.resize(in.count());
    for (Load& load : body.loads) {
      load.weight_n = in.number();
      for (double& x : load.moment_nm) x = in.number();
    }
    body.tool_joints = in.count();
    for (double& x : body.tool_m) x = in.number();
    body.std.resize(in.count());
    for (double& x : body.std) x = in.number();
    for (double& x : body.lens_std) x = in.number();
    body.beyond_rad.resize(basis.size());
    for (auto& view : body.beyond_rad) {
      view.resize(body.beyond.size());
      for (double& x : view) x = in.number();
    }
  }

  int n_links() const { return static_cast<int>(arm.joints.size()); }
  int n_moving() const { return static_cast<int>(arm.joints.size() + body.beyond.size()); }
  const Joint& joint(int j) const { return j < n_links() ? arm.joints[j] : body.beyond[j - n_links()]; }

  int n_joint() const { return static_cast<int>(parameters.size()); }

  // Angle of a joint; where nothing is off its mean it is centre + travel, and the gain's column is the travel.
  template <typename T>
  T angle(int view, int joint, const T* x) const {
    T sum(arm.joints[joint].center_rad);
    for (int p = first[joint]; p < first[joint + 1]; ++p) sum += basis[view][p] * x[p];
    return sum;
  }
};

// exp of SE(3). The coefficients' series in the squared angle: differentiable at zero.
template <typename T>
Pose<T> exp_se3(const T* delta) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  const T &x = delta[3], &y = delta[4], &z = delta[5];
  const T q = x * x + y * y + z * z;
  T a, b, c;  // sin t/t, (1 - cos t)/t^2, (t - sin t)/t^3
  if (q < T(0.25)) {
    a = 1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0 * (1.0 - q / 156.0)))));
    b = 0.5 * (1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0 * (1.0 - q / 132.0)))));
    c = (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0 * (1.0 - q / 156.0))))) / 6.0;
  } else {
    const T t = sqrt(q);
    a = sin(t) / t;
    b = (1.0 - cos(t)) / q;
    c = (1.0 - a) / q;
  }
  const T s[9] = {T(0.0), -z, y, z, T(0.0), -x, -y, x, T(0.0)};
  const T s2[9] = {x * x - q, x * y, x * z, x * y, y * y - q, y * z, x * z, y * z, z * z - q};
  Pose<T> out;
  std::array<T, 9> v;
  for (int i = 0; i < 9; ++i) {
    const double one = i % 4 == 0 ? 1.0 : 0.0;
    out.r[i] = one + a * s[i] + b * s2[i];
    v[i] = one + b * s[i] + c * s2[i];
  }
  out.t = rotated(v, {delta[0], delta[1], delta[2]});
  return out;
}

using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

// exp(delta + d) = exp(delta) exp(J d): J = sum (-ad)^n/(n + 1)!.
inline Matrix6 right_jacobian(const double* delta) {
  auto skew = [](const double* v) {
    Eigen::Matrix3d m;
    m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
    return m;
  };
  Matrix6 ad = Matrix6::Zero();
  ad.block<3, 3>(0, 0) = ad.block<3, 3>(3, 3) = skew(delta + 3);
  ad.block<3, 3>(0, 3) = skew(delta);
  Matrix6 sum = Matrix6::Identity(), term = Matrix6::Identity();
  for (int n = 1; n < 30 && term.lpNorm<Eigen::Infinity>() > 1e-18; ++n) {
    term = (term * ad * (-1.0 / (n + 1))).eval();
    sum += term;
  }
  return sum;
}

// Equidistant fisheye with four coefficients.
template <typename T, typename L>
void project(const L* lens, const std::array<T, 3>& p, T* pixel) {
  using std::atan2;
  using std::sqrt;
  const T r = sqrt(p[0] * p[0] + p[1] * p[1]);
  const T theta = atan2(r, p[2]);
  const T t2 = theta * theta;
  const L* k = lens + 4;
  const T scale = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / r;
  for (int i = 0; i < 2; ++i) pixel[i] = lens[i] * scale * p[i] + lens[2 + i];
}

// The same with d(pixel)/d(point), and with d(pixel)/d(lens) where `by_lens` is wanted.
inline void project(const double* lens, const std::array<double, 3>& p, double* pixel, double by_point[2][3],
                    double (*by_lens)[8]) {
  const auto [x, y, z] = p;
  const double r2 = x * x + y * y, r = std::sqrt(r2), theta = std::atan2(r, z), t2 = theta * theta, d2 = r2 + z * z;
  const double* k = lens + 4;
  const double distorted = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
  const double slope = 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
  const double ux = x / r, uy = y / r, scale = distorted / r, along = slope * z / d2, axial = -slope * r / d2;
  const double off = (along - scale) * ux * uy;
  const double fx = lens[0], fy = lens[1];
  pixel[0] = fx * distorted * ux + lens[2];
  pixel[1] = fy * distorted * uy + lens[3];
  by_point[0][0] = fx * (along * ux * ux + scale * uy * uy);
  by_point[0][1] = fx * off;
  by_point[0][2] = fx * axial * ux;
  by_point[1][0] = fy * off;
  by_point[1][1] = fy * (along * uy * uy + scale * ux * ux);
  by_point[1][2] = fy * axial * uy;
  if (by_lens == nullptr) return;
  const double u[2] = {ux, uy}, cubed = theta * t2;
  const double powers[4] = {cubed, cubed * t2, cubed * t2 * t2, cubed * t2 * t2 * t2};
  for (int i = 0; i < 2; ++i) {
    by_lens[i][i] = distorted * u[i];
    by_lens[i][1 - i] = 0.0;
    by_lens[i][2 + i] = 1.0;
    by_lens[i][3 - i] = 0.0;
    for (int n = 0; n < 4; ++n) by_lens[i][4 + n] = lens[i] * u[i] * powers[n];
  }
}

// Corner k of a tag, in its plane.
inline std::array<double, 2> corner(int k, double half) {
  constexpr double sx[4] = {-1, 1, 1, -1}, sy[4] = {-1, -1, 1, 1};
  return {sx[k] * half, sy[k] * half};
}
