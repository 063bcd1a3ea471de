//! The two sides of a surface.

use bevy::render::render_resource::Face;

/// Visible sides of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::gi) enum Sides {
    /// The side from which triangles run counter-clockwise.
    Front,
    /// The other one.
    Back,
    /// Either.
    Both,
}

impl Sides {
    /// The sides that a material shows when it culls these faces.
    pub(crate) fn shown(culled: Option<Face>) -> Self {
        match culled {
            Some(Face::Back) => Self::Front,
            Some(Face::Front) => Self::Back,
            None => Self::Both,
        }
    }

    /// Signs of their normals.
    pub(crate) fn signs(self) -> &'static [f32] {
        match self {
            Self::Front => &[1.0],
            Self::Back => &[-1.0],
            Self::Both => &[1.0, -1.0],
        }
    }

    /// Number of sides.
    pub(crate) fn count(self) -> usize {
        self.signs().len()
    }
}
