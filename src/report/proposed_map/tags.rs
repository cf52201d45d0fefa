//! The choice of the tags: detections first, then transforms, then images.

use std::collections::BTreeMap;

use armcal_core::robot::Robot;

use super::contents::{Contents, Kind, Topic};
use super::{comment, others, quoted};

/// Words in the names of cameras' frames, and of tags' and boards'.
const CAMERA_WORDS: [&str; 3] = ["cam", "optical", "fisheye"];
const TAG_WORDS: [&str; 8] = ["tag", "board", "marker", "target", "aruco", "landmark", "fiducial", "pattern"];

/// One landmark, or all numbered landmarks of a name, seen from one camera.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    topic: String,
    camera: String,
    /// Child frame in the form of `tags.child_frame`.
    child: String,
}

/// The topic and the text of `[tags]`; `None` where the recording has none.
pub(super) fn choose_tags(contents: &Contents, robot: Option<&Robot>) -> Option<(String, String)> {
    let chosen = of_detections(contents, robot).or_else(|| of_transforms(contents));
    let chosen = chosen.or_else(|| of_images(contents, robot));
    let (topic, chosen) = chosen?;
    let mut text = format!("\n[tags]\n{chosen}");
    let topics = |kind| contents.of_kind(kind).map(|(topic, _)| topic);
    text += &others("all topics with detections", topics(Kind::Detections));
    text += &others("all topics with transforms", topics(Kind::Transforms));
    text += &others("all topics with images (use = \"corners\")", topics(Kind::Images));
    Some((topic, text))
}

fn of_detections(contents: &Contents, robot: Option<&Robot>) -> Option<(String, String)> {
    let (name, topic) = contents.of_kind(Kind::Detections).max_by_key(|(_, topic)| topic.messages)?;
    let ids: Vec<String> = topic.ids.iter().map(i32::to_string).collect();
    let lens = camera_info(contents, (name, topic), robot);
    let text = if topic.has_board_corners() {
        format!(
            "topic = {}   # {} messages; detections without an outline: the corners of a board\nuse = \
             \"board_corners\"\nchild_frame = \"board\"   # as the tag map calls it, with its squares and \
             square_m\n{lens}{}",
            quoted(name),
            topic.messages,
            others("numbers of the corners there", ids.iter())
        )
    } else {
        let ids = others("ids of the tags there", ids.iter());
        format!("topic = {}   # {} messages with corners\nuse = \"corners\"\n{lens}{ids}", quoted(name), topic.messages)
    };
    Some((name.clone(), text))
}

/// The line that names a camera's lens for the detections or images on that topic. It prefers the camera_info with the
/// same frame, all corners in its image and the most similar name. A comment where none is usable, and the line too if
/// the robot needs a lens, so that `calibrate` gives the reason.
fn camera_info(contents: &Contents, (name, topic): (&str, &Topic), robot: Option<&Robot>) -> String {
    let shared = |other: &str| other.chars().zip(name.chars()).take_while(|(a, b)| a == b).count();
    let rank = |(of, info): &(&String, &Topic)| {
        let size = info.lens.as_ref().and_then(|lens| lens.as_ref().ok());
        let holds_all = size.is_some_and(|size| (0..2).all(|k| topic.extent_px[k] <= f64::from(size[k])));
        (size.is_some(), !topic.frame.is_empty() && info.frame == topic.frame, holds_all, shared(of))
    };
    let Some((chosen, info)) = contents.of_kind(Kind::CameraInfo).max_by_key(rank) else { return String::new() };
    let rest = contents.of_kind(Kind::CameraInfo).map(|(of, _)| of).filter(|of| *of != chosen);
    let line = match &info.lens {
        Some(Ok([width, height])) => {
            format!("camera_info = {}   # {width} x {height} px; used where robot.toml has no lens\n", quoted(chosen))
        }
        Some(Err(problem)) if robot.is_some_and(|robot| !robot.camera.lens.is_known()) => {
            let why = comment(&format!("# the lens there {problem}"));
            format!("camera_info = {}\n{why}\n", quoted(chosen))
        }
        Some(Err(problem)) => comment(&format!("# camera_info: the lens on {chosen} {problem}")) + "\n",
        None => comment(&format!("# camera_info: the messages on {chosen} cannot be decoded")) + "\n",
    };
    line + &others("other lenses", rest)
}

/// The best pair of frames by their names; a comment lists all other pairs.
fn of_transforms(contents: &Contents) -> Option<(String, String)> {
    let mut found: BTreeMap<Candidate, u32> = BTreeMap::new();
    for (name, topic) in contents.of_kind(Kind::Transforms) {
        for (parent, child) in &topic.frames {
            for (camera, tag) in [(parent, child), (child, parent)] {
                let child = pattern(tag);
                let is_numbered = child.ends_with("{id}");
                let score = 4 * u32::from(has_word(tag, &TAG_WORDS))
                    + 4 * u32::from(has_word(camera, &CAMERA_WORDS) && !has_word(tag, &CAMERA_WORDS))
                    + u32::from(is_numbered)
                    + u32::from(camera == parent);
                found.insert(Candidate { topic: name.clone(), camera: camera.clone(), child }, score);
            }
        }
    }
    // A single pair of frames can only be the camera and its target.
    let least = if found.len() <= 2 { 0 } else { 4 };
    let (best, _) = found.iter().filter(|(_, score)| **score >= least).min_by_key(|(_, score)| u32::MAX - **score)?;
    let pairs: Vec<String> = found
        .keys()
        .filter(|other| *other != best)
        .map(|other| format!("`{}` in `{}` on {}", other.child, other.camera, other.topic))
        .collect();
    let Candidate { topic, camera, child } = best;
    let text = format!(
        "topic = {}\ncamera_frame = {}\nchild_frame = {}\n\
         use = \"pose\"   # or \"position\", where rotations are poor\n\
         # position_std_m = 0.003       # noise of a tag's position, one sigma per axis, as you know it\n\
         # rotation_std_rad = 0.01      # noise of the camera's direction\n{}",
        quoted(topic),
        quoted(camera),
        quoted(child),
        others("other pairs of frames", pairs.iter())
    );
    Some((topic.clone(), text))
}

fn of_images(contents: &Contents, robot: Option<&Robot>) -> Option<(String, String)> {
    let (name, topic) = contents.of_kind(Kind::Images).max_by_key(|(_, topic)| topic.messages)?;
    let text = format!(
        "topic = {}   # {} images; armcal looks for tags in them\nuse = \"corners\"\n\
         # family = \"36h11\"   # or \"25h9\", \"Standard41h12\" .., where robot.toml has no [[tag]]s\n\
         # image_period_s = 0.2   # looks at one image in so many seconds\n{}",
        quoted(name),
        topic.messages,
        camera_info(contents, (name, topic), robot)
    );
    Some((name.clone(), text))
}

fn has_word(frame: &str, words: &[&str]) -> bool {
    let frame = frame.to_lowercase();
    words.iter().any(|word| frame.contains(word))
}

/// Pattern of a numbered frame: `tag36h11:{id}` for `tag36h11:7`; a plain name otherwise. Names that maps can hold have
/// no braces.
fn pattern(frame: &str) -> String {
    let stem = frame.trim_end_matches(|c: char| c.is_ascii_digit());
    let is_number = frame[stem.len()..].parse::<u32>().is_ok();
    let is_tag = has_word(stem, &TAG_WORDS) || stem.ends_with([':', '_', '/']);
    if is_number && is_tag && !stem.contains(['{', '}']) { format!("{stem}{{id}}") } else { comment(frame) }
}
