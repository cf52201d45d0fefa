// The problem of `bundle` by Ceres, one thread: bundle_ceres FILE RUNS prints "name, time ms, iterations, cost" of each run.
//
// Parameter blocks: `common` (sensors, the mount's six, and where the file says so body and lens) and six a tag. One
// residual block a sighting, one a prior. With analytic Jacobians the poses of a view are computed once for all its tags,
// before the residuals (EvaluationCallback).
#include <ceres/ceres.h>

#include <cstdio>
#include <cstdlib>
#include <memory>

#include "body.h"

namespace {

constexpr int kSensors = 30;
// Sensors and mount; with body and lens.
constexpr int kFew = kSensors + 6, kAll = kFew + kBody + 8;
using Rows = Eigen::Matrix<double, 8, 6, Eigen::RowMajor>;
using LensRows = Eigen::Matrix<double, 8, 8, Eigen::RowMajor>;

struct State {
  std::vector<double> common;
  std::vector<std::array<double, 6>> tags;

  State(const Bundle& b, int n_common) : common(n_common, 0.0), tags(b.arm.tags.size()) {
    for (int k = 0; k < kSensors; ++k) common[k] = b.parameters[k].mean;
    if (n_common == kAll) std::copy(b.lens.begin(), b.lens.end(), common.end() - 8);
    for (auto& t : tags) t.fill(0.0);
  }
};

template <typename T, typename U>
Pose<T> inverse_times(const Pose<T>& a, const Pose<U>& b) {
  Pose<T> out;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k)
      out.r[3 * i + k] = a.r[i] * b.r[k] + a.r[3 + i] * b.r[3 + k] + a.r[6 + i] * b.r[6 + k];
  out.t = rotated_back(a.r, {b.t[0] - a.t[0], b.t[1] - a.t[1], b.t[2] - a.t[2]});
  return out;
}

// ---- AutoDiff ----

template <int N, typename T>
Pose<T> base_from_camera(const Bundle& b, int view, const T* common) {
  if constexpr (N == kAll) {
    const T* body = common + kFew;
    std::array<std::array<T, 9>, kMaxJoints> turns;
    for (int j = 0; j < b.n_links(); ++j) turns[j] = exp_so3(body + 6 * j + 3);
    return bent_links(b, view, common, body, turns.data()).at[b.n_links()] * b.arm.mount * exp_se3(common + kSensors);
  } else {
    Pose<T> at = b.arm.joints[0].parent_from_child(b.angle(view, 0, common));
    for (size_t j = 1; j < b.arm.joints.size(); ++j) at = at * b.arm.joints[j].parent_from_child(b.angle(view, j, common));
    return at * b.arm.mount * exp_se3(common + kSensors);
  }
}

template <int N>
struct SightingFunctor {
  const Bundle* b;
  const Sighting* s;
  template <typename T>
  bool operator()(const T* common, const T* tag, T* residuals) const {
    const Pose<T> base_from_tag = Pose<T>(cast<T>(b->arm.tags[s->tag].pose)) * exp_se3(tag);
    const Pose<T> at = inverse_times(base_from_camera<N>(*b, s->view, common), base_from_tag);
    for (int k = 0; k < 4; ++k) {
      const auto c = corner(k, b->arm.tags[s->tag].half_size_m);
      std::array<T, 3> p;
      for (int i = 0; i < 3; ++i) p[i] = at.t[i] + at.r[3 * i] * c[0] + at.r[3 * i + 1] * c[1];
      T pixel[2];
      if constexpr (N == kAll) {
        project(common + N - 8, p, pixel);
      } else {
        project(b->lens.data(), p, pixel);
      }
      for (int i = 0; i < 2; ++i) residuals[2 * k + i] = s->weight * (s->corners_px[k][i] - pixel[i]);
    }
    return true;
  }
  template <typename T>
  static Pose<T> cast(const Pose<double>& p) {
    Pose<T> out;
    for (int i = 0; i < 9; ++i) out.r[i] = T(p.r[i]);
    for (int i = 0; i < 3; ++i) out.t[i] = T(p.t[i]);
    return out;
  }
};

template <int N>
struct PriorFunctor {
  std::array<double, N> mean, std;
  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    for (int i = 0; i < N; ++i) residuals[i] = (x[i] - mean[i]) / std[i];
    return true;
  }
};

// ---- analytic ----

// Poses and their derivatives at the point that Ceres evaluates.
class Kinematics : public ceres::EvaluationCallback {
 public:
  struct View {
    Pose<double> base_from_camera;
    // Twist of the camera (right, its frame) by each angle, then by the mount's delta.
    Eigen::Matrix<double, 6, kMaxJoints> by_angle;
    Eigen::Matrix<double, 6, kBody> by_body;
  };
  struct TagPose {
    Pose<double> base_from_tag;
    Matrix6 by_delta;
  };

  Kinematics(const Bundle& b, const State& state) : b_(b), state_(state), views(b.basis.size()), tags(b.arm.tags.size()) {}

  void PrepareForEvaluation(bool with_jacobians, bool is_new) override {
    if (!is_new && (!with_jacobians || has_jacobians_)) return;
    has_jacobians_ = with_jacobians;
    const double* common = state_.common.data();
    const Pose<double> mount = b_.arm.mount * exp_se3(common + kSensors);
    if (with_jacobians) by_mount = right_jacobian(common + kSensors);
    if (has_body()) body_.prepare(b_, common + kFew);
    for (size_t k = 0; k < tags.size(); ++k) {
      tags[k].base_from_tag = b_.arm.tags[k].pose * exp_se3(state_.tags[k].data());
      if (with_jacobians) tags[k].by_delta = right_jacobian(state_.tags[k].data());
    }
    for (size_t v = 0; v < views.size(); ++v)
      has_body() ? prepare_body(v, common, mount, with_jacobians) : prepare(v, common, mount, with_jacobians);
  }

  const double* lens() const { return has_body() ? state_.common.data() + kAll - 8 : b_.lens.data(); }

 private:
  bool has_body() const { return state_.common.size() == kAll; }

  void prepare_body(int v, const double* common, const Pose<double>& mount, bool with_jacobians) {
    const double* body = common + kFew;
    const auto links = bent_links(b_, v, common, body, body_.turns.data());
    View& view = views[v];
    view.base_from_camera = links.at[b_.n_links()] * mount;
    if (with_jacobians) body_twists(b_, body_, body, links, view.base_from_camera, view.by_angle, view.by_body);
  }

  void prepare(int v, const double* common, const Pose<double>& mount, bool with_jacobians) {
    std::array<Pose<double>, kMaxJoints> links;
    const size_t n = b_.arm.joints.size();
    for (size_t j = 0; j < n; ++j) {
      const Pose<double> step = b_.arm.joints[j].parent_from_child(b_.angle(v, j, common));
      links[j] = j == 0 ? step : links[j - 1] * step;
    }
    View& view = views[v];
    view.base_from_camera = links[n - 1] * mount;
    if (!with_jacobians) return;
    const auto& [r, t] = view.base_from_camera;
    for (size_t j = 0; j < n; ++j) {
      const auto axis = rotated(links[j].r, b_.arm.joints[j].axis);
      const auto& o = links[j].t;
      const auto moved = rotated_back(r, cross(axis, {t[0] - o[0], t[1] - o[1], t[2] - o[2]}));
      const auto turned = rotated_back(r, axis);
      for (int i = 0; i < 3; ++i) {
        view.by_angle(i, j) = moved[i];
        view.by_angle(3 + i, j) = turned[i];
      }
    }
  }

  const Bundle& b_;
  const State& state_;
  BodyState body_;
  bool has_jacobians_ = false;

 public:
  std::vector<View> views;
  std::vector<TagPose> tags;
  Matrix6 by_mount;
};

template <int N>
class SightingCost : public ceres::SizedCostFunction<8, N, 6> {
 public:
  SightingCost(const Bundle& b, const Sighting& s, const Kinematics& at) : b_(b), s_(s), at_(at) {}

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    const auto& view = at_.views[s_.view];
    const auto& tag = at_.tags[s_.tag];
    const Pose<double> at = inverse_times(view.base_from_camera, tag.base_from_tag);
    // d(residual)/d(twist) of the camera and of the tag.
    Rows by_camera, by_tag;
    LensRows by_lens;
    for (int k = 0; k < 4; ++k) {
      const auto c = corner(k, b_.arm.tags[s_.tag].half_size_m);
      std::array<double, 3> p;
      for (int i = 0; i < 3; ++i) p[i] = at.t[i] + at.r[3 * i] * c[0] + at.r[3 * i + 1] * c[1];
      double pixel[2], by_point[2][3], pixel_by_lens[2][8];
      if (jacobians == nullptr) {
        project(at_.lens(), p, pixel);
      } else {
        project(at_.lens(), p, pixel, by_point, N == kAll ? pixel_by_lens : nullptr);
      }
      for (int i = 0; i < 2; ++i) {
        residuals[2 * k + i] = s_.weight * (s_.corners_px[k][i] - pixel[i]);
        if (jacobians == nullptr) continue;
        const std::array<double, 3> a{s_.weight * by_point[i][0], s_.weight * by_point[i][1], s_.weight * by_point[i][2]};
        const auto turn = cross(a, p), in_tag = rotated_back(at.r, a);
        by_camera.row(2 * k + i) << a[0], a[1], a[2], -turn[0], -turn[1], -turn[2];
        by_tag.row(2 * k + i) << -in_tag[0], -in_tag[1], -in_tag[2], -c[1] * in_tag[2], c[0] * in_tag[2],
            c[1] * in_tag[0] - c[0] * in_tag[1];
        if constexpr (N == kAll)
          for (int n = 0; n < 8; ++n) by_lens(2 * k + i, n) = -s_.weight * pixel_by_lens[i][n];
      }
    }
    if (jacobians == nullptr) return true;
    if (double* out = jacobians[0]) by_common(view, by_camera, by_lens, out);
    if (double* out = jacobians[1]) Eigen::Map<Rows>(out).noalias() = by_tag * tag.by_delta;
    return true;
  }

 private:
  void by_common(const Kinematics::View& view, const Rows& by_camera, const LensRows& by_lens, double* out) const {
    Eigen::Map<Eigen::Matrix<double, 8, N, Eigen::RowMajor>> rows(out);
    const auto& basis = b_.basis[s_.view];
    for (size_t j = 0; j < b_.arm.joints.size(); ++j) {
      const Eigen::Matrix<double, 8, 1> by_angle = by_camera * view.by_angle.col(j);
      for (int p = b_.first[j]; p < b_.first[j + 1]; ++p) rows.col(p) = by_angle * basis[p];
    }
    rows.template middleCols<6>(kSensors).noalias() = by_camera * at_.by_mount;
    if constexpr (N == kAll) {
      rows.template middleCols<kBody>(kFew).noalias() = by_camera * view.by_body;
      rows.template rightCols<8>() = by_lens;
    }
  }

  const Bundle& b_;
  const Sighting& s_;
  const Kinematics& at_;
};

template <int N>
class PriorCost : public ceres::SizedCostFunction<N, N> {
 public:
  explicit PriorCost(const PriorFunctor<N>& prior) : prior_(prior) {}
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    prior_(x[0], residuals);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, N, N, Eigen::RowMajor>> out(jacobians[0]);
      out.setZero();
      for (int i = 0; i < N; ++i) out(i, i) = 1.0 / prior_.std[i];
    }
    return true;
  }

 private:
  PriorFunctor<N> prior_;
};

// ---- runs ----

enum class Derivatives { kAnalytic, kAuto };

template <int N>
void add_prior(ceres::Problem& problem, const PriorFunctor<N>& prior, double* block, Derivatives by) {
  ceres::CostFunction* cost = nullptr;
  if (by == Derivatives::kAnalytic) {
    cost = new PriorCost<N>(prior);
  } else {
    cost = new ceres::AutoDiffCostFunction<PriorFunctor<N>, N, N>(new PriorFunctor<N>(prior));
  }
  problem.AddResidualBlock(cost, nullptr, block);
}

PriorFunctor<6> pose_prior(double std_m, double std_rad) {
  return {{}, {std_m, std_m, std_m, std_rad, std_rad, std_rad}};
}

template <int N>
void add_all(ceres::Problem& problem, const Bundle& b, State& state, const Kinematics& kinematics, Derivatives by) {
  double* common = state.common.data();
  for (const Sighting& s : b.sightings) {
    ceres::CostFunction* cost = nullptr;
    if (by == Derivatives::kAnalytic) {
      cost = new SightingCost<N>(b, s, kinematics);
    } else {
      cost = new ceres::AutoDiffCostFunction<SightingFunctor<N>, 8, N, 6>(new SightingFunctor<N>{&b, &s});
    }
    problem.AddResidualBlock(cost, nullptr, common, state.tags[s.tag].data());
  }
  PriorFunctor<N> prior{};
  const auto mount = pose_prior(b.arm.mount_std_m, b.arm.mount_std_rad);
  for (int k = 0; k < kSensors; ++k) prior.mean[k] = b.parameters[k].mean, prior.std[k] = b.parameters[k].std;
  for (int k = 0; k < 6; ++k) prior.std[kSensors + k] = mount.std[k];
  if constexpr (N == kAll) {
    for (int k = 0; k < kBody; ++k) prior.std[kFew + k] = b.body.std[k];
    for (int k = 0; k < 8; ++k) prior.mean[N - 8 + k] = b.lens[k], prior.std[N - 8 + k] = b.body.lens_std[k];
  }
  add_prior(problem, prior, common, by);
  for (size_t k = 0; k < state.tags.size(); ++k)
    add_prior(problem, pose_prior(b.arm.tags[k].std_m, b.arm.tags[k].std_rad), state.tags[k].data(), by);
}

struct Choice {
  const char* name;
  ceres::LinearSolverType type;
  ceres::DenseLinearAlgebraLibraryType dense = ceres::EIGEN;
  ceres::SparseLinearAlgebraLibraryType sparse = ceres::SUITE_SPARSE;
};

template <int N>
void run(const Bundle& b, const Choice& choice, Derivatives by) {
  ceres::Solver::Options options;
  options.linear_solver_type = choice.type;
  options.dense_linear_algebra_library_type = choice.dense;
  options.sparse_linear_algebra_library_type = choice.sparse;
  options.num_threads = 1;
  options.max_num_iterations = 100;
  options.logging_type = ceres::SILENT;
  // The same rule: stop where a step saves less than this share of the cost, and for no other reason.
  options.function_tolerance = b.relative_gain;
  options.gradient_tolerance = 0.0;
  options.parameter_tolerance = 0.0;
  // Damping starts where ours does.
  options.initial_trust_region_radius = 1e6;
  options.max_trust_region_radius = 1e16;

  State state(b, N);
  Kinematics kinematics(b, state);
  ceres::Problem::Options problem_options;
  if (by == Derivatives::kAnalytic) problem_options.evaluation_callback = &kinematics;
  ceres::Problem problem(problem_options);
  add_all<N>(problem, b, state, kinematics, by);
  if (choice.type == ceres::DENSE_SCHUR || choice.type == ceres::SPARSE_SCHUR) {
    auto order = std::make_shared<ceres::ParameterBlockOrdering>();
    for (auto& t : state.tags) order->AddElementToGroup(t.data(), 0);
    order->AddElementToGroup(state.common.data(), 1);
    options.linear_solver_ordering = order;
  }
  ceres::Solver::Summary summary;
  const double start_ms = processor_ms();
  ceres::Solve(options, &problem, &summary);
  const double elapsed_ms = processor_ms() - start_ms;
  if (!summary.IsSolutionUsable()) throw std::runtime_error(choice.name + (": " + summary.message));
  if (std::getenv("FULL_REPORT") != nullptr) std::fprintf(stderr, "%s\n", summary.FullReport().c_str());
  const int steps = summary.num_successful_steps + summary.num_unsuccessful_steps - 1;
  std::printf("Ceres %s %s, %.6f, %d, %.17g\n", by == Derivatives::kAnalytic ? "analytic" : "AutoDiff", choice.name,
              elapsed_ms, steps, 2.0 * summary.final_cost);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "bundle_ceres FILE RUNS\n"), 2;
  google::InitGoogleLogging(argv[0]);
  try {
    const Bundle bundle(argv[1]);
    const bool has_body = !bundle.body.std.empty();
    if (bundle.n_joint() != kSensors || (has_body && bundle.body.std.size() != kBody))
      throw std::runtime_error("compiled for 5 joints of 6 parameters");
    const Choice choices[] = {
        {"DENSE_SCHUR", ceres::DENSE_SCHUR},
        {"SPARSE_SCHUR", ceres::SPARSE_SCHUR},
        {"DENSE_NORMAL_CHOLESKY", ceres::DENSE_NORMAL_CHOLESKY},
        {"DENSE_NORMAL_CHOLESKY (LAPACK)", ceres::DENSE_NORMAL_CHOLESKY, ceres::LAPACK},
        {"SPARSE_NORMAL_CHOLESKY", ceres::SPARSE_NORMAL_CHOLESKY},
        {"SPARSE_NORMAL_CHOLESKY (Eigen)", ceres::SPARSE_NORMAL_CHOLESKY, ceres::EIGEN, ceres::EIGEN_SPARSE},
    };
    for (int k = 0; k < std::atoi(argv[2]); ++k)
      for (const Derivatives by : {Derivatives::kAnalytic, Derivatives::kAuto})
        for (const Choice& choice : choices) has_body ? run<kAll>(bundle, choice, by) : run<kFew>(bundle, choice, by);
  } catch (const std::exception& e) {
    return std::fprintf(stderr, "%s\n", e.what()), 1;
  }
}
