//! Poses of an arm's tool in the base frame: for scripts that compare them with other readers of URDF.
//!
//!     echo "0.1 0.2 0.3" | cargo run --release -p armcal-core --example tool_pose -- ROBOT
//!
//! Each line of stdin has one angle per joint, rad, or m of a slide. Each line of the answer has the position in m and
//! the quaternion (w, x, y, z) of the tool's link.

use std::error::Error;
use std::io::{BufRead, Write};
use std::path::Path;

use armcal_core::joints::JointAngles;
use armcal_core::robot::load;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("name a robot folder")?;
    let robot = load(Path::new(&folder))?;
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let angles: Vec<f64> = line?.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        if angles.len() != robot.n_joints() {
            return Err(format!("{} angles for {} joints", angles.len(), robot.n_joints()).into());
        }
        let pose = robot.chain.frame(&JointAngles::from_slice(&angles), &robot.tool.mount);
        let (at, turn) = (pose.translation.vector, pose.rotation);
        writeln!(out, "{:e} {:e} {:e} {:e} {:e} {:e} {:e}", at.x, at.y, at.z, turn.w, turn.i, turn.j, turn.k)?;
    }
    Ok(())
}
