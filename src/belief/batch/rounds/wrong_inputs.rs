//! The last of a round's statements: wrong inputs and motions that explain a refusal better than the arm does.

use crate::batch::rounds::{BundleCalibration, Diagnosis, EstimatePurpose, Estimated};
use crate::explain::drawing::Drawing;
use crate::explain::failure_detection::is_suspicious;
use crate::explain::failures::Failure;
use crate::explain::moved_between::MotionSearch;
use crate::explain::reading_search::ReadingSearch;
use crate::explain::unpaired::unpaired;
use crate::explain::wrong_input::wrong_input;
use crate::file::calibration::{Calibration, Status};
use crate::say::reading_error::MisreadReadings;
use crate::say::refusal::Refusal;
use crate::say::wrong_input::WrongInput;
use crate::solve::estimate::Estimate;
use crate::views::view::View;
use armcal_core::codes::{Code, Coded};

impl BundleCalibration<'_> {
    /// Puts a wrong input first among the refusals: the images contradict a file, or the readings do not mean what the
    /// input map says. Several repaired tags are refused, too, where one other reading of the whole map or lens
    /// explains them.
    pub(super) fn blame_input(&self, estimated: &Estimated<'_>, _: &Diagnosis, calibration: &mut Calibration) {
        let failures = estimated.failures;
        if calibration.status != Status::Refused {
            let has_moved_tags = self.moved.n_moved() > 1;
            let wrong =
                has_moved_tags.then(|| wrong_input(&self.data.data, &self.surveyed, &self.data.robot)).flatten();
            if let Some(wrong) = wrong.filter(WrongInput::is_of_all_tags) {
                calibration.refuse_first_for([Refusal::WrongInput(wrong)]);
                return;
            }
            let (robot, views, drawing) = (&self.data.robot, &self.as_read[..], &self.drawing);
            let search = ReadingSearch { robot, views, failures, drawing, map: None };
            calibration.refuse_first_for(search.find_other_turns().map(Refusal::MisreadReadings));
            return;
        }
        let is_of_lens = calibration.refusals.iter().any(|refusal| matches!(refusal, Refusal::Lens { .. }));
        if is_of_lens {
            return;
        }
        if let Some(wrong) = wrong_input(&self.data.data, &self.surveyed, &self.data.robot) {
            calibration.refuse_first_for([Refusal::WrongInput(wrong)]);
            return;
        }
        if calibration.refusals.iter().any(|refusal| refusal.code() == Code::JointsAlike) {
            return;
        }
        // A named scale or unit explains all refusals.
        let is_of_line = |refusal: &Refusal| matches!(refusal, Refusal::SensorLine { .. } | Refusal::SensorUnit { .. });
        let is_of_scale = |refusal: &Refusal| is_of_line(refusal) || matches!(refusal, Refusal::BeyondDatasheet { .. });
        if calibration.refusals.iter().any(is_of_line) && calibration.refusals.iter().all(is_of_scale) {
            return;
        }
        if let Some(unpaired) = &self.unpaired {
            let shifted = self.reading_search(failures, &self.drawing).find();
            let found = shifted.unwrap_or_else(|| unpaired.clone());
            calibration.refuse_first_for([Refusal::MisreadReadings(found)]);
            return;
        }
        let (robot, views, drawing, clocks) = (&self.data.robot, &self.as_read[..], &self.drawing, self.clocks());
        let motion = MotionSearch { robot, views, failures, drawing, clocks }.find(&calibration.refusals);
        if motion.is_some() {
            calibration.refuse_first_for(motion);
            return;
        }
        // A repair beyond its bound explains nothing.
        let is_unbounded = |refusal: &Refusal| matches!(refusal, Refusal::RepairTooLarge { .. });
        let nominal = Drawing::default();
        let drawing = if calibration.refusals.iter().any(is_unbounded) { &nominal } else { &self.drawing };
        calibration.refuse_first_for(self.reading_search(failures, drawing).find().map(Refusal::MisreadReadings));
    }

    fn reading_search<'b>(&'b self, failures: &'b [Failure], drawing: &'b Drawing) -> ReadingSearch<'b> {
        let map = self.map.is_none().then_some(&self.surveyed[..]);
        ReadingSearch { robot: &self.data.robot, views: &self.as_read, failures, drawing, map }
    }

    /// Searches for readings in a wrong order, with the tags as surveyed, where no model explains the views.
    pub(super) fn find_unpaired(&self, found: &Estimate<'_>, views: &[View]) -> Option<MisreadReadings> {
        if self.purpose != EstimatePurpose::Final || !is_suspicious(found) {
            return None;
        }
        let mut robot = self.data.robot.clone();
        if self.map.is_none() {
            robot.tags.clone_from(&self.surveyed);
        }
        unpaired(&robot, views)
    }
}
