//! Charts of a report: inlays that take the page's colors.

use armcal_charts::{Axis, Color, Panel, Series, Style, inlay};
use maud::{Markup, PreEscaped, html as markup};

/// Size of a chart before the page scales it, px.
const SIZE_PX: (u32, u32) = (440, 250);
/// Size of a chart with equal units on both axes, px.
const MAP_PX: (u32, u32) = (440, 330);

const NAME_SPACE: &str = " xmlns=\"http://www.w3.org/2000/svg\"";

/// A series with its color.
pub fn series(name: &str, color: Color, style: Style, points: Vec<[f64; 2]>) -> Series {
    Series { name: name.to_owned(), color: Some(color), style, points }
}

/// Chart panel with linear axes.
pub fn panel(title: &str, x: &str, y: &str, series: Vec<Series>) -> Panel {
    Panel {
        title: title.to_owned(),
        x: (x.to_owned(), Axis::Linear),
        y: (y.to_owned(), Axis::Linear),
        is_map: false,
        series,
    }
}

/// The chart under its caption; a message replaces a chart that cannot be drawn.
pub fn figure(panel: &Panel, caption: &str) -> Markup {
    let size_px = if panel.is_map { MAP_PX } else { SIZE_PX };
    // The legend stands below the chart, where it hides nothing.
    let unnamed = |series: &Series| Series { name: String::new(), ..series.clone() };
    let bare = Panel { series: panel.series.iter().map(unnamed).collect(), ..panel.clone() };
    let drawn = inlay(&bare, size_px);
    let colors =
        panel.series.iter().zip(Color::ALL.iter().cycle()).map(|(one, color)| (one, one.color.unwrap_or(*color)));
    let named: Vec<(&Series, Color)> = colors.filter(|(series, _)| !series.name.is_empty()).collect();
    let label = if panel.title.is_empty() { caption } else { &panel.title };
    markup! {
        figure {
            @match drawn {
                // SVG within a page needs no name space, and the page shall hold no address.
                Ok(svg) => div role="img" aria-label=(label) { (PreEscaped(svg.replace(NAME_SPACE, ""))) },
                Err(why) => p { "This chart cannot be drawn: " (why) },
            }
            @if !caption.is_empty() || !named.is_empty() {
                figcaption {
                    @for (series, color) in &named {
                        span.key {
                            svg.swatch viewBox="0 0 10 10" aria-hidden="true" {
                                rect width="10" height="10" rx="2" fill=(color.css()) { }
                            }
                            (series.name)
                        }
                        " "
                    }
                    (caption)
                }
            }
        }
    }
}
