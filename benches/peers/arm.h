// The arm and the numbers of the problem files.
#pragma once
#include <time.h>

#include <array>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

// Rotation row by row.
template <typename T>
struct Pose {
  std::array<T, 9> r;
  std::array<T, 3> t;
};

template <typename T>
std::array<T, 3> rotated(const std::array<T, 9>& r, const std::array<T, 3>& v) {
  return {r[0] * v[0] + r[1] * v[1] + r[2] * v[2], r[3] * v[0] + r[4] * v[1] + r[5] * v[2],
          r[6] * v[0] + r[7] * v[1] + r[8] * v[2]};
}

template <typename T>
std::array<T, 3> rotated_back(const std::array<T, 9>& r, const std::array<T, 3>& v) {
  return {r[0] * v[0] + r[3] * v[1] + r[6] * v[2], r[1] * v[0] + r[4] * v[1] + r[7] * v[2],
          r[2] * v[0] + r[5] * v[1] + r[8] * v[2]};
}

template <typename T, typename U>
std::array<T, 9> product(const std::array<T, 9>& a, const std::array<U, 9>& b) {
  std::array<T, 9> c;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) c[3 * i + k] = a[3 * i] * b[k] + a[3 * i + 1] * b[3 + k] + a[3 * i + 2] * b[6 + k];
  return c;
}

template <typename T, typename U>
Pose<T> operator*(const Pose<T>& a, const Pose<U>& b) {
  Pose<T> c;
  c.r = product(a.r, b.r);
  for (int i = 0; i < 3; ++i)
    c.t[i] = a.t[i] + a.r[3 * i] * b.t[0] + a.r[3 * i + 1] * b.t[1] + a.r[3 * i + 2] * b.t[2];
  return c;
}

inline std::array<double, 3> cross(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// parent_from_child(angle) has the rotation even + sin(angle) odd + cos(angle) swing.
struct Joint {
  Pose<double> parent_from_joint;
  std::array<double, 3> axis;
  double center_rad;
  std::array<double, 9> even, odd, swing;

  void prepare() {
    const auto& n = axis;
    std::array<double, 9> along, skew{0, -n[2], n[1], n[2], 0, -n[0], -n[1], n[0], 0}, across;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        along[3 * i + k] = n[i] * n[k];
        across[3 * i + k] = (i == k ? 1.0 : 0.0) - n[i] * n[k];
      }
    even = product(parent_from_joint.r, along);
    odd = product(parent_from_joint.r, skew);
    swing = product(parent_from_joint.r, across);
  }

  template <typename T>
  Pose<T> parent_from_child(const T& angle) const {
    using std::cos;
    using std::sin;
    const T s = sin(angle), c = cos(angle);
    Pose<T> out;
    for (int i = 0; i < 9; ++i) out.r[i] = even[i] + s * odd[i] + c * swing[i];
    for (int i = 0; i < 3; ++i) out.t[i] = T(parent_from_joint.t[i]);
    return out;
  }
};

struct Tag {
  Pose<double> pose;
  double half_size_m, std_m, std_rad;
};

constexpr int kMaxJoints = 8;

struct Arm {
  std::vector<Joint> joints;
  Pose<double> mount;
  double mount_std_m, mount_std_rad;
  std::vector<Tag> tags;
};

// Processor time of this process, ms.
inline double processor_ms() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

class Reader {
 public:
  explicit Reader(const std::string& file) : in_(file), file_(file) {
    if (!in_) throw std::runtime_error(file + ": cannot be read");
  }
  double number() {
    std::string word;
    if (!(in_ >> word)) throw std::runtime_error(file_ + ": ends too early");
    return std::stod(word);
  }
  int count() { return static_cast<int>(number()); }
  void word(const std::string& expected) {
    std::string found;
    in_ >> found;
    if (found != expected) throw std::runtime_error(file_ + ": `" + found + "` where `" + expected + "` belongs");
  }
  Pose<double> pose() {
    Pose<double> p;
    for (double& x : p.r) x = number();
    for (double& x : p.t) x = number();
    return p;
  }
  Joint joint() {
    Joint j;
    j.parent_from_joint = pose();
    for (double& x : j.axis) x = number();
    j.center_rad = number();
    j.prepare();
    return j;
  }
  Arm arm() {
    Arm a;
    word("joints");
    a.joints.resize(count());
    for (Joint& j : a.joints) j = joint();
    word("mount");
    a.mount = pose();
    a.mount_std_m = number();
    a.mount_std_rad = number();
    word("tags");
    a.tags.resize(count());
    for (Tag& t : a.tags) {
      t.pose = pose();
      t.half_size_m = number();
      t.std_m = number();
      t.std_rad = number();
    }
    return a;
  }

 private:
  std::ifstream in_;
  std::string file_;
};
