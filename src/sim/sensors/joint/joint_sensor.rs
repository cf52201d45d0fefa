//! Joint sensor: a chain of backlash, sensing element, slip, gears and quantizer.

use crate::as_built::{JointAsBuilt, WornSpot};
use crate::sensors::OilState;
use crate::sensors::joint::encoder::Encoder;
use crate::sensors::joint::potentiometer::Potentiometer;
use crate::sensors::joint::quantizer::Quantizer;
use crate::sensors::joint::resolver::Resolver;
use crate::spec::JointSensorsSpec;
use armcal_core::robot::{JointSensorSpec, SensorKind};

/// Joint sensor as built.
#[derive(Clone, Debug)]
pub(crate) struct JointSensor {
    center_rad: f64,
    gear_ratio: f64,
    /// Approximate slope of the reading over the shaft's angle.
    slope: f64,
    half_play_rad: f64,
    shaft_rad: f64,
    element: Element,
    /// Sum of the slips on the shaft, rad.
    jump_rad: f64,
    /// Spots that wore during the run.
    spots: Vec<WornSpot>,
    /// -1 if the sense is reversed about the middle of the joint's range, else 1.
    sense: f64,
    word: Quantizer,
}

/// Sensing element: shaft angle to reading.
#[derive(Clone, Debug)]
enum Element {
    Potentiometer(Box<Potentiometer>),
    Encoder(Encoder),
    Resolver(Resolver),
}

/// Inputs of one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointInput {
    pub angle_rad: f64,
    pub around: OilState,
    /// Time since the last sample, s.
    pub elapsed_s: f64,
}

impl JointSensor {
    pub(crate) fn new(nominal: &JointSensorSpec, built: &JointAsBuilt, spec: &JointSensorsSpec, seed: u64) -> Self {
        let element = match nominal.kind {
            SensorKind::Potentiometer => Element::Potentiometer(Box::new(Potentiometer::new(built, spec, seed))),
            SensorKind::Encoder => Element::Encoder(Encoder::new(built, spec)),
            SensorKind::Resolver => Element::Resolver(Resolver::new(built, spec)),
        };
        Self {
            center_rad: built.center_rad,
            gear_ratio: built.gear_ratio,
            slope: 1.0 + built.gain_error,
            half_play_rad: 0.5 * spec.backlash_rad,
            shaft_rad: built.center_rad,
            element,
            jump_rad: 0.0,
            spots: Vec::new(),
            sense: 1.0,
            word: Quantizer::new(nominal, spec, seed),
        }
    }

    /// Centres backlash and hysteresis at `angle_rad`.
    pub(crate) fn settle(&mut self, angle_rad: f64) {
        self.shaft_rad = angle_rad;
        if let Element::Potentiometer(pot) = &mut self.element {
            pot.settle(angle_rad);
        }
    }

    /// Returns the reading without noise and steps at a settled shaft angle, rad.
    pub(super) fn reading_rad(&self, shaft_rad: f64, around: &OilState) -> f64 {
        let read = match &self.element {
            Element::Potentiometer(pot) => pot.reading_rad(shaft_rad, around),
            Element::Encoder(encoder) => encoder.reading_rad(shaft_rad),
            Element::Resolver(resolver) => resolver.reading_rad(shaft_rad, around),
        };
        self.spots.iter().fold(read + self.jump_rad, |read, spot| read + spot.bump_rad(shaft_rad))
    }

    /// Makes the sensor slip: the reading is `by_rad` larger from now on.
    pub(crate) fn jump(&mut self, by_rad: f64) {
        self.jump_rad += by_rad;
    }

    /// Adds a worn spot to the track.
    pub(crate) fn wear(&mut self, spot: WornSpot) {
        self.spots.push(spot);
    }

    /// Reverses the sense.
    pub(crate) fn reverse(&mut self) {
        self.sense = -self.sense;
    }

    /// Makes the wiper, if there is one, lose contact at this rate from now on.
    pub(crate) fn lose_contact(&mut self, dropout_per_s: f64) {
        if let Element::Potentiometer(pot) = &mut self.element {
            pot.lose_contact(dropout_per_s);
        }
    }

    /// Makes the sensor stick: the last word stays from now on.
    pub(crate) fn stick(&mut self) {
        self.word.stick();
    }

    /// Breaks the wire: from now on the sensor reads an open input, 0 counts and the converter's noise.
    pub(crate) fn die(&mut self) {
        self.word.die();
    }

    /// Returns the shaft angle at which the sensor reads `reading_rad`, by fixed-point iteration: the nonlinearity is
    /// slight.
    pub(crate) fn angle_for_reading(&self, reading_rad: f64, around: &OilState) -> f64 {
        let mut angle = reading_rad;
        for _ in 0..200 {
            angle += (reading_rad - self.reading_rad(angle, around)) / self.slope;
        }
        angle
    }

    /// Takes a sample in raw counts, 0..wrap.
    pub(crate) fn sample(&mut self, input: &JointInput) -> f64 {
        let half_play = self.half_play_rad;
        self.shaft_rad = self.shaft_rad.clamp(input.angle_rad - half_play, input.angle_rad + half_play);
        let (place_rad, is_open) = match &mut self.element {
            Element::Potentiometer(pot) => pot.advance(self.shaft_rad, input.elapsed_s),
            Element::Encoder(_) | Element::Resolver(_) => (self.shaft_rad, false),
        };
        let mut reading_rad = self.reading_rad(place_rad, &input.around);
        if let Element::Encoder(encoder) = &self.element {
            reading_rad = encoder.stepped_rad(reading_rad);
        }
        // Gears between shaft and sensor turn about the middle of the range, where both angles agree.
        let travel_rad = self.sense * self.gear_ratio * (reading_rad - self.center_rad);
        self.word.read((!is_open).then_some(self.center_rad + travel_rad))
    }
}
