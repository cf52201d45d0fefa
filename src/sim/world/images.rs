//! Camera in step with the world: its images and their arrival.

use nalgebra::Isometry3;

use crate::sensors::camera::{ArmMotion, CameraShot, ScenePoses, SeenTags, ShutterState};
use crate::world::simulation::{Outgoing, World};
use armcal_core::streams::Message;
use armcal_core::time::Stamp;

impl World {
    /// Takes an image at the present time.
    pub(super) fn expose(&mut self) {
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
        let Some(mut image) = self.camera.take_image(&shutter) else { return };
        // An image never arrives before the one ahead of it.
        if let Some(ahead) = self.images.back() {
            image.arrival = image.arrival.max(ahead.arrival);
        }
        self.images.push_back(image);
    }

    /// Returns the displacement of each jaw from the nominal model.
    fn jaw_shifts(&self) -> [Isometry3<f64>; 2] {
        let jaws = self.robot.gripper.as_ref().zip(self.gripper.as_ref());
        std::array::from_fn(|n| jaws.map_or_else(Isometry3::identity, |(spec, jaws)| spec.shift(n, jaws.opening_m)))
    }

    /// Delivers the messages of an image.
    pub(super) fn deliver(&mut self, at: Stamp, image: CameraShot) {
        match image.tags {
            SeenTags::Projected(detections) => self.tell(at, Message::Detections(detections)),
            SeenTags::Searched(late) => self.outbox.push(Outgoing::Late(at, late)),
        }
    }
}
