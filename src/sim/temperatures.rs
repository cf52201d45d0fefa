//! True temperatures: water over depth and time, and oil that warms and follows the water.
//!
//! Prescribed oil: `start + rise (1 - exp(-t / b)) + change (1 - (a exp(-t / a) - b exp(-t / b)) / (a - b))`. The rise
//! is its own warming with time constant b. The change is the water's (time constant a) with the same lag. Oil that
//! warms with work: `dT/dt = power / capacity - (T - water) / b`, in steps that are exact for constant power and water.

use crate::spec::TemperatureSpec;

/// True temperatures over time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Temperatures {
    spec: TemperatureSpec,
    /// Depth of the vehicle, m.
    depth_m: f64,
    /// Bath of oil that warms with work.
    bath: Option<OilBath>,
}

impl Temperatures {
    pub(crate) fn new(spec: &TemperatureSpec, depth_m: f64) -> Self {
        let bath = OilBath {
            heat_capacity_j_per_k: spec.oil_heat_capacity_j_per_k,
            time_constant_s: spec.oil_time_constant_s,
            oil_c: spec.oil_start_c,
        };
        Self { spec: *spec, depth_m, bath: (spec.oil_heat_capacity_j_per_k > 0.0).then_some(bath) }
    }

    /// Advances to `t_s` at a depth, while the hydraulics lose power to the oil.
    pub(crate) fn advance(&mut self, t_s: f64, elapsed_s: f64, lost_power_w: f64, depth_m: f64) {
        self.depth_m = depth_m;
        let water_c = self.water_c(t_s);
        if let Some(bath) = &mut self.bath {
            bath.advance(elapsed_s, lost_power_w, water_c);
        }
    }

    /// Returns the oil temperature, Celsius; for oil that warms with work, at the last [`Self::advance`].
    pub(crate) fn oil_c(&self, t_s: f64) -> f64 {
        if let Some(bath) = self.bath {
            return bath.oil_c;
        }
        let spec = &self.spec;
        let (water_s, oil_s) = (spec.water_time_constant_s, spec.oil_time_constant_s);
        let (by_water, by_oil) = ((-t_s / water_s).exp(), (-t_s / oil_s).exp());
        // Equal time constants: the limit of the quotient.
        let followed = if (water_s - oil_s).abs() < 1e-6 * oil_s {
            1.0 - by_oil * (1.0 + t_s / oil_s)
        } else {
            1.0 - (water_s * by_water - oil_s * by_oil) / (water_s - oil_s)
        };
        spec.oil_start_c + spec.oil_rise_k * (1.0 - by_oil) + spec.water_change_k * followed
    }

    /// Returns the water temperature at the vehicle's depth, `water + change (1 - exp(-t / a))`, Celsius.
    pub(crate) fn water_c(&self, t_s: f64) -> f64 {
        let spec = &self.spec;
        spec.water_at_c(self.depth_m) + spec.water_change_k * (1.0 - (-t_s / spec.water_time_constant_s).exp())
    }
}

/// Oil that warms with work, cooled by the water.
#[derive(Clone, Copy, Debug)]
struct OilBath {
    heat_capacity_j_per_k: f64,
    time_constant_s: f64,
    oil_c: f64,
}

impl OilBath {
    fn advance(&mut self, elapsed_s: f64, power_w: f64, water_c: f64) {
        let in_the_end_c = water_c + power_w * self.time_constant_s / self.heat_capacity_j_per_k;
        self.oil_c = in_the_end_c + (self.oil_c - in_the_end_c) * (-elapsed_s / self.time_constant_s).exp();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oil_warms_by_six_kelvin_within_ten_minutes() {
        let temperatures = Temperatures::new(&TemperatureSpec::default(), 500.0);
        assert!((temperatures.oil_c(0.0) - 10.0).abs() < 1e-12);
        assert!(temperatures.oil_c(600.0) - temperatures.oil_c(0.0) > 6.0);
    }

    /// 20 L of oil, ten minutes at 500 W and ten at rest, in steps of any length, follow the closed form of a
    /// first-order lag.
    #[test]
    fn oil_that_works_follows_the_closed_form() {
        let spec = TemperatureSpec {
            oil_heat_capacity_j_per_k: 3.3e4,
            oil_time_constant_s: 900.0,
            oil_start_c: 12.0,
            water_c: 5.0,
            ..TemperatureSpec::default()
        };
        let in_the_end = 5.0 + 500.0 * 900.0 / 3.3e4;
        let warm = in_the_end + (12.0 - in_the_end) * (-600.0_f64 / 900.0).exp();
        let cooled = 5.0 + (warm - 5.0) * (-600.0_f64 / 900.0).exp();
        for step_s in [0.01, 1.0, 600.0] {
            let mut temperatures = Temperatures::new(&spec, 500.0);
            let steps = (600.0_f64 / step_s).round() as u32;
            for (power_w, start_s, expected_c) in [(500.0, 0.0, warm), (0.0, 600.0, cooled)] {
                for step in 1..=steps {
                    temperatures.advance(start_s + f64::from(step) * step_s, step_s, power_w, 500.0);
                }
                let oil_c = temperatures.oil_c(0.0);
                assert!((oil_c - expected_c).abs() < 1e-8, "steps of {step_s} s: {oil_c} against {expected_c}");
            }
        }
    }

    /// Without work, a bath in changing water equals the prescribed oil without a rise: one integral in two forms.
    #[test]
    fn an_idle_bath_follows_the_water_as_prescribed_oil_does() {
        let prescribed = TemperatureSpec {
            oil_start_c: 20.0,
            water_c: 20.0,
            oil_rise_k: 0.0,
            water_change_k: -15.0,
            ..TemperatureSpec::default()
        };
        let bath = TemperatureSpec { oil_heat_capacity_j_per_k: 1e4, ..prescribed };
        let closed = Temperatures::new(&prescribed, 0.0);
        let mut stepped = Temperatures::new(&bath, 0.0);
        for second in 1..=3600 {
            let t_s = f64::from(second);
            stepped.advance(t_s, 1.0, 0.0, 0.0);
            let difference = stepped.oil_c(t_s) - closed.oil_c(t_s);
            // The water is held over each second: half a second of its fastest change, 15 K in 1800 s.
            assert!(difference.abs() < 0.5 * 15.0 / 1800.0, "{difference} K after {second} s");
        }
    }

    #[test]
    fn water_and_the_oil_in_it_follow_the_depth() {
        let spec: TemperatureSpec = toml::from_str(
            "profile_depth_m = [0.0, 1000.0]\nprofile_c = [24.0, 4.0]\noil_heat_capacity_j_per_k = 1e4\n\
             oil_start_c = 24.0",
        )
        .expect("valid");
        let mut temperatures = Temperatures::new(&spec, 0.0);
        assert_eq!(temperatures.water_c(0.0), 24.0);
        temperatures.advance(300.0, 300.0, 0.0, 250.0);
        assert!((temperatures.water_c(300.0) - 19.0).abs() < 1e-12);
        assert!((temperatures.oil_c(300.0) - (19.0 + 5.0 * (-1.0_f64).exp())).abs() < 1e-12);
    }
}
