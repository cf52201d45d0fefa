//! A tag map for people: its table on the terminal, and a page with the same table and drawings of the tags.

use armcal_charts::{Color, Panel, Style};
use armcal_core::codes::Warning;
use maud::{Markup, html as markup};

use crate::report::html::{chart, page, panel, series};
use armcal_belief::tagmap::{GroupFrame, MapGroup, MappedTag, TagMap};
use armcal_core::optics::square_corners;
use armcal_core::text::counted;

/// Columns of [`tag_rows`].
pub const TAG_COLUMNS: [&str; 11] =
    ["tag", "size mm", "x m", "y m", "z m", "std x mm", "std y mm", "std z mm", "std rot deg", "views", "rms px"];

/// Contents of the page in addition to the map itself.
#[derive(Clone, Copy, Debug)]
pub struct TagMapPage<'a> {
    pub map: &'a TagMap,
    /// Name of the recording.
    pub file: &'a str,
    /// Topics that were read, with their cameras.
    pub sources: &'a [String],
    /// Faults of data and map, a sentence each.
    pub warnings: &'a [Warning],
    /// True if the map can be used as it is.
    pub is_sound: bool,
}

/// The tags of the `idx`-th group, by id.
fn tags_of(map: &TagMap, idx: usize) -> impl Iterator<Item = &MappedTag> {
    map.tags.iter().filter(move |tag| tag.group == idx)
}

/// Table rows of a group, one row per tag.
#[must_use]
pub fn tag_rows(map: &TagMap, group: usize) -> Vec<[String; TAG_COLUMNS.len()]> {
    let row = |tag: &MappedTag| {
        let [x, y, z] = tag.frame_from_tag.translation.vector.into();
        let [std_x, std_y, std_z] = tag.position_std_m().map(|std| format!("{:.3}", std * 1e3));
        let turn = tag.rotation_std_rad().into_iter().fold(0.0, f64::max).to_degrees();
        [
            if tag.is_fixed { format!("{} (held)", tag.id) } else { tag.id.to_string() },
            format!("{:.1}", tag.size_m * 1e3),
            format!("{x:.5}"),
            format!("{y:.5}"),
            format!("{z:.5}"),
            std_x,
            std_y,
            std_z,
            format!("{turn:.3}"),
            tag.n_views.to_string(),
            format!("{:.4}", tag.rms_px),
        ]
    };
    tags_of(map, group).map(row).collect()
}

/// Frame of a group's tags, their number, and the number of their observations.
#[must_use]
pub fn group_title(group: &MapGroup) -> String {
    let frame = match &group.frame {
        GroupFrame::Body(name) => format!("frame of `{name}`"),
        GroupFrame::Tag(id) => format!("frame of tag {id}: nothing ties these tags to the others"),
    };
    format!("{frame}; {}, {}", counted(group.tags.len(), "tag"), counted(group.n_views, "view"))
}

/// Detections, reprojection, noise and what was rejected: name and text of each line.
#[must_use]
pub fn fit_lines(map: &TagMap, sources: &[String]) -> [(&'static str, String); 4] {
    let rejected: Vec<String> =
        map.rejected_by_reason().iter().map(|(reason, n)| format!("{} {n}", reason.name())).collect();
    [
        ("detections", format!("{} of {} used; {}", map.n_used, map.n_detections, sources.join(", "))),
        (
            "reprojection",
            format!(
                "rms {:.4} px, median {:.4} px; with rejected ones rms {:.4} px",
                map.rms_px, map.median_px, map.rms_all_px
            ),
        ),
        (
            "noise",
            format!(
                "chi-square {:.0} of {} degrees of freedom, corners' standard deviation times {:.3}",
                map.chi_square, map.degrees_of_freedom, map.noise_scale
            ),
        ),
        ("rejected", if rejected.is_empty() { "none".to_owned() } else { rejected.join(", ") }),
    ]
}

/// The page: one file that needs no network.
#[must_use]
pub fn tag_map_html(given: &TagMapPage<'_>) -> String {
    let map = given.map;
    let body = markup! {
        (verdict(given))
        @for (idx, group) in map.groups.iter().enumerate() {
            h2 { (group_title(group)) }
            div.figures {
                (seen_along(map, idx, "From above", ["x", "y"], [0, 1]))
                (seen_along(map, idx, "From the side", ["x", "z"], [0, 2]))
                (deviations(map, idx))
            }
            div.wide {
                table {
                    tr { @for name in TAG_COLUMNS { th { (name) } } }
                    @for row in tag_rows(map, idx) { tr { @for cell in row { td { (cell) } } } }
                }
            }
        }
        h2 { "Fit" }
        table.notes { @for (name, text) in fit_lines(map, given.sources) { tr { th { (name) } td { (text) } } } }
        p { small {
            "Standard deviations are along the axes of the frame, relative to what holds it; a tag that is held has \
             none. \
             x, y, z are the middle of the black square."
        } }
    };
    page(&format!("Tag map of {}", given.file), &body)
}

fn verdict(given: &TagMapPage<'_>) -> Markup {
    let (map, n_warnings) = (given.map, given.warnings.len());
    let (class, word) = match (given.is_sound, n_warnings) {
        (true, 0) => ("green", "The map can be used."),
        (true, _) => ("amber", "The map can be used; look at the warnings first."),
        (false, _) => ("red", "Do not use the map before its warnings are dealt with."),
    };
    let worst = map.tags.iter().flat_map(MappedTag::position_std_m).fold(0.0, f64::max);
    markup! {
        div class={ "verdict " (class) } {
            strong { (word) }
            p {
                (counted(map.tags.len(), "tag")) " in " (counted(map.groups.len(), "frame")) ", each known to "
                (format!("{:.2} mm", 1e3 * worst)) " or better along any axis; corners off by "
                (format!("{:.3} px", map.rms_px)) " rms."
            }
        }
        @if n_warnings > 0 { ul { @for warning in given.warnings { li { (warning.to_string()) } } } }
    }
}

/// The outlines of a group's tags, seen along an axis of its frame.
fn seen_along(map: &TagMap, group: usize, title: &str, names: [&str; 2], axes: [usize; 2]) -> Markup {
    let mut strokes = Vec::new();
    for tag in tags_of(map, group) {
        let corners = square_corners(tag.size_m).map(|corner| {
            let at = tag.frame_from_tag * corner;
            axes.map(|axis| at[axis])
        });
        strokes.extend((0..4).flat_map(|k| [corners[k], corners[(k + 1) % 4]]));
    }
    let [x, y] = names.map(|name| format!("{name}, m"));
    let shown = vec![series("", Color::Blue, Style::Strokes, strokes)];
    chart(&Panel { is_map: true, ..panel(title, &x, &y, shown) }, "")
}

/// Chart of the largest standard deviation of each tag's position.
fn deviations(map: &TagMap, group: usize) -> Markup {
    let point = |tag: &MappedTag| [f64::from(tag.id), 1e3 * tag.position_std_m().into_iter().fold(0.0, f64::max)];
    let shown = vec![series("", Color::Blue, Style::Dots, tags_of(map, group).map(point).collect())];
    chart(&panel("How well each tag is known", "tag", "std along the worst axis, mm", shown), "")
}
