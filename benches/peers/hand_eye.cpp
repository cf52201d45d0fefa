// industrial_calibration's hand-eye fit on corners from stdin, for industrial.py.
//
// In: fx fy cx cy; the guesses of camera and board, each x y z qx qy qz qw; the number of images; for each the flange's pose, the number of
// corners, and for each u v x y z. Out: base_from_camera and flange_from_board, each x y z qx qy qz qw.

#include <industrial_calibration/optimizations/extrinsic_hand_eye.h>

#include <cstdio>
#include <iostream>

using namespace industrial_calibration;

static Eigen::Isometry3d pose()
{
  double x, y, z, qx, qy, qz, qw;
  std::cin >> x >> y >> z >> qx >> qy >> qz >> qw;
  return Eigen::Translation3d(x, y, z) * Eigen::Quaterniond(qw, qx, qy, qz).normalized();
}

static void print(const Eigen::Isometry3d& pose)
{
  const Eigen::Vector3d p = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  std::printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w());
}

int main()
{
  ExtrinsicHandEyeProblem2D3D problem;
  std::cin >> problem.intr.fx() >> problem.intr.fy() >> problem.intr.cx() >> problem.intr.cy();
  problem.camera_mount_to_camera_guess = pose();
  problem.target_mount_to_target_guess = pose();
  int images = 0;
  std::cin >> images;
  for (int image = 0; image < images; ++image)
  {
    Observation2D3D observation;
    observation.to_camera_mount = Eigen::Isometry3d::Identity();
    observation.to_target_mount = pose();
    int corners = 0;
    std::cin >> corners;
    for (int corner = 0; corner < corners; ++corner)
    {
      double u, v, x, y, z;
      std::cin >> u >> v >> x >> y >> z;
      observation.correspondence_set.emplace_back(Eigen::Vector2d(u, v), Eigen::Vector3d(x, y, z));
    }
    problem.observations.push_back(observation);
  }
  const ExtrinsicHandEyeResult result = optimize(problem);
  if (!std::cin || !result.converged)
    return 1;
  print(result.camera_mount_to_camera);
  print(result.target_mount_to_target);
  return 0;
}
