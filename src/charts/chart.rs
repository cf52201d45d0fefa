//! Small line and point charts as SVG text.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::Color as _;

/// Marks or lines that draw a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    Line,
    Dots,
    /// Dashed line, for values that are not measurements.
    Dashes,
    /// Small crosses, for outliers.
    Crosses,
    /// Strokes, each between two consecutive points.
    Strokes,
    /// Area whose outline passes through the points.
    Area,
}

/// Color of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Color {
    Blue,
    Red,
    Green,
    Violet,
    Orange,
    Grey,
    Cyan,
}

impl Color {
    /// All colors, in the order in which series without a color take them.
    pub const ALL: [Self; 7] = [Self::Blue, Self::Red, Self::Green, Self::Violet, Self::Orange, Self::Grey, Self::Cyan];

    /// Returns the color in CSS notation: `#1f77b4`.
    #[must_use]
    pub fn css(self) -> String {
        let RGBColor(red, green, blue) = self.rgb();
        format!("#{red:02x}{green:02x}{blue:02x}")
    }

    fn rgb(self) -> RGBColor {
        COLORS[self as usize]
    }
}

/// Points of one color.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend; a series with an empty name has no entry.
    pub name: String,
    /// Color of the series; `None`: the next one of [`Color::ALL`].
    pub color: Option<Color>,
    pub style: Style,
    pub points: Vec<[f64; 2]>,
}

/// Scale and direction of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    Linear,
    /// Logarithmic axis; points that are not positive are omitted.
    Log,
    /// Axis of whole numbers: only these have labels.
    Whole,
    /// Axis that grows downwards, such as the rows of an image.
    Downward,
}

/// One chart of a row.
#[derive(Clone, Debug)]
pub struct Panel {
    pub title: String,
    pub x: (String, Axis),
    pub y: (String, Axis),
    /// True if both axes have the same scale.
    pub is_map: bool,
    pub series: Vec<Series>,
}

const COLORS: [RGBColor; 7] = [
    RGBColor(0x1f, 0x77, 0xb4),
    RGBColor(0xd6, 0x27, 0x28),
    RGBColor(0x2c, 0xa0, 0x2c),
    RGBColor(0x94, 0x67, 0xbd),
    RGBColor(0xff, 0x7f, 0x0e),
    RGBColor(0x55, 0x55, 0x55),
    RGBColor(0x17, 0xbe, 0xcf),
];
/// Width and height of one panel, px.
const PANEL: (u32, u32) = (480, 360);

/// Draws panels side by side.
///
/// # Errors
/// The message of the drawing library.
pub fn svg(panels: &[Panel]) -> Result<String, String> {
    let mut text = String::new();
    {
        let size = (PANEL.0 * panels.len().max(1) as u32, PANEL.1);
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE).map_err(|error| error.to_string())?;
        for (area, panel) in root.split_evenly((1, panels.len().max(1))).iter().zip(panels) {
            draw(area, panel).map_err(|error| error.to_string())?;
        }
        root.present().map_err(|error| error.to_string())?;
    }
    Ok(text)
}

/// Draws one panel of `size_px` without a background. Black and white become the page's colors if its style sets `fill`
/// and `stroke`.
///
/// # Errors
/// The message of the drawing library.
pub fn inlay(panel: &Panel, size_px: (u32, u32)) -> Result<String, String> {
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, size_px).into_drawing_area();
        draw(&root, panel).map_err(|error| error.to_string())?;
        root.present().map_err(|error| error.to_string())?;
    }
    Ok(text)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type DrawError = Box<dyn std::error::Error + Send + Sync>;

fn draw(area: &Area<'_>, panel: &Panel) -> Result<(), DrawError> {
    let shown: Vec<Series> = panel.series.iter().map(|series| upright(panel, positive(panel, series))).collect();
    let (x, y) = ranges(panel, &shown, area.dim_in_pixel());
    let legend = free_corner(&shown, x, y);
    let mut builder = ChartBuilder::on(area);
    if !panel.title.is_empty() {
        builder.caption(&panel.title, ("sans-serif", 15));
    }
    builder.margin(8).x_label_area_size(36).y_label_area_size(56);
    // One type of chart for each pair of axes.
    macro_rules! chart {
        ($x:expr, $y:expr) => {{
            let mut chart = builder.build_cartesian_2d($x, $y).map_err(boxed)?;
            let mut mesh = chart.configure_mesh();
            mesh.x_desc(&panel.x.0).y_desc(&panel.y.0).max_light_lines(0);
            mesh.x_labels(most_labels(panel.x.1, x)).y_labels(most_labels(panel.y.1, y));
            let labels = [panel.x.1, panel.y.1].map(|axis| move |value: &f64| label(axis, *value));
            mesh.x_label_formatter(&labels[0]).y_label_formatter(&labels[1]).draw().map_err(boxed)?;
            for (series, color) in shown.iter().zip(Color::ALL.iter().cycle()) {
                let color = series.color.unwrap_or(*color).rgb();
                let mut points = series.points.iter().map(|p| (p[0], p[1]));
                let drawn = match series.style {
                    Style::Dots => chart.draw_series(points.map(|p| Circle::new(p, 2, color.filled()))),
                    Style::Crosses => chart.draw_series(points.map(|p| Cross::new(p, 4, color.stroke_width(2)))),
                    Style::Line => chart.draw_series(LineSeries::new(points, color.stroke_width(2))),
                    Style::Dashes => chart.draw_series(DashedLineSeries::new(points, 6, 4, color.stroke_width(2))),
                    Style::Strokes => chart.draw_series(std::iter::from_fn(|| {
                        let ends = vec![points.next()?, points.next()?];
                        Some(PathElement::new(ends, color.stroke_width(1)))
                    })),
                    Style::Area => {
                        let around: Vec<(f64, f64)> = points.collect();
                        chart.draw_series(std::iter::once(Polygon::new(around, color.mix(0.2).filled())))
                    }
                };
                let drawn = drawn.map_err(boxed)?;
                if !series.name.is_empty() {
                    drawn
                        .label(&series.name)
                        .legend(move |(x, y)| Rectangle::new([(x, y - 3), (x + 12, y + 3)], color.filled()));
                }
            }
            if shown.iter().all(|series| series.name.is_empty()) {
                return Ok(());
            }
            let mut labels = chart.configure_series_labels();
            labels.position(legend).background_style(WHITE.mix(0.8)).label_font(("sans-serif", 11));
            labels.draw().map_err(boxed)?;
        }};
    }
    match (is_log(panel.x.1, x), is_log(panel.y.1, y)) {
        (false, false) => chart!(x.0..x.1, y.0..y.1),
        (true, false) => chart!((x.0..x.1).log_scale(), y.0..y.1),
        (false, true) => chart!(x.0..x.1, (y.0..y.1).log_scale()),
        (true, true) => chart!((x.0..x.1).log_scale(), (y.0..y.1).log_scale()),
    }
    Ok(())
}

/// Returns true if the axis is drawn with a logarithmic scale. Such a scale has labels at decades only, so a range of
/// much less than two decades is drawn linearly.
fn is_log(axis: Axis, (low, high): Range) -> bool {
    axis == Axis::Log && high >= 50.0 * low
}

/// Returns the largest number of labels of an axis; an axis of whole numbers has at most one per whole number.
fn most_labels(axis: Axis, (low, high): Range) -> usize {
    const MOST: usize = 8;
    if axis == Axis::Whole { ((high.floor() - low.ceil()) as usize + 1).min(MOST) } else { MOST }
}

fn label(axis: Axis, value: f64) -> String {
    match axis {
        Axis::Downward => number(-value),
        _ => number(value),
    }
}

/// Returns the corner of the panel with the fewest points near it.
fn free_corner(series: &[Series], x: Range, y: Range) -> SeriesLabelPosition {
    let share = |value: f64, (low, high): Range| (value - low) / (high - low);
    let n_in = |is_right: bool, is_upper: bool| {
        let is_in = |p: &&[f64; 2]| {
            let (x, y) = (share(p[0], x), share(p[1], y));
            (if is_right { 1.0 - x } else { x }) < 0.3 && (if is_upper { 1.0 - y } else { y }) < 0.4
        };
        series.iter().flat_map(|series| &series.points).filter(is_in).count()
    };
    let corners = [
        (n_in(false, true), SeriesLabelPosition::UpperLeft),
        (n_in(true, true), SeriesLabelPosition::UpperRight),
        (n_in(true, false), SeriesLabelPosition::LowerRight),
        (n_in(false, false), SeriesLabelPosition::LowerLeft),
    ];
    corners.into_iter().min_by_key(|(n, _)| *n).map_or(SeriesLabelPosition::UpperLeft, |(_, corner)| corner)
}

fn boxed<E: std::error::Error + Send + Sync>(error: DrawingAreaErrorKind<E>) -> DrawError {
    error.to_string().into()
}

/// Returns a short label of a value: 0.001, 1e-7, 250.
fn number(value: f64) -> String {
    let size = value.abs();
    // A rounding error of a subtraction is zero.
    if size > 1e-12 && !(1e-3..1e5).contains(&size) {
        format!("{value:.0e}")
    } else {
        // Avoids -0.
        format!("{}", (value * 1e6).round() / 1e6 + 0.0)
    }
}

/// Mirrors the points about zero on axes that grow downwards.
fn upright(panel: &Panel, mut series: Series) -> Series {
    let turned = [panel.x.1, panel.y.1].map(|axis| if axis == Axis::Downward { -1.0 } else { 1.0 });
    series.points.iter_mut().for_each(|p| *p = [p[0] * turned[0], p[1] * turned[1]]);
    series
}

fn positive(panel: &Panel, series: &Series) -> Series {
    let axes = [panel.x.1, panel.y.1];
    let is_shown = |p: &&[f64; 2]| {
        p.iter().zip(axes).all(|(value, axis)| value.is_finite() && (axis != Axis::Log || *value > 0.0))
    };
    Series { points: series.points.iter().filter(is_shown).copied().collect(), ..series.clone() }
}

type Range = (f64, f64);

/// Returns the ranges of both axes, which enclose all points.
fn ranges(panel: &Panel, series: &[Series], size_px: (u32, u32)) -> (Range, Range) {
    let of = |axis: usize| {
        let values = series.iter().flat_map(|series| &series.points).map(|p| p[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let (x, y) = (of(0), of(1));
    if !panel.is_map {
        return (widened(x, panel.x.1), widened(y, panel.y.1));
    }
    // Labels and margins take 72 px of each side of the panel.
    let aspect = f64::from(size_px.0.max(73) - 72) / f64::from(size_px.1.max(73) - 72);
    let half = (0.5 * (x.1 - x.0)).max(0.5 * (y.1 - y.0) * aspect) * 1.05 + 1e-9;
    let around = |(low, high): Range, half: f64| (0.5 * (low + high) - half, 0.5 * (low + high) + half);
    (around(x, half), around(y, half / aspect))
}

fn widened((low, high): Range, axis: Axis) -> Range {
    match axis {
        _ if low > high => (1.0, 2.0),
        Axis::Log => (low / 1.2, high * 1.2),
        Axis::Whole => (low - 0.5, high + 0.5),
        Axis::Linear | Axis::Downward => {
            let margin = (0.03 * (high - low)).max(1e-9);
            (low - margin, high + margin)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_legend_goes_where_there_are_no_points() {
        let falling: Vec<[f64; 2]> = (0..20).map(|k| [f64::from(k), 20.0 - f64::from(k)]).collect();
        let rising: Vec<[f64; 2]> = falling.iter().map(|p| [p[0], 20.0 - p[1]]).collect();
        let corner = |points: &Vec<[f64; 2]>| {
            let line = Series { name: "line".to_owned(), color: None, style: Style::Line, points: points.clone() };
            free_corner(&[line], (0.0, 20.0), (0.0, 20.0))
        };
        assert!(matches!(corner(&falling), SeriesLabelPosition::UpperRight));
        assert!(matches!(corner(&rising), SeriesLabelPosition::UpperLeft));
    }

    /// Returns the labels of the chart that are numbers.
    fn numbers(svg: &str) -> Vec<f64> {
        let texts = svg.split("<text").skip(1).filter_map(|rest| rest.split_once('>')?.1.split_once("</text>"));
        texts.filter_map(|(text, _)| text.trim().parse().ok()).collect()
    }

    #[test]
    fn whole_numbers_and_rows_of_an_image_have_their_labels() {
        let of = |x: Axis, y: Axis, points: Vec<[f64; 2]>| {
            let series = vec![Series { name: String::new(), color: None, style: Style::Dots, points }];
            let (x, y) = (("x".to_owned(), x), ("y".to_owned(), y));
            inlay(&Panel { title: String::new(), x, y, is_map: false, series }, (440, 250)).expect("a chart")
        };
        for n in [1, 2, 3, 5, 14] {
            let points = (1..=n).map(|k| [f64::from(k), 1.0e6]).collect();
            let found: Vec<f64> =
                numbers(&of(Axis::Whole, Axis::Log, points)).into_iter().filter(|v| *v < 100.0).collect();
            assert!(!found.is_empty() && found.iter().all(|v| v.fract() == 0.0), "{n}: {found:?}");
            assert!(n == 14 || found.len() == n as usize, "{n}: {found:?}");
        }
        let image = of(Axis::Linear, Axis::Downward, vec![[0.0, 100.0], [1.0, 900.0]]);
        let rows: Vec<f64> = numbers(&image).into_iter().filter(|v| v.abs() > 1.5).collect();
        assert!(rows.len() > 2 && rows.iter().all(|row| *row > 0.0), "{rows:?}");
    }

    #[test]
    fn charts_hold_their_series_and_leave_out_what_an_axis_cannot_show() {
        let line = Series {
            name: "a line".to_owned(),
            color: None,
            style: Style::Line,
            points: vec![[1.0, 2.0], [2.0, -1.0], [3.0, 4.0]],
        };
        for (axis, shown) in [(Axis::Linear, 3), (Axis::Log, 2)] {
            let label = |axis| ("m".to_owned(), axis);
            let panel = Panel {
                title: "Title".to_owned(),
                x: label(Axis::Linear),
                y: label(axis),
                is_map: false,
                series: vec![line.clone()],
            };
            assert_eq!(positive(&panel, &line).points.len(), shown);
            let text = svg(&[panel.clone(), panel]).expect("a chart");
            assert!(text.starts_with("<svg") && text.contains("a line") && text.contains("Title"), "{text}");
        }
    }
}
