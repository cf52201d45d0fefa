// Minimum distance by NLopt's BOBYQA: distance_nlopt FILE RUNS prints "name, time ms, evaluations, cost" of each run.
#include <nlopt.h>

#include <cstdio>
#include <cstdlib>

#include "arm.h"

struct Seen {
  int tag;
  std::array<double, 3> in_camera_m;
};

struct View {
  std::vector<double> travel_rad;
  std::vector<Seen> seen;
};

struct Problem {
  Arm arm;
  // Prior sigma of gain and offset of each joint.
  std::vector<std::array<double, 2>> std;
  std::vector<View> views;
  double box_sigmas, rho_begin, rho_end;
  int evaluations = 0;

  explicit Problem(const std::string& file) {
    Reader in(file);
    arm = in.arm();
    in.word("gain_and_offset_std");
    std.resize(arm.joints.size());
    for (auto& s : std) s = {in.number(), in.number()};
    in.word("views");
    views.resize(in.count());
    for (View& v : views) {
      v.travel_rad.resize(arm.joints.size());
      for (double& x : v.travel_rad) x = in.number();
      v.seen.resize(in.count());
      for (Seen& s : v.seen) {
        s.tag = in.count();
        for (double& x : s.in_camera_m) x = in.number();
      }
    }
    in.word("box_and_rho");
    box_sigmas = in.number();
    rho_begin = in.number();
    rho_end = in.number();
  }

  // Sum of distances, m; x: gain and offset of each joint, steps from the datasheet in prior sigma.
  double cost(const double* x) const {
    double sum = 0.0;
    for (const View& v : views) {
      Pose<double> at{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
      for (size_t j = 0; j < arm.joints.size(); ++j) {
        const double gain = 1.0 + std[j][0] * x[2 * j], offset_rad = std[j][1] * x[2 * j + 1];
        at = at * arm.joints[j].parent_from_child(arm.joints[j].center_rad + gain * v.travel_rad[j] + offset_rad);
      }
      at = at * arm.mount;
      for (const Seen& s : v.seen) {
        const auto p = rotated(at.r, s.in_camera_m);
        const auto& surveyed = arm.tags[s.tag].pose.t;
        const double dx = p[0] + at.t[0] - surveyed[0], dy = p[1] + at.t[1] - surveyed[1],
                     dz = p[2] + at.t[2] - surveyed[2];
        sum += std::sqrt(dx * dx + dy * dy + dz * dz);
      }
    }
    return sum;
  }
};

static double objective(unsigned, const double* x, double*, void* data) {
  auto* problem = static_cast<Problem*>(data);
  ++problem->evaluations;
  return problem->cost(x);
}

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "distance_nlopt FILE RUNS\n"), 2;
  try {
    Problem problem(argv[1]);
    const unsigned n = 2 * problem.arm.joints.size();
    for (int run = 0; run < std::atoi(argv[2]); ++run) {
      std::vector<double> x(n, 0.0);
      double cost = 0.0;
      problem.evaluations = 0;
      const double start_ms = processor_ms();
      nlopt_opt opt = nlopt_create(NLOPT_LN_BOBYQA, n);
      nlopt_set_min_objective(opt, objective, &problem);
      nlopt_set_lower_bounds1(opt, -problem.box_sigmas);
      nlopt_set_upper_bounds1(opt, problem.box_sigmas);
      nlopt_set_initial_step1(opt, problem.rho_begin);
      // The last trust-region radius.
      nlopt_set_xtol_abs1(opt, problem.rho_end);
      const nlopt_result result = nlopt_optimize(opt, x.data(), &cost);
      nlopt_destroy(opt);
      const double elapsed_ms = processor_ms() - start_ms;
      if (result < 0 && result != NLOPT_ROUNDOFF_LIMITED) return std::fprintf(stderr, "NLopt says %d\n", result), 1;
      std::printf("NLopt BOBYQA, %.6f, %d, %.17g\n", elapsed_ms, problem.evaluations, cost);
    }
  } catch (const std::exception& e) {
    return std::fprintf(stderr, "%s\n", e.what()), 1;
  }
}
