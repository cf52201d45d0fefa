//! An arm, its landmarks and its camera's measurements of them, drawn from a seed.

use nalgebra::{Point3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::study::PaperStudyError;
use armcal_belief::calib::{TagMeasurement, TagObservation, View};
use armcal_belief::model::{JointParameters, Parameter, ParameterKind};
use armcal_core::joints::JointAngles;
use armcal_core::kinematics::Attachment;
use armcal_core::robot::{Robot, SurveyedTag, TagSurvey};
use armcal_core::spatial::Pose;
use armcal_core::stats::stream_rng;
use armcal_core::time::SIMULATION_EPOCH;

/// Number format of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Readings {
    /// Real numbers.
    Exact,
    /// Readings rounded to whole counts.
    WholeCounts,
}

/// Start of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guess {
    Datasheet,
    /// The true sensors, as on the right of the paper's Figure 3.
    Truth,
}

/// Choice of the drawn poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseSampling {
    /// Uniform over the joints' ranges; every landmark is seen from each, as the paper counts m measurements of all n.
    Everywhere,
    /// The poses of `Everywhere` that have every landmark in the camera's image, at least 0.25 m away; occlusion does
    /// not count.
    InImage,
}

/// Setting from which arms are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    pub poses: usize,
    /// Number of landmarks; every pose sees each.
    pub tags: usize,
    /// Standard deviation of a landmark's position in the camera frame, per axis, m.
    pub noise_m: f64,
    /// Largest relative gain error, drawn uniformly; the gain acts about the middle of the range.
    pub gain_error: f64,
    pub offset_error_rad: f64,
    pub readings: Readings,
    pub sight: PoseSampling,
    pub guess: Guess,
}

impl Default for Setting {
    /// 40 poses of 6 landmarks without noise, gains within 5 % and offsets within 5 deg.
    fn default() -> Self {
        Self {
            poses: 40,
            tags: 6,
            noise_m: 0.0,
            gain_error: 0.05,
            offset_error_rad: 5.0_f64.to_radians(),
            readings: Readings::Exact,
            sight: PoseSampling::Everywhere,
            guess: Guess::Datasheet,
        }
    }
}

/// One drawn arm and its data.
#[derive(Clone, Debug)]
pub struct Draw {
    /// The robot, with the landmarks as its tags.
    pub robot: Robot,
    pub truth: JointParameters,
    pub views: Vec<View>,
    /// True angles at which the tool's error is measured: uniform over the joints' ranges.
    pub tool_poses: Vec<JointAngles>,
}

/// Number of poses at which the tool error is measured.
const TOOL_POSES: usize = 100;
/// Least range at which the camera sees a landmark, m.
const MIN_RANGE_M: f64 = 0.25;
/// Number of random poses that are tried for one that sees all landmarks.
const MAX_TRIES: usize = 200_000;

impl Draw {
    /// Draw number `number` of a study with `seed`.
    ///
    /// Landmarks lie uniformly in the box around the robot's own tags, poses as [`PoseSampling`] says.
    ///
    /// # Errors
    /// [`PaperStudyError::Scene`] when no pose sees all landmarks.
    pub fn new(robot: &Robot, setting: &Setting, seed: u64, number: u64) -> Result<Self, PaperStudyError> {
        let rng = |what: &str| stream_rng(seed, &format!("paper study {number}: {what}"));
        let robot = with_landmarks(robot, setting.tags, &mut rng("landmarks"))?;
        let truth = drawn_sensors(&robot, setting, &mut rng("sensors"));
        let (mut poses, mut noise) = (rng("poses"), rng("noise"));
        let views = (0..setting.poses)
            .map(|pose_idx| {
                let angles = seeing_pose(&robot, setting.sight, &mut poses)?;
                let read_rad = read_angles(&robot, &truth, setting.readings, &angles);
                let tags = observations(&robot, &angles, setting.noise_m, &mut noise);
                Ok(View { tags, ..View::of_reading(pose_idx as u32, SIMULATION_EPOCH, read_rad) })
            })
            .collect::<Result<_, PaperStudyError>>()?;
        let mut tool = rng("tool");
        let tool_poses = (0..TOOL_POSES).map(|_| drawn_angles(&robot, &mut tool)).collect();
        Ok(Self { robot, truth, views, tool_poses })
    }

    /// Gains and offsets of the joints that move the camera.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let kinds = [ParameterKind::Gain, ParameterKind::Offset];
        (0..self.robot.camera.mount.n_joints).flat_map(|joint| kinds.map(|kind| Parameter { joint, kind })).collect()
    }

    /// Joint angles that the parameters `believed` give for the readings at the true `angles`.
    #[must_use]
    pub fn taken_for(&self, angles: &JointAngles, believed: &JointParameters) -> JointAngles {
        JointAngles::from_fn(angles.len(), |joint| {
            // Joints beyond the camera are outside this study: their sensors are exact.
            if joint >= self.robot.camera.mount.n_joints {
                return angles[joint];
            }
            let travel_rad = travel_rad(&self.robot, &self.truth, angles, joint);
            self.robot.sensors[joint].center_rad + believed.gain[joint] * travel_rad + believed.offset_rad[joint]
        })
    }

    /// Tool position at `angles`, base frame, m.
    #[must_use]
    pub fn tool_m(&self, angles: &JointAngles) -> Vector3<f64> {
        self.robot.chain.link_poses(angles).frame(&self.robot.tool.mount).translation.vector
    }

    /// Distance between the estimated and the true tool, root mean square over the tool poses, m.
    #[must_use]
    pub fn tool_rms_m(&self, believed: &JointParameters) -> f64 {
        let square = |angles: &JointAngles| {
            (self.tool_m(&self.taken_for(angles, believed)) - self.tool_m(angles)).norm_squared()
        };
        (self.tool_poses.iter().map(square).sum::<f64>() / self.tool_poses.len() as f64).sqrt()
    }
}

fn travel_rad(robot: &Robot, truth: &JointParameters, angles: &JointAngles, joint: usize) -> f64 {
    (angles[joint] - robot.sensors[joint].center_rad - truth.offset_rad[joint]) / truth.gain[joint]
}

fn with_landmarks(robot: &Robot, n: usize, rng: &mut ChaCha8Rng) -> Result<Robot, PaperStudyError> {
    let places = || robot.tags.iter().map(|tag| tag.base_from_tag.origin().vector());
    let (Some(low), Some(high)) = (places().reduce(|a, b| a.inf(&b)), places().reduce(|a, b| a.sup(&b))) else {
        let problem = "has no surveyed tags, so that landmarks have no place".to_owned();
        return Err(PaperStudyError::Scene { robot: robot.name.clone(), problem });
    };
    let tags = (0..n)
        .map(|id| {
            let place = low.zip_map(&high, |low, high| low + (high - low) * rng.random_range(0.0..1.0));
            let base_from_tag = Pose::from_isometry(nalgebra::Isometry3::translation(place.x, place.y, place.z));
            let (position_std_m, rotation_std_rad) = (0.0, 0.0);
            SurveyedTag { id: id as u32, size_m: 0.15, base_from_tag, position_std_m, rotation_std_rad }
        })
        .collect();
    Ok(robot.clone().with_survey(TagSurvey {
        base_tag: Some(0),
        anchor_tag: None,
        frame: Attachment::base(),
        family: None,
        tags,
    }))
}

fn drawn_sensors(robot: &Robot, setting: &Setting, rng: &mut ChaCha8Rng) -> JointParameters {
    let mut truth = JointParameters::default();
    for joint in 0..robot.n_joints() {
        let [gain, offset]: [f64; 2] = [0; 2].map(|_| rng.random_range(-1.0..1.0));
        if joint < robot.camera.mount.n_joints {
            truth.gain[joint] = 1.0 + setting.gain_error * gain;
            truth.offset_rad[joint] = setting.offset_error_rad * offset;
        }
    }
    truth
}

fn drawn_angles(robot: &Robot, rng: &mut ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(robot.n_joints(), |joint| {
        let part: f64 = rng.random_range(0.0..1.0);
        robot.chain.joints()[joint].limits.map_or(0.0, |l| l.lower_rad + part * (l.upper_rad - l.lower_rad))
    })
}

fn seeing_pose(robot: &Robot, sight: PoseSampling, rng: &mut ChaCha8Rng) -> Result<JointAngles, PaperStudyError> {
    let lens = &robot.camera.lens;
    for _ in 0..MAX_TRIES {
        let angles = drawn_angles(robot, rng);
        let camera_from_base = robot.chain.link_poses(&angles).frame(&robot.camera.mount).inverse();
        let is_seen = |tag: &SurveyedTag| {
            let place = camera_from_base * Point3::from(tag.base_from_tag.origin().vector());
            place.coords.norm() > MIN_RANGE_M && lens.project(&place.coords).is_some_and(|pixel| lens.contains(&pixel))
        };
        if sight == PoseSampling::Everywhere || robot.tags.iter().all(is_seen) {
            return Ok(angles);
        }
    }
    let problem = format!("none of {MAX_TRIES} random poses has all {} landmarks in view", robot.tags.len());
    Err(PaperStudyError::Scene { robot: robot.name.clone(), problem })
}

/// Travel of each joint by its own sensor, rad.
fn read_angles(robot: &Robot, truth: &JointParameters, readings: Readings, angles: &JointAngles) -> JointAngles {
    JointAngles::from_fn(robot.n_joints(), |joint| {
        let travel_rad = travel_rad(robot, truth, angles, joint);
        match readings {
            Readings::Exact => travel_rad,
            Readings::WholeCounts => {
                let spec = &robot.sensors[joint];
                // The middle of the range does not lie on a whole count.
                let center_counts = spec.offset_counts + spec.counts_per_rad * spec.center_rad;
                let counts = (center_counts + travel_rad * spec.counts_per_rad).round();
                (counts - center_counts) / spec.counts_per_rad
            }
        }
    })
}

/// Positions of all landmarks in the camera frame, with noise.
fn observations(robot: &Robot, angles: &JointAngles, noise_m: f64, rng: &mut ChaCha8Rng) -> Vec<TagObservation> {
    let camera_from_base = robot.chain.link_poses(angles).frame(&robot.camera.mount).inverse();
    let observation = |(tag_idx, tag): (usize, &SurveyedTag)| {
        let exact = camera_from_base * Point3::from(tag.base_from_tag.origin().vector());
        let noise = Vector3::from_fn(|_, _| noise_m * Distribution::<f64>::sample(&StandardNormal, rng));
        TagObservation {
            id: tag.id,
            tag_idx,
            center_in_camera_m: exact.coords + noise,
            measured: TagMeasurement::Position,
        }
    };
    robot.tags.iter().enumerate().map(observation).collect()
}
