//! The six axis-aligned view directions of a sample camera, and a run-time camera's view.

use bevy::camera::Projection;
use bevy::math::{Quat, Vec3};
use bevy::reflect::Reflect;
use bevy::transform::components::GlobalTransform;
use serde::{Deserialize, Serialize};

/// Field of view, in radians, that represents the parallel rays of an orthographic camera.
const PARALLEL_FOV: f32 = 0.001;

/// View direction of a sample camera. Arrays with one entry per direction use this order.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Reflect, Serialize, Deserialize,
)]
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
        Quat::from_mat3(&bevy::math::Mat3::from_cols(right, self.up(), -forward))
    }
}

/// View of a run-time camera: the input of a frontier look-up.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
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

impl CameraView {
    /// The view of a Bevy camera. Without a projection the image is square with Bevy's default
    /// field of view (π/4); an orthographic camera has a field of view of 0.001. An invalid camera,
    /// such as one with an empty viewport, may give NaN, which look-ups accept.
    pub fn from_camera(transform: &GlobalTransform, projection: Option<&Projection>) -> Self {
        let (_, rotation, position) = transform.to_scale_rotation_translation();
        let (vertical_fov, aspect) = match projection {
            Some(Projection::Perspective(perspective)) => {
                (perspective.fov, perspective.aspect_ratio)
            }
            Some(Projection::Orthographic(orthographic)) => {
                let size = orthographic.area.size();
                (PARALLEL_FOV, size.x / size.y)
            }
            Some(Projection::Custom(custom)) => {
                // A perspective matrix has cot(fov / 2) as its second diagonal element, and cot(fov
                // / 2) / aspect as its first.
                let clip_from_view = custom.get_clip_from_view();
                let (x, y) = (clip_from_view.x_axis.x, clip_from_view.y_axis.y);
                (2.0 * y.abs().recip().atan(), (y / x).abs())
            }
            None => (std::f32::consts::FRAC_PI_4, 1.0),
        };
        Self { position, rotation, vertical_fov, aspect }
    }
}

#[cfg(test)]
mod tests {
    use bevy::camera::{OrthographicProjection, PerspectiveProjection};
    use bevy::math::Rect;
    use bevy::transform::components::Transform;

    use super::*;

    #[test]
    fn a_bevy_camera_gives_its_view_whatever_its_scale() {
        let transform = Transform::from_xyz(1.0, 2.0, 3.0)
            .looking_to(Vec3::X, Vec3::Y)
            .with_scale(Vec3::splat(5.0));
        let perspective =
            PerspectiveProjection { fov: 1.2, aspect_ratio: 2.0, ..Default::default() };
        let view = CameraView::from_camera(
            &transform.into(),
            Some(&Projection::Perspective(perspective.clone())),
        );
        assert_eq!(
            (view.position, view.vertical_fov, view.aspect),
            (Vec3::new(1.0, 2.0, 3.0), 1.2, 2.0)
        );
        assert!(view.rotation.angle_between(transform.rotation) < 1e-3);
        let custom =
            CameraView::from_camera(&transform.into(), Some(&Projection::custom(perspective)));
        assert!(
            (custom.vertical_fov - 1.2).abs() < 1e-5 && (custom.aspect - 2.0).abs() < 1e-5,
            "{custom:?}"
        );
    }

    #[test]
    fn parallel_rays_get_a_tiny_field_of_view() {
        let area = Rect::new(-3.0, -1.0, 3.0, 1.0);
        let projection = OrthographicProjection { area, ..OrthographicProjection::default_3d() };
        let view = CameraView::from_camera(
            &GlobalTransform::IDENTITY,
            Some(&Projection::Orthographic(projection)),
        );
        assert_eq!((view.vertical_fov, view.aspect), (PARALLEL_FOV, 3.0));
        let bare = CameraView::from_camera(&GlobalTransform::IDENTITY, None);
        assert_eq!((bare.vertical_fov, bare.aspect), (std::f32::consts::FRAC_PI_4, 1.0));
    }
}
