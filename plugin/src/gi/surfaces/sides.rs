//! The two sides of a surface.

use bevy::render::render_resource::Face;

/// Which sides of a surface are seen.
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
    /// Those that a material shows that leaves these faces out.
    pub fn shown(culled: Option<Face>) -> Self {
        match culled {
            Some(Face::Back) => Self::Front,
            Some(Face::Front) => Self::Back,
            None => Self::Both,
        }
    }

    /// Of the normals that face them.
    pub fn signs(self) -> &'static [f32] {
        match self {
            Self::Front => &[1.0],
            Self::Back => &[-1.0],
            Self::Both => &[1.0, -1.0],
        }
    }

    /// How many.
    pub fn count(self) -> usize {
        self.signs().len()
    }
}
