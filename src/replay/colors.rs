//! Colours that differ on a dark ground, for most colour-blind eyes too.

/// Red, green, blue, opacity.
pub(super) type Rgba = [u8; 4];

/// Deep water behind the scene.
pub(super) const WATER: Rgba = [16, 30, 44, 255];
pub(super) const SEAFLOOR: Rgba = [92, 84, 66, 255];
/// Estimated arm, drawn through the true one.
pub(super) const GHOST: Rgba = [255, 60, 220, 110];
/// Region of the tool by the estimate.
pub(super) const TOOL_REGION: Rgba = [205, 150, 255, 255];
pub(super) const BELIEVED: Rgba = [255, 90, 225, 255];
/// Detections.
pub(super) const SEEN: Rgba = [60, 230, 120, 255];
/// Rejected detections.
pub(super) const REJECTED: Rgba = [255, 120, 50, 255];
/// The lens's reach into the scene and in the image.
pub(super) const CAMERA: Rgba = [70, 200, 255, 255];
/// Links without shapes.
pub(super) const SKELETON: Rgba = [200, 205, 215, 255];
pub(super) const TARGET: Rgba = [255, 205, 60, 255];
pub(super) const HIT: Rgba = [60, 220, 90, 255];
pub(super) const MISS: Rgba = [255, 70, 60, 255];
/// First attempts, once later ones are drawn.
pub(super) const PAST: Rgba = [150, 110, 105, 255];
pub(super) const TRAIL: Rgba = [240, 240, 245, 255];
pub(super) const FIT_VIEW: Rgba = [90, 150, 255, 255];
pub(super) const HELD_OUT_VIEW: Rgba = [255, 170, 60, 255];
pub(super) const BASE_TAG: Rgba = [70, 140, 255, 255];
pub(super) const EXPECTED: Rgba = [110, 235, 240, 255];
pub(super) const OIL: Rgba = [255, 150, 60, 255];
pub(super) const COLD: Rgba = [90, 170, 255, 255];

/// The tool's path in a plan.
pub(super) const PLANNED_PATH: Rgba = [150, 165, 185, 255];
/// Arms that the errors allow.
pub(super) const MARGIN: Rgba = [255, 190, 70, 26];
pub(super) const MARGIN_TOOL: Rgba = [255, 190, 70, 255];

/// Colour of each joint, base first.
pub(super) const JOINTS: [Rgba; armcal_core::streams::MAX_JOINTS] = [
    [240, 90, 80, 255],
    [255, 175, 60, 255],
    [240, 230, 90, 255],
    [90, 210, 110, 255],
    [80, 180, 255, 255],
    [190, 130, 255, 255],
    [255, 130, 200, 255],
    [200, 200, 200, 255],
];

/// Returns the same hue, darker.
pub(super) fn dimmed([r, g, b, a]: Rgba) -> Rgba {
    [r / 2, g / 2, b / 2, a]
}
