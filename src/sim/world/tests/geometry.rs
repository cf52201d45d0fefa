//! An arm with geometry errors, in either engine.

use super::*;
use armcal_core::robot::Robot;

/// Tool and camera are at the poses by forward kinematics of the arm as built, not of the nominal arm.
#[test]
fn tool_and_camera_follow_the_arm_as_built() {
    let nominal = load(&Path::new(ROOT).join("robots/titan4")).expect("the robot reads");
    for engine in [EngineKind::Featherstone, EngineKind::Rapier] {
        let mut spec = WorldSpec::default();
        spec.physics.engine = Some(engine);
        spec.geometry.error_ratio = 3.0;
        let mut world = world(spec, 2);
        for _ in 0..200 {
            world.physics_step(&[0.3; MAX_JOINTS]).expect("it steps");
        }
        let (state, built) = (world.truth_state(), &world.header.as_built);
        let arm = built.arm(&nominal);
        let tool_m = |robot: &Robot| robot.chain.frame(&state.angles, &robot.tool.mount).translation.vector;
        let camera_m =
            |robot: &Robot| robot.chain.frame(&state.angles, &built.camera_attachment(robot)).translation.vector;
        for (name, true_m, at) in [
            ("tool", state.base_from_tool.origin().vector(), [tool_m(&arm), tool_m(&nominal)]),
            ("camera", state.base_from_camera.origin().vector(), [camera_m(&arm), camera_m(&nominal)]),
        ] {
            let [by_arm_m, by_nominal_m] = at.map(|at_m| (at_m - true_m).norm());
            eprintln!("{engine:?}: {name} off by {by_arm_m:.1e} m as built, {by_nominal_m:.1e} m nominal");
            assert!(by_arm_m < 1e-9 && by_nominal_m > 5e-4, "{engine:?} {name}: {by_arm_m} {by_nominal_m}");
        }
    }
}
