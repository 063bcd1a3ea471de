//! The six axis-aligned view directions of a sample camera, and a run-time camera's view.

use bevy::math::{Quat, Vec3};
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Where a sample camera looks. The number of each is its index wherever six things are stored in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Reflect, Serialize, Deserialize)]
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
    pub const ALL: [Self; 6] = [Self::PositiveX, Self::NegativeX, Self::PositiveY, Self::NegativeY, Self::PositiveZ, Self::NegativeZ];

    /// Position in [`ALL`](Self::ALL).
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Unit vector of the view.
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

    /// Which way is up in the picture: +Y, or −Z for the two vertical views.
    pub const fn up(self) -> Vec3 {
        match self {
            Self::PositiveY | Self::NegativeY => Vec3::NEG_Z,
            _ => Vec3::Y,
        }
    }

    /// Rotation of a camera (which looks along its own −Z) that looks this way.
    pub fn rotation(self) -> Quat {
        let forward = self.forward();
        let right = forward.cross(self.up());
        Quat::from_mat3(&bevy::math::Mat3::from_cols(right, self.up(), -forward))
    }
}

/// What a run-time camera sees: enough to find its sample camera.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct CameraView {
    /// World position, metres.
    pub position: Vec3,
    /// World rotation; the camera looks along its own −Z.
    pub rotation: Quat,
    /// Vertical field of view, radians, in (0, π).
    pub vertical_fov: f32,
    /// Width ÷ height of the picture.
    pub aspect: f32,
}
