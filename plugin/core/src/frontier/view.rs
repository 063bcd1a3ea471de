//! The six axis-aligned view directions of a sample camera, and a run-time camera's view.

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

/// View direction of a sample camera. Arrays with one entry per direction use this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
pub enum ViewDirection {
    /// Along +X.
    PositiveX,
    /// Along −X.
    NegativeX,
    /// Along +Y, straight up.
    PositiveY,
    /// Along −Y, straight down.
    NegativeY,
    /// Along +Z.
    PositiveZ,
    /// Along −Z.
    NegativeZ,
}

impl ViewDirection {
    /// All six, in index order.
    pub const ALL: [Self; 6] = [
        Self::PositiveX,
        Self::NegativeX,
        Self::PositiveY,
        Self::NegativeY,
        Self::PositiveZ,
        Self::NegativeZ,
    ];

    /// Index in [`ALL`](Self::ALL), 0 to 5.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Unit vector of the direction, in world space.
    pub const fn forward(self) -> Vec3 {
        match self {
            Self::PositiveX => Vec3::X,
            Self::NegativeX => Vec3::NEG_X,
            Self::PositiveY => Vec3::Y,
            Self::NegativeY => Vec3::NEG_Y,
            Self::PositiveZ => Vec3::Z,
            Self::NegativeZ => Vec3::NEG_Z,
        }
    }

    /// Unit vector of the image's up direction, in world space: +Y, or −Z for the two vertical
    /// views.
    pub const fn up(self) -> Vec3 {
        match self {
            Self::PositiveY | Self::NegativeY => Vec3::NEG_Z,
            _ => Vec3::Y,
        }
    }

    /// World rotation of a camera with this view direction; a camera looks along its own −Z.
    pub fn rotation(self) -> Quat {
        let forward = self.forward();
        let right = forward.cross(self.up());
        Quat::from_mat3(&glam::Mat3::from_cols(right, self.up(), -forward))
    }
}

/// View of a run-time camera: the input of a frontier look-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// World position, metres.
    pub position: Vec3,
    /// World rotation, of length 1; the camera looks along its own −Z.
    pub rotation: Quat,
    /// Vertical field of view, radians, in (0, π).
    pub vertical_fov: f32,
    /// Width ÷ height of the image; finite, above 0.
    pub aspect: f32,
}

/// Thresholds of a cut. A camera has jumped that moves both farther and faster than these, or turns
/// so (metres, degrees, m/s, degrees/s). The speeds spare fast vehicles, and glances at a low frame
/// rate.
pub const CUT_DISTANCE: f32 = 1.0;
const CUT_ANGLE: f32 = 30.0;
const CUT_SPEED: f32 = 300.0;
const CUT_TURN: f32 = 900.0;
/// Longest frame for which they count, seconds: a stall.
const LONGEST_FRAME: f32 = 0.1;

/// Whether a camera cuts between two frames `seconds` apart, each with its position in metres and
/// its unit viewing direction. Time may stand still, and NaN counts for 0; a position that is NaN is
/// no cut by itself.
pub fn is_cut(then: (Vec3, Vec3), now: (Vec3, Vec3), seconds: f32) -> bool {
    let seconds = if seconds > 0.0 { seconds.min(LONGEST_FRAME) } else { 0.0 };
    let (farthest, widest) =
        (CUT_DISTANCE.max(CUT_SPEED * seconds), CUT_ANGLE.max(CUT_TURN * seconds));
    then.0.distance_squared(now.0) > farthest * farthest
        || then.1.dot(now.1) < widest.to_radians().cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn teleports_and_whips_are_cuts_and_fast_motion_is_not() {
        let at = |x: f32, degrees: f32| {
            (Vec3::X * x, Quat::from_rotation_y(degrees.to_radians()) * Vec3::NEG_Z)
        };
        let still = at(0.0, 0.0);
        for (now, seconds, expected) in [
            (at(0.9, 0.0), 0.0, false),
            (at(1.1, 0.0), 0.0, true),
            (at(0.0, 29.0), 0.0, false),
            (at(0.0, 31.0), 0.0, true),
            (at(4.0, 0.0), 1.0 / 60.0, false),
            (at(6.0, 0.0), 1.0 / 60.0, true),
            (at(29.0, 80.0), 0.1, false),
            (at(31.0, 0.0), 10.0, true),
            (at(1.1, 0.0), f32::NAN, true),
            (at(f32::NAN, 0.0), 0.1, false),
        ] {
            assert_eq!(is_cut(still, now, seconds), expected, "{now:?} after {seconds} s");
        }
    }
}
