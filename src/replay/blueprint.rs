//! Layout of the viewer, written entry by entry: the SDK's builder cannot set the viewpoint, the axes or the legends,
//! and gives its parts random names.

use std::collections::BTreeSet;

use crate::rerun::AsComponents;
use re_sdk_types::blueprint::archetypes::{
    Background, ContainerBlueprint, EyeControls3D, LineGrid3D, PanelBlueprint, PlotLegend, ScalarAxis, TextLogColumns,
    TimeAxis, TimePanelBlueprint, ViewBlueprint, ViewContents, ViewportBlueprint, VisualBounds2D,
};
use re_sdk_types::blueprint::components::{
    BackgroundKind, ContainerKind, Corner2D, PanelState, PlayState, RootContainer,
};
use re_sdk_types::blueprint::datatypes::{TextLogColumn, TextLogColumnKind};
use re_sdk_types::datatypes::{Range1D, Range2D, TimeInt, TimeRange, TimeRangeBoundary};
use re_sdk_types::external::uuid::Uuid;

use crate::axis::labelled_range;
use crate::colors;
use crate::entities::{
    ARM_FAULT_LANE, CAMERA, CLEARANCE, COUNTS, EVENTS_LANE, JOINT_ANGLE, JOINT_ERROR, LOG, OFFSET_CHANGE, PHASE_LANE,
    PREDICTED, SEA_FAULT_LANE, SIGHTING, SUMMARY, TAG_FAULT_LANE, TARGETS_LANE, TEMPERATURE, TOOL_ERROR, VIEWS_LANE,
    WORLD,
};
use crate::entity_log::TIMELINE;
use crate::plots;
use crate::scene::{ReplayScene, RunState};
use crate::viewpoint;

/// One entity of the layout.
pub(super) struct Entry {
    pub path: String,
    pub what: Box<dyn AsComponents>,
}

/// Longest duration of the playback, s: longer recordings play faster.
const WATCHED_S: f64 = 120.0;
/// Ranges of the plots of small errors, next to those of all errors: joint errors up to this, deg, and tool errors up
/// to this share of the task's tolerance.
const CLOSE_DEG: f64 = 0.3;
const CLOSE_SHARE: f64 = 0.25;
/// Duration that the plots of a run in progress show, s.
const LATEST_S: f64 = 60.0;

/// View or container that was written: its path, for the container around it.
struct Part(String);

#[derive(Default)]
struct Builder {
    entries: Vec<Entry>,
    parts: u128,
}

/// Returns the layout for the data of `run`.
pub(super) fn build(run: &ReplayScene) -> Vec<Entry> {
    let mut b = Builder::default();
    let scene = scene_view(&mut b, run);
    let camera = camera_view(&mut b, run);
    let texts = text_tabs(&mut b, run);
    let below = b.container(ContainerKind::Horizontal, &[(camera, 5.0), (texts, 6.0)]);
    let left = b.container(ContainerKind::Vertical, &[(scene, 5.0), (below, 4.0)]);
    let right = right_column(&mut b, run);
    let main = b.container(ContainerKind::Horizontal, &[(left, 3.0), (right, 2.0)]);
    let root = if run.tracks.marks.is_empty() && run.state == RunState::Over {
        main
    } else {
        let phases = b.lanes("Phases of the run");
        // Each of these views has one more lane.
        let lanes: BTreeSet<&str> =
            run.truth.iter().flat_map(|truth| &truth.faults).map(|fault| fault.of.lane()).collect();
        let share = 1.0 + 0.3 * (usize::from(run.online.is_some()) + lanes.len()) as f32;
        b.container(ContainerKind::Vertical, &[(main, 4.3), (phases, share)])
    };
    b.finish(&root, run)
}

/// Returns the layout of a plan.
pub(super) fn build_plan(run: &ReplayScene) -> Vec<Entry> {
    let mut b = Builder::default();
    let scene = titled_scene(&mut b, run, "Plan: solid = estimated arm, amber = arms within the error bounds");
    let camera = titled_camera(&mut b, run, "Wrist camera: predicted tags");
    let summary = b.view("TextDocument", "Plan", SUMMARY);
    let log = b.view("TextLog", "Poses", LOG);
    let columns = [TextLogColumn { kind: TextLogColumnKind::Body, visible: true.into() }];
    b.property(&log, "TextLogColumns", TextLogColumns::new().with_text_log_columns(columns));
    let texts = b.tabs(&[log, summary]);
    let below = b.container(ContainerKind::Horizontal, &[(camera, 5.0), (texts, 6.0)]);
    let left = b.container(ContainerKind::Vertical, &[(scene, 5.0), (below, 4.0)]);
    let clearance = b.plot("Clearance [mm]", CLEARANCE, legend(Corner2D::RightTop), run);
    let predicted = b.plot("Predicted tool error [mm]", PREDICTED, legend(Corner2D::RightTop), run);
    let angles = b.plot("Estimated joint angles [deg]", JOINT_ANGLE, legend(Corner2D::RightTop), run);
    let right = b.container(ContainerKind::Vertical, &[(clearance, 3.0), (predicted, 2.4), (angles, 2.2)]);
    let main = b.container(ContainerKind::Horizontal, &[(left, 3.0), (right, 2.0)]);
    let phases = b.lanes("Phases of the plan");
    let root = b.container(ContainerKind::Vertical, &[(main, 4.3), (phases, 1.0)]);
    b.finish(&root, run)
}

/// Returns the layout of a real arm's views.
pub(super) fn build_views(run: &ReplayScene) -> Vec<Entry> {
    let mut b = Builder::default();
    let scene = titled_scene(&mut b, run, "Scene: calibrated arm; yellow = measured tags");
    let summary = b.view("TextDocument", "Summary", SUMMARY);
    let left = b.container(ContainerKind::Vertical, &[(scene, 5.0), (summary, 4.0)]);
    let title = "Tag position in each view from the mean over views [mm]";
    let sightings = b.plot(title, SIGHTING, legend(Corner2D::RightTop), run);
    let angles = b.plot(joints_title(run), JOINT_ANGLE, legend(Corner2D::RightTop), run);
    let right = b.container(ContainerKind::Vertical, &[(sightings, 3.0), (angles, 2.2)]);
    let root = b.container(ContainerKind::Horizontal, &[(left, 3.0), (right, 2.0)]);
    b.finish(&root, run)
}

fn scene_view(b: &mut Builder, run: &ReplayScene) -> Part {
    let title =
        if run.has_true_joints() { "Scene: solid arm = true, pink ghost = estimated" } else { "Scene: estimated arm" };
    titled_scene(b, run, title)
}

fn titled_scene(b: &mut Builder, run: &ReplayScene, title: &str) -> Part {
    let view = b.view("3D", title, WORLD);
    let viewpoint = viewpoint::frame(run);
    b.property(
        &view,
        "EyeControls3D",
        EyeControls3D::new().with_position(viewpoint.position).with_look_target(viewpoint.target),
    );
    let water = Background::new(BackgroundKind::SolidColor).with_color(colors::WATER);
    b.property(&view, "Background", water);
    b.property(&view, "LineGrid3D", LineGrid3D::new().with_visible(false));
    view
}

fn camera_view(b: &mut Builder, run: &ReplayScene) -> Part {
    let title = if run.tracks.rejects.is_empty() {
        "Wrist camera: green = measured tags, pink = predicted"
    } else {
        "Tags: green measured, orange rejected, pink predicted"
    };
    titled_camera(b, run, title)
}

fn titled_camera(b: &mut Builder, run: &ReplayScene, title: &str) -> Part {
    let view = b.view("2D", title, CAMERA);
    let [width, height] = run.robot.camera.lens.resolution_px().map(f64::from);
    let bounds = VisualBounds2D::new(Range2D { x_range: [0.0, width].into(), y_range: [0.0, height].into() });
    b.property(&view, "VisualBounds2D", bounds);
    let dark = Background::new(BackgroundKind::SolidColor).with_color([4, 5, 6, 255]);
    b.property(&view, "Background", dark);
    view
}

fn right_column(b: &mut Builder, run: &ReplayScene) -> Part {
    let mut rows = Vec::new();
    if run.has_true_joints() {
        let errors_deg = plots::joint_errors_deg(run).into_iter().flat_map(|(_, errors_deg)| errors_deg);
        let all = b.plot("Joint error: estimated - true [deg]", JOINT_ERROR, legend(Corner2D::RightTop), run);
        b.show_within(&all, labelled_range(errors_deg), run);
        let range = [-CLOSE_DEG, CLOSE_DEG];
        let close = b.plot_within(&format!("within {CLOSE_DEG} deg"), JOINT_ERROR, range, run);
        rows.push((b.tabs(&[all, close]), 3.0));
    }
    let title = if run.has_true_joints() {
        "Joint angles [deg]: bright estimated, dark true"
    } else {
        "Estimated joint angles [deg]"
    };
    // The legend of the errors explains the colours, if errors are shown.
    let colors_here = legend(Corner2D::RightTop).with_visible(!run.has_true_joints());
    rows.push((b.plot(title, JOINT_ANGLE, colors_here, run), 2.2));
    if run.has_true_tool() {
        let all = b.plot("Tool error [mm]", TOOL_ERROR, legend(Corner2D::RightTop), run);
        let mut errors_mm: Vec<f64> = plots::tool_errors_mm(run).into_iter().filter_map(|(_, mm)| mm).collect();
        errors_mm.extend(run.arrivals().iter().map(|arrival| 1e3 * arrival.miss_m));
        errors_mm.extend(run.tracks.task.iter().map(|(_, task)| 1e3 * task.tolerance_m).chain([0.0]));
        b.show_within(&all, labelled_range(errors_mm.into_iter()), run);
        let mut shown = vec![all];
        if let Some((_, task)) = run.tracks.task {
            let top_mm = (1e3 * CLOSE_SHARE * task.tolerance_m).max(1.0).round();
            shown.push(b.plot_within(&format!("up to {top_mm} mm"), TOOL_ERROR, [0.0, top_mm], run));
        }
        rows.push((b.tabs(&shown), 2.4));
    }
    if run.online.is_some() {
        let title = "Offset change since the first estimate [deg]: bright estimate, dark one sigma";
        rows.push((b.plot(title, OFFSET_CHANGE, legend(Corner2D::LeftTop).with_visible(false), run), 2.4));
    }
    if !run.tracks.oil_c.is_empty() || !run.tracks.water_c.is_empty() {
        let temperature = b.plot("Temperature [C]", TEMPERATURE, legend(Corner2D::LeftTop), run);
        b.show_within(&temperature, labelled_range(plots::temperatures_c(run).into_iter()), run);
        rows.push((temperature, 1.5));
    }
    b.container(ContainerKind::Vertical, &rows)
}

fn legend(corner: Corner2D) -> PlotLegend {
    PlotLegend::new().with_corner(corner)
}

fn text_tabs(b: &mut Builder, run: &ReplayScene) -> Part {
    let summary = b.view("TextDocument", "Summary", SUMMARY);
    let log = b.view("TextLog", "Log", LOG);
    let kinds = [TextLogColumnKind::LogLevel, TextLogColumnKind::Body];
    let columns = kinds.map(|kind| TextLogColumn { kind, visible: true.into() });
    b.property(&log, "TextLogColumns", TextLogColumns::new().with_text_log_columns(columns));
    let counts = b.plot("Raw counts", COUNTS, legend(Corner2D::LeftTop), run);
    b.tabs(&[summary, log, counts])
}

impl Builder {
    fn next_id(&mut self) -> Uuid {
        self.parts += 1;
        Uuid::from_u128(0x6172_6d63_616c_0000_0000_0000_0000_0000 + self.parts)
    }

    fn add(&mut self, path: String, what: impl AsComponents + 'static) {
        self.entries.push(Entry { path, what: Box::new(what) });
    }

    /// Adds a view of all entities under `origin`.
    fn view(&mut self, class: &str, title: &str, origin: &str) -> Part {
        let path = format!("view/{}", self.next_id());
        self.add(format!("{path}/ViewContents"), ViewContents::new(["$origin/**"]));
        let view = ViewBlueprint::new(class).with_display_name(title).with_space_origin(origin);
        self.add(path.clone(), view);
        Part(path)
    }

    /// Adds the lanes of states that have data.
    fn lanes(&mut self, title: &str) -> Part {
        let path = format!("view/{}", self.next_id());
        let faults = [ARM_FAULT_LANE, TAG_FAULT_LANE, SEA_FAULT_LANE];
        let lanes = [EVENTS_LANE, faults[0], faults[1], faults[2], PHASE_LANE, TARGETS_LANE, VIEWS_LANE];
        self.add(format!("{path}/ViewContents"), ViewContents::new(lanes));
        self.add(path.clone(), ViewBlueprint::new("StateTimeline").with_display_name(title).with_space_origin("/"));
        Part(path)
    }

    /// Adds a plot over the whole recording, or over the latest part of a run in progress. By default the viewer shows
    /// only the neighbourhood of the time cursor.
    fn plot(&mut self, title: &str, origin: &str, legend: PlotLegend, run: &ReplayScene) -> Part {
        let view = self.view("TimeSeries", title, origin);
        self.property(&view, "PlotLegend", legend);
        let at = |time_s: f64| TimeInt((time_s * 1e9) as i64);
        let [start, end] = match run.state {
            RunState::Over => [0.0, run.tracks.duration_s].map(|time_s| TimeRangeBoundary::Absolute(at(time_s))),
            RunState::GoesOn => [-LATEST_S, 0.0].map(|time_s| TimeRangeBoundary::CursorRelative(at(time_s))),
        };
        self.property(&view, "TimeAxis", TimeAxis::new().with_view_range(TimeRange { start, end }));
        view
    }

    /// Adds a plot with a fixed range of values, for errors that are small against those before calibration.
    fn plot_within(&mut self, title: &str, origin: &str, range: [f64; 2], run: &ReplayScene) -> Part {
        let view = self.plot(title, origin, legend(Corner2D::RightTop), run);
        self.property(&view, "ScalarAxis", ScalarAxis::new().with_range(Range1D(range)));
        view
    }

    /// Sets a plot's range of values, unless the run is in progress: then the range follows the data.
    fn show_within(&mut self, plot: &Part, range: Option<[f64; 2]>, run: &ReplayScene) {
        if let Some(range) = range.filter(|_| run.state == RunState::Over) {
            self.property(plot, "ScalarAxis", ScalarAxis::new().with_range(Range1D(range)));
        }
    }

    fn property(&mut self, view: &Part, name: &str, what: impl AsComponents + 'static) {
        self.add(format!("{}/{name}", view.0), what);
    }

    /// Adds a row or a column of parts, each with its share of the length.
    fn container(&mut self, kind: ContainerKind, parts: &[(Part, f32)]) -> Part {
        let shares = parts.iter().map(|(_, share)| *share);
        let container = ContainerBlueprint::new(kind).with_contents(parts.iter().map(|(part, _)| part.0.as_str()));
        let container = match kind {
            ContainerKind::Horizontal => container.with_col_shares(shares),
            _ => container.with_row_shares(shares),
        };
        let path = format!("container/{}", self.next_id());
        self.add(path.clone(), container);
        Part(path)
    }

    /// Adds tabs, the first of them in front.
    fn tabs(&mut self, parts: &[Part]) -> Part {
        let container = ContainerBlueprint::new(ContainerKind::Tabs).with_contents(parts.iter().map(|p| p.0.as_str()));
        let container = match parts.first() {
            Some(first) => container.with_active_tab(first.0.as_str()),
            None => container,
        };
        let path = format!("container/{}", self.next_id());
        self.add(path.clone(), container);
        Part(path)
    }

    fn finish(mut self, root: &Part, run: &ReplayScene) -> Vec<Entry> {
        let id = root.0.rsplit('/').next().and_then(|id| Uuid::parse_str(id).ok()).unwrap_or_default();
        let viewport = ViewportBlueprint::new().with_root_container(RootContainer(id.into()));
        self.add("viewport".to_owned(), viewport.with_auto_layout(false).with_auto_views(false));
        for panel in ["blueprint_panel", "selection_panel"] {
            self.add(panel.to_owned(), PanelBlueprint::new().with_state(PanelState::Collapsed));
        }
        let (play, speed) = match run.state {
            RunState::Over => (PlayState::Playing, (run.tracks.duration_s / WATCHED_S).ceil().max(1.0)),
            RunState::GoesOn => (PlayState::Following, 1.0),
        };
        let time = TimePanelBlueprint::new().with_state(PanelState::Collapsed).with_timeline(TIMELINE);
        let time = time.with_play_state(play).with_playback_speed(speed);
        self.add("time_panel".to_owned(), time);
        self.entries
    }
}

fn joints_title(run: &ReplayScene) -> &'static str {
    match run.robot.first_slide() {
        Some(_) => "Calibrated joints [deg; slides mm]",
        None => "Calibrated joint angles [deg]",
    }
}
