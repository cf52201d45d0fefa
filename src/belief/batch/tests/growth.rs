//! Cost of additional views.

use crate::batch::tests::data::titan;
use crate::batch::tests::statistics::{case, input};
use crate::solve::estimate::estimate;
use crate::solve::input::HyperparameterMode;

/// Memory of the whole estimate is linear in the number of views; its number of steps hardly grows.
#[test]
fn memory_grows_with_the_views_and_the_steps_do_not() {
    let robot = titan();
    let cost = |n_views: usize| {
        let case = case(&robot, 1, n_views);
        let mut steps = 0;
        let counted = allocation_counter::measure(|| {
            let input = input(&case, &case.views, HyperparameterMode::Fitted);
            steps = estimate(&input).expect("the views determine the arm").iterations;
        });
        (counted.bytes_max as f64, steps)
    };
    let (few, many) = (cost(100), cost(400));
    println!("{:.0} and {:.0} kB, {} and {} steps", few.0 / 1e3, many.0 / 1e3, few.1, many.1);
    assert!((3.0..4.2).contains(&(many.0 / few.0)), "{}", many.0 / few.0);
    assert!(many.1 < 2 * few.1, "{} and {}", many.1, few.1);
}
