//! `armcal tagmap`: poses of tags from camera views only.

use armcal_core::codes::{Code, Warning};
use armcal_core::kind::Kind;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, Table};
use serde_json::{Value, json};

use crate::cli::calibration_inputs::load_robot;
use crate::cli::closing::say_wrapped;
use crate::cli::exit::Exit;
use crate::cli::file_kind::{expect_option, expect_recording};
use crate::cli::named;
use crate::cli::own_inputs::spare_inputs;
use crate::cli::stdout::{note, say};
use crate::output;
use crate::report::{TAG_COLUMNS, TagMapPage, fit_lines, group_title, tag_map_html, tag_rows};
use armcal_belief::calib::surveyed;
use armcal_belief::tagmap::files::{NamedCamera, TagFile, map_to_text, read_cameras, read_tags};
use armcal_belief::tagmap::recording::{RecordedViews, read_views};
use armcal_belief::tagmap::{
    Body, GroupFrame, MapGroup, MapInput, MapMode, MapSettings, MappedTag, TagMap, TagPrior, checked_map,
};
use armcal_core::log::{Completeness, TopicMap, scan_recording, topics};
use armcal_core::robot::{self, Robot};
use armcal_core::streams::Message;

#[derive(Debug, Args)]
pub(super) struct TagmapArgs {
    /// The recording (.mcap)
    recording: PathBuf,
    /// Robot folder with camera, tags and base tag
    #[arg(long, value_name = "DIR", required_unless_present_all = ["camera", "tags"], value_parser = named::robot())]
    #[arg(conflicts_with_all = ["camera", "tags"])]
    robot: Option<PathBuf>,
    /// Cameras: cameras.yaml of TagSLAM or camchain.yaml of Kalibr
    #[arg(long, value_name = "FILE", requires = "tags")]
    camera: Option<PathBuf>,
    /// Tags: tagslam.yaml, a target of Kalibr (.yaml), or a tag map (.toml)
    #[arg(long, visible_alias = "tag-map", value_name = "FILE", requires = "camera")]
    tags: Option<PathBuf>,
    /// Topic of the detections; default: the one in the camera file, or the only one
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
    /// Trust in the given tag poses; default: `unknown` with --robot, `partly-known` with --tags
    #[arg(long, value_enum)]
    mode: Option<Mode>,
    /// Write the map here: .toml, .yaml for TagSLAM, or .html for a page with a drawing of the tags; repeatable
    #[arg(long, value_name = "FILE")]
    out: Vec<PathBuf>,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

impl TagmapArgs {
    /// Refuses, before the work, outputs that cannot be written or that overwrite an input.
    fn check_outputs(&self) -> Result<()> {
        let robot_file = self.robot.as_ref().map(|folder| folder.join("robot.toml"));
        for path in &self.out {
            let inputs = [Some(&self.recording), robot_file.as_ref(), self.camera.as_ref(), self.tags.as_ref()];
            spare_inputs(path, inputs.into_iter().flatten().map(PathBuf::as_path))?;
            output::check_writable(path)?;
        }
        Ok(())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// Given poses are exact: only cameras are located
    Known,
    /// Given poses have their standard deviations
    PartlyKnown,
    /// Only the pose of the base tag is used
    Unknown,
}

impl From<Mode> for MapMode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Known => Self::Known,
            Mode::PartlyKnown => Self::PartlyKnown,
            Mode::Unknown => Self::Unknown,
        }
    }
}

/// Number of detections above which a map may take long enough to need a progress line. Assumed.
const MANY_DETECTIONS: usize = 1000;

/// Share of rejected detections above which the data of a map count as bad. Assumed.
const MAX_REJECTED_SHARE: f64 = 0.2;
/// Ratio of corner noise to the stated one above which a lens or size is doubtful, as in the warning of `calibrate`.
const NOISY: f64 = 2.0;

pub(super) fn tagmap(args: &TagmapArgs) -> Result<Exit> {
    expect_recording(&args.recording)?;
    expect_option(args.tags.as_deref(), Kind::TagMap)?;
    args.check_outputs()?;
    let is_page = |path: &&PathBuf| path.extension().is_some_and(|end| end == "html");
    let (cameras, tags, settings) = match (&args.robot, &args.camera, &args.tags) {
        (Some(folder), ..) => of_robot(&args.recording, &load_robot(folder, &[])?)?,
        (None, Some(camera), Some(tags)) => of_files(camera, tags)?,
        _ => {
            return Err(crate::cli::exit::UsageError::new(
                Code::UsageInvalid,
                "name --robot, or --camera and --tags".to_owned(),
            )
            .into());
        }
    };
    let settings = MapSettings { mode: args.mode.map_or(settings.mode, MapMode::from), ..settings };
    let read = read_views(&args.recording, &cameras, args.topic.as_deref(), &tags)?;
    let n_detections: usize = read.views.iter().map(|view| view.tags.len()).sum();
    if n_detections > MANY_DETECTIONS {
        note(format_args!("{n_detections} detections in {} views; this may take a minute", read.views.len()));
    }
    let models: Vec<_> = cameras.iter().map(|camera| camera.model).collect();
    let input = MapInput { cameras: &models, views: &read.views, bodies: &tags.bodies, tags: &tags.tags };
    let file = args.recording.display();
    let map = checked_map(&input, &settings).map_err(|error| anyhow::Error::from(error).context(format!("{file}")))?;
    for out in args.out.iter().filter(|path| !is_page(path)) {
        let text = map_to_text(out, &map, &input).map_err(robot::RobotError::from)?;
        output::write_together(&[(out, text.as_bytes())])?;
    }
    let sources: Vec<String> =
        read.topics.iter().map(|(camera, topic)| format!("{topic} of camera {}", cameras[*camera].name)).collect();
    let (warnings, is_sound) = warnings(&file.to_string(), &map, &read, &tags);
    for out in args.out.iter().filter(is_page) {
        let page = TagMapPage { map: &map, file: &file.to_string(), sources: &sources, warnings: &warnings, is_sound };
        output::write_together(&[(out, tag_map_html(&page).as_bytes())])?;
    }
    if args.json {
        say(&to_json(&map)?)?;
    } else {
        say_wrapped(&describe(&map, &sources))?;
    }
    warnings.iter().for_each(|warning| note(format_args!("warning: {warning}")));
    Ok(if is_sound { Exit::Ok } else { Exit::DataLost })
}

type Known = (Vec<NamedCamera>, TagFile, MapSettings);

/// The camera and the tags around an arm; the tags are the recording's survey, where it has one.
fn of_robot(recording: &Path, robot: &Robot) -> Result<Known> {
    let is_survey = |_, message: &Message| matches!(message, Message::Survey(_));
    let (read, _) = scan_recording(recording, &TopicMap::default(), |_| {}, is_survey)?;
    let robot = &*surveyed(&read, robot);
    robot.require_lens()?;
    let camera = NamedCamera {
        name: robot.camera.name.clone(),
        model: robot.camera.lens,
        image_topic: None,
        tag_topic: Some(topics::DETECTIONS.to_owned()),
    };
    let prior = |tag: &armcal_core::robot::SurveyedTag| {
        let (p, r) = (tag.position_std_m, tag.rotation_std_rad);
        let std = (p + r > 0.0).then_some([p, p, p, r, r, r]);
        let pose = tag.is_known().then(|| *tag.base_from_tag.isometry());
        TagPrior { id: tag.id, size_m: tag.size_m, body: 0, pose, std: std.filter(|_| tag.is_known()) }
    };
    let tags = TagFile {
        frame: robot.base_link.clone(),
        bodies: vec![Body { name: robot.base_link.clone(), is_static: true, pose: None }],
        tags: robot.tags.iter().map(prior).collect(),
        base_tag: robot.base_tag,
        ..TagFile::default()
    };
    let settings = MapSettings {
        mode: MapMode::Unknown,
        base_tag: robot.base_tag,
        corner_std_px: robot.camera.corner_std_px,
        tag_family: robot.tag_family,
        focal_std: robot.camera.lens_priors.focal_std,
        ..MapSettings::default()
    };
    Ok((vec![camera], tags, settings))
}

fn of_files(camera: &Path, tags: &Path) -> Result<Known> {
    let cameras = read_cameras(camera)?;
    let tags = read_tags(tags)?;
    // The attitude sensor is on the vehicle: the moving body that carries the base tag.
    let of_base = tags.tags.iter().find(|tag| Some(tag.id) == tags.base_tag).map(|tag| tag.body);
    let settings = MapSettings {
        base_tag: tags.base_tag,
        default_tag: tags.default_tag,
        attitude_body: of_base.filter(|body| !tags.bodies[*body].is_static),
        lens_file: camera.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        ..MapSettings::default()
    };
    Ok((cameras, tags, settings))
}

/// Description of the map for people, in millimetres and degrees.
fn describe(map: &TagMap, sources: &[String]) -> String {
    let mut out = String::new();
    for (idx, group) in map.groups.iter().enumerate() {
        out.push_str(&format!("{}\n", group_title(group)));
        let mut table = Table::new();
        table.load_preset(UTF8_FULL_CONDENSED).set_header(TAG_COLUMNS.map(|name| name.replace(' ', "\n")));
        for row in tag_rows(map, idx) {
            table.add_row(row);
        }
        // Eleven columns within 80: names over three lines, no space around figures.
        for (n, column) in table.column_iter_mut().enumerate() {
            column.set_padding((0, 0));
            if n > 0 {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        out.push_str(&format!("{table}\n"));
    }
    let lines = fit_lines(map, sources).map(|(name, text)| format!("{name:12} {text}"));
    out + &lines.join("\n")
}

/// The map and its accuracy as JSON; m, rad and px.
fn to_json(map: &TagMap) -> Result<String> {
    let group = |group: &MapGroup| match &group.frame {
        GroupFrame::Body(name) => json!({ "body": name, "tags": group.tags, "views": group.n_views }),
        GroupFrame::Tag(id) => json!({ "tag": id, "tags": group.tags, "views": group.n_views }),
    };
    let tag = |tag: &MappedTag| {
        let (position_m, turn) = (tag.frame_from_tag.translation.vector, tag.frame_from_tag.rotation);
        json!({
            "id": tag.id,
            "group": tag.group,
            "size_m": tag.size_m,
            "position_m": <[f64; 3]>::from(position_m),
            "quaternion_wxyz": [turn.w, turn.i, turn.j, turn.k],
            "position_std_m": tag.position_std_m(),
            "rotation_std_rad": tag.rotation_std_rad(),
            "views": tag.n_views,
            "rms_px": tag.rms_px,
            "held": tag.is_fixed,
        })
    };
    let rejected: serde_json::Map<String, Value> =
        map.rejected_by_reason().iter().map(|(reason, n)| (reason.name().to_owned(), json!(n))).collect();
    let all = json!({
        "version": 1,
        "groups": map.groups.iter().map(group).collect::<Vec<_>>(),
        "tags": map.tags.iter().map(tag).collect::<Vec<_>>(),
        "detections": map.n_detections,
        "used": map.n_used,
        "rejected": rejected,
        "rms_px": map.rms_px,
        "median_px": map.median_px,
        "chi_square": map.chi_square,
        "degrees_of_freedom": map.degrees_of_freedom,
        "converged": map.has_converged,
        "warnings": map.warnings,
    });
    serde_json::to_string_pretty(&all).context("the map has no JSON form")
}

/// Warnings about data and map, and true if the map is still usable.
fn warnings(file: &str, map: &TagMap, read: &RecordedViews, tags: &TagFile) -> (Vec<Warning>, bool) {
    let is_whole = read.completeness == Completeness::Whole;
    let mut found = Vec::new();
    if !is_whole {
        found.push(Warning::new(Code::RecordingDamaged, format!("{file}: is not whole; what could be read is used")));
    }
    let left_out = read.left_out.iter().map(|(what, n)| format!("{file}: {n} {what} left out"));
    found.extend(left_out.map(|text| Warning::new(Code::MessagesRejected, text)));
    let ignored = tags.ignored_keys.iter().map(|key| format!("{key} has no effect here"));
    found.extend(ignored.map(|text| Warning::new(Code::KeyIgnored, text)));
    found.extend(map.scale_warnings.iter().map(|warning| Warning::new(Code::MapTagSize, warning.to_string())));
    found.extend(map.warnings.iter().cloned());
    if map.noise_scale > NOISY {
        let text = format!(
            "corner residuals are {:.1} times the stated corner noise ({:.2} px rms): check model and distortion of \
             the lens, and the tag sizes",
            map.noise_scale, map.rms_px
        );
        found.push(Warning::new(Code::CornersNoisy, text));
    }
    if !map.has_converged {
        found.push(Warning::new(Code::MapNotConverged, "the fit did not come to rest"));
    }
    let faults = map.rejected.iter().filter(|rejected| rejected.reason.is_fault()).count();
    let too_many = faults as f64 > MAX_REJECTED_SHARE * map.n_detections as f64;
    if too_many {
        let text = format!("{file}: {faults} of {} detections rejected", map.n_detections);
        found.push(Warning::new(Code::MapDetectionsRejected, text));
    }
    let is_determined = map.warnings.iter().all(|warning| warning.code != Code::MapUndetermined);
    let is_read = is_whole && read.n_unreadable == 0;
    let is_one = map.has_converged && !map.is_contradicted;
    let is_sound = is_read && is_determined && !too_many && is_one && map.scale_warnings.is_empty();
    (found, is_sound)
}
