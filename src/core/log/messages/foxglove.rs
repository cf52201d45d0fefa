//! Foxglove's own messages: solids in frames, and marks on images. Rerun does not draw them.

use serde::{Deserialize, Serialize};

use super::basic::{PixelPoint, Point, Pose, Time, Vector3};
use crate::log::schema::{RosMessage, RosSchema};

/// List that is always empty in our recordings.
pub type NoneOfThem = Vec<u8>;

/// foxglove_msgs/msg/Color, 0 .. 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the ROS type")]
pub struct Color {
    pub r: f64,
    pub g: f64,
    pub b: f64,
    pub a: f64,
}

/// foxglove_msgs/msg/CubePrimitive and SpherePrimitive, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SizedPrimitive {
    /// Pose of the centre in the entity's frame.
    pub pose: Pose,
    /// Full lengths along the axes.
    pub size: Vector3,
    /// Colour of the faces.
    pub color: Color,
}

/// foxglove_msgs/msg/TriangleListPrimitive, m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriangleListPrimitive {
    /// Pose of the primitive's frame in the entity's frame.
    pub pose: Pose,
    /// Corners of the triangles.
    pub points: Vec<Point>,
    /// Colour of all triangles.
    pub color: Color,
    /// Colours of the corners; empty: one colour for all.
    pub colors: Vec<Color>,
    /// Indices into `points`, three for each triangle.
    pub indices: Vec<u32>,
}

/// foxglove_msgs/msg/TextPrimitive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TextPrimitive {
    /// Pose of the text's centre in the entity's frame.
    pub pose: Pose,
    /// True if the text always faces the viewer.
    pub billboard: bool,
    /// Height of a letter, m.
    pub font_size: f64,
    /// True if the text has the same size at any distance.
    pub scale_invariant: bool,
    /// Colour of the letters.
    pub color: Color,
    /// Content of the text.
    pub text: String,
}

/// foxglove_msgs/msg/SceneEntity: solids that are fixed in a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneEntity {
    /// Start of validity.
    pub timestamp: Time,
    /// Frame of all parts.
    pub frame_id: String,
    /// Name of the entity; a new entity replaces one of the same name.
    pub id: String,
    /// Duration of validity; zero: without limit.
    pub lifetime: Time,
    /// True if the entity moves with its frame.
    pub frame_locked: bool,
    /// Empty.
    pub metadata: NoneOfThem,
    /// Empty.
    pub arrows: NoneOfThem,
    /// Boxes.
    pub cubes: Vec<SizedPrimitive>,
    /// Spheres.
    pub spheres: Vec<SizedPrimitive>,
    /// Empty.
    pub cylinders: NoneOfThem,
    /// Empty.
    pub lines: NoneOfThem,
    /// Triangle meshes.
    pub triangles: Vec<TriangleListPrimitive>,
    /// Labels with names.
    pub texts: Vec<TextPrimitive>,
    /// Empty.
    pub models: NoneOfThem,
}

/// foxglove_msgs/msg/SceneUpdate.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneUpdate {
    /// Empty.
    pub deletions: NoneOfThem,
    /// Entities that are valid from now on.
    pub entities: Vec<SceneEntity>,
}

macro_rules! color {
    () => {
        dependency!("foxglove_msgs/Color", "float64 r\nfloat64 g\nfloat64 b\nfloat64 a\n")
    };
}

macro_rules! key_value {
    () => {
        dependency!("foxglove_msgs/KeyValuePair", "string key\nstring value\n")
    };
}

message!(
    SceneUpdate,
    "foxglove_msgs/msg/SceneUpdate",
    "foxglove_msgs/SceneEntityDeletion[] deletions\nfoxglove_msgs/SceneEntity[] entities\n",
    dependency!(
        "foxglove_msgs/SceneEntityDeletion",
        "builtin_interfaces/Time timestamp\nuint8 MATCHING_ID=0\nuint8 ALL=1\nuint8 type\nstring id\n"
    ),
    dependency!(
        "foxglove_msgs/SceneEntity",
        "builtin_interfaces/Time timestamp\nstring frame_id\nstring id\nbuiltin_interfaces/Duration lifetime\n",
        "bool frame_locked\nfoxglove_msgs/KeyValuePair[] metadata\nfoxglove_msgs/ArrowPrimitive[] arrows\n",
        "foxglove_msgs/CubePrimitive[] cubes\nfoxglove_msgs/SpherePrimitive[] spheres\n",
        "foxglove_msgs/CylinderPrimitive[] cylinders\nfoxglove_msgs/LinePrimitive[] lines\n",
        "foxglove_msgs/TriangleListPrimitive[] triangles\nfoxglove_msgs/TextPrimitive[] texts\n",
        "foxglove_msgs/ModelPrimitive[] models\n"
    ),
    key_value!(),
    dependency!(
        "foxglove_msgs/ArrowPrimitive",
        "geometry_msgs/Pose pose\nfloat64 shaft_length\nfloat64 shaft_diameter\nfloat64 head_length\n",
        "float64 head_diameter\nfoxglove_msgs/Color color\n"
    ),
    dependency!(
        "foxglove_msgs/CubePrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfoxglove_msgs/Color color\n"
    ),
    dependency!(
        "foxglove_msgs/SpherePrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfoxglove_msgs/Color color\n"
    ),
    dependency!(
        "foxglove_msgs/CylinderPrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfloat64 bottom_scale\nfloat64 top_scale\n",
        "foxglove_msgs/Color color\n"
    ),
    dependency!(
        "foxglove_msgs/LinePrimitive",
        "uint8 LINE_STRIP=0\nuint8 LINE_LOOP=1\nuint8 LINE_LIST=2\nuint8 type\ngeometry_msgs/Pose pose\n",
        "float64 thickness\nbool scale_invariant\ngeometry_msgs/Point[] points\nfoxglove_msgs/Color color\n",
        "foxglove_msgs/Color[] colors\nuint32[] indices\n"
    ),
    dependency!(
        "foxglove_msgs/TriangleListPrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Point[] points\nfoxglove_msgs/Color color\n",
        "foxglove_msgs/Color[] colors\nuint32[] indices\n"
    ),
    dependency!(
        "foxglove_msgs/TextPrimitive",
        "geometry_msgs/Pose pose\nbool billboard\nfloat64 font_size\nbool scale_invariant\n",
        "foxglove_msgs/Color color\nstring text\n"
    ),
    dependency!(
        "foxglove_msgs/ModelPrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nfoxglove_msgs/Color color\n",
        "bool override_color\nstring url\nstring media_type\nuint8[] data\n"
    ),
    dependency!("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    point!(),
    quaternion!(),
    vector3!(),
    color!(),
    time!(),
    dependency!("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
);

/// foxglove_msgs/msg/PointsAnnotation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointsAnnotation {
    /// Time of the image.
    pub timestamp: Time,
    /// Kind of the annotation; 2: a closed line.
    pub kind: u8,
    /// Corners of the line, px.
    pub points: Vec<PixelPoint>,
    /// Colour of the line.
    pub outline_color: Color,
    /// Colours of the corners; empty: one colour for all.
    pub outline_colors: Vec<Color>,
    /// Colour of the enclosed area.
    pub fill_color: Color,
    /// Width of the line, px.
    pub thickness: f64,
    /// Empty.
    pub metadata: NoneOfThem,
}

/// foxglove_msgs/msg/TextAnnotation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TextAnnotation {
    /// Time of the image.
    pub timestamp: Time,
    /// Position of the text's lower left corner, px.
    pub position: PixelPoint,
    /// Content of the text.
    pub text: String,
    /// Height of the letters, px.
    pub font_size: f64,
    /// Colour of the letters.
    pub text_color: Color,
    /// Colour behind the letters.
    pub background_color: Color,
    /// Empty.
    pub metadata: NoneOfThem,
}

/// foxglove_msgs/msg/ImageAnnotations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ImageAnnotations {
    /// Time of the image.
    pub timestamp: Time,
    /// Empty.
    pub circles: NoneOfThem,
    /// Outlines of the tags.
    pub points: Vec<PointsAnnotation>,
    /// Names of the tags.
    pub texts: Vec<TextAnnotation>,
    /// Empty.
    pub metadata: NoneOfThem,
}

message!(
    ImageAnnotations,
    "foxglove_msgs/msg/ImageAnnotations",
    "builtin_interfaces/Time timestamp\nfoxglove_msgs/CircleAnnotation[] circles\n",
    "foxglove_msgs/PointsAnnotation[] points\nfoxglove_msgs/TextAnnotation[] texts\n",
    "foxglove_msgs/KeyValuePair[] metadata\n",
    dependency!(
        "foxglove_msgs/CircleAnnotation",
        "builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\nfloat64 diameter\nfloat64 thickness\n",
        "foxglove_msgs/Color fill_color\nfoxglove_msgs/Color outline_color\n",
        "foxglove_msgs/KeyValuePair[] metadata\n"
    ),
    dependency!(
        "foxglove_msgs/PointsAnnotation",
        "builtin_interfaces/Time timestamp\nuint8 UNKNOWN=0\nuint8 POINTS=1\nuint8 LINE_LOOP=2\n",
        "uint8 LINE_STRIP=3\nuint8 LINE_LIST=4\nuint8 type\nfoxglove_msgs/Point2[] points\n",
        "foxglove_msgs/Color outline_color\nfoxglove_msgs/Color[] outline_colors\n",
        "foxglove_msgs/Color fill_color\nfloat64 thickness\nfoxglove_msgs/KeyValuePair[] metadata\n"
    ),
    dependency!(
        "foxglove_msgs/TextAnnotation",
        "builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\nstring text\nfloat64 font_size\n",
        "foxglove_msgs/Color text_color\nfoxglove_msgs/Color background_color\n",
        "foxglove_msgs/KeyValuePair[] metadata\n"
    ),
    dependency!("foxglove_msgs/Point2", "float64 x\nfloat64 y\n"),
    color!(),
    key_value!(),
    time!(),
);
