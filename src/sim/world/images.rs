//! The camera in step with the world: its images and their arrival.

use nalgebra::Isometry3;

use crate::sensors::camera::{ArmMotion, CameraShot, ScenePoses, ShutterState};
use crate::world::simulation::World;
use armcal_core::streams::{ArmError, CameraImage, DetectionRejects, Message};
use armcal_core::time::Stamp;

impl World {
    /// The shutter closes now.
    pub(super) fn expose(&mut self) -> Result<(), ArmError> {
        let links = self.place_solids();
        let shutter = ShutterState {
            poses: ScenePoses {
                links: &links,
                base_from_world: *self.base.world_from_base.inverse().isometry(),
                jaws: self.jaw_shifts(),
            },
            solids: &self.solids,
            motion: ArmMotion { chain: &self.robot.chain, angles: self.physics.angles(), rates: self.physics.rates() },
            closed: self.stamp(),
            demand: self.image_demand,
        };
        let taken = self.camera.take_image(&shutter).map_err(|error| ArmError::Camera(error.into()))?;
        let Some(mut image) = taken else { return Ok(()) };
        // It never arrives before the image ahead of it.
        if let Some(ahead) = self.images.back() {
            image.arrival = image.arrival.max(ahead.arrival);
        }
        self.images.push_back(image);
        Ok(())
    }

    /// Displacement of each jaw from the drawing.
    fn jaw_shifts(&self) -> [Isometry3<f64>; 2] {
        let jaws = self.robot.gripper.as_ref().zip(self.gripper.as_ref());
        std::array::from_fn(|n| jaws.map_or_else(Isometry3::identity, |(spec, jaws)| spec.shift(n, jaws.opening_m)))
    }

    /// Messages of an image.
    pub(super) fn deliver(&mut self, at: Stamp, image: CameraShot) {
        let stamp = image.detections.stamp;
        self.outbox.push((at, Message::Detections(image.detections)));
        if !image.rejects.is_empty() {
            self.outbox.push((at, Message::Rejects(DetectionRejects { stamp, rejects: image.rejects })));
        }
        if let Some(jpeg) = image.jpeg {
            self.outbox.push((at, Message::Image(CameraImage { stamp, jpeg })));
        }
    }
}
