//! Small charts as SVG text, drawn by plotters; knows nothing of arms.
//!
//! `Panel` is one chart with its series; `svg` draws panels side by side on white, `inlay` one for a page that has
//! colors of its own.

mod chart;

pub use chart::{Axis, Color, Panel, Series, Style, inlay, svg};
