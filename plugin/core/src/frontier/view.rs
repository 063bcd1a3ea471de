//! The six axis-aligned view directions of a sample camera, and a run-time camera's view.

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

/// View direction of a sample camera. Arrays with one entry per direction use this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
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
    /// World rotation; the camera looks along its own −Z.
    pub rotation: Quat,
    /// Vertical field of view, radians, in (0, π).
    pub vertical_fov: f32,
    /// Width ÷ height of the image; finite, above 0.
    pub aspect: f32,
}
