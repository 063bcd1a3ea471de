//! Frontier maps in an app: the asset, its loader, and a Bevy camera's view of them.

use bevy::app::{App, Plugin};
use bevy::asset::io::Reader;
use bevy::asset::{AssetApp, AssetLoader, LoadContext};
use bevy::camera::Projection;
use bevy::reflect::TypePath;
use bevy::transform::components::GlobalTransform;

pub use frugal_core::frontier::*;

/// Asset loader of [`FrontierMap`]s from `*.pareto.ron` files: RON text in UTF-8, validated. Fails
/// with [`FrontierMapLoadError`].
#[derive(Default, TypePath)]
pub struct FrontierMapLoader;

/// Why a frontier map did not load. The asset server adds the file's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrontierMapLoadError {
    /// The file cannot be read.
    #[error("frontier map cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// The file is not UTF-8 text.
    #[error("frontier map is not UTF-8 text from byte {} on: run `frugal precompute` again", .0.valid_up_to())]
    NotText(#[from] std::str::Utf8Error),
    /// The text is not a valid map of this version.
    #[error(transparent)]
    Map(#[from] FrontierMapError),
}

impl AssetLoader for FrontierMapLoader {
    type Asset = FrontierMap;
    type Settings = ();
    type Error = FrontierMapLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _: &(),
        _: &mut LoadContext<'_>,
    ) -> Result<FrontierMap, FrontierMapLoadError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        Ok(FrontierMap::from_ron(std::str::from_utf8(&bytes)?)?)
    }

    fn extensions(&self) -> &[&str] {
        &["pareto.ron"]
    }
}

/// Registers [`FrontierMap`] as an asset that the asset server loads and reloads. Needs Bevy's
/// `AssetPlugin`, added before.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrontierMapPlugin;

impl Plugin for FrontierMapPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<FrontierMap>().init_asset_loader::<FrontierMapLoader>();
    }
}

/// Field of view, in radians, that represents the parallel rays of an orthographic camera.
const PARALLEL_FOV: f32 = 0.001;

/// The view of a Bevy camera. Without a projection the image is square with Bevy's default
/// field of view (π/4); an orthographic camera has a field of view of 0.001. An invalid camera,
/// such as one with an empty viewport, may give NaN, which look-ups accept.
pub fn camera_view(transform: &GlobalTransform, projection: Option<&Projection>) -> CameraView {
    let (_, rotation, position) = transform.to_scale_rotation_translation();
    let (vertical_fov, aspect) = match projection {
        Some(Projection::Perspective(perspective)) => (perspective.fov, perspective.aspect_ratio),
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
    CameraView { position, rotation, vertical_fov, aspect }
}

#[cfg(test)]
mod tests {
    use bevy::camera::{OrthographicProjection, PerspectiveProjection};
    use bevy::math::{Rect, Vec3};
    use bevy::transform::components::Transform;

    use super::*;

    #[test]
    fn a_bevy_camera_gives_its_view_whatever_its_scale() {
        let transform = Transform::from_xyz(1.0, 2.0, 3.0)
            .looking_to(Vec3::X, Vec3::Y)
            .with_scale(Vec3::splat(5.0));
        let perspective =
            PerspectiveProjection { fov: 1.2, aspect_ratio: 2.0, ..Default::default() };
        let view =
            camera_view(&transform.into(), Some(&Projection::Perspective(perspective.clone())));
        assert_eq!(
            (view.position, view.vertical_fov, view.aspect),
            (Vec3::new(1.0, 2.0, 3.0), 1.2, 2.0)
        );
        assert!(view.rotation.angle_between(transform.rotation) < 1e-3);
        let custom = camera_view(&transform.into(), Some(&Projection::custom(perspective)));
        assert!(
            (custom.vertical_fov - 1.2).abs() < 1e-5 && (custom.aspect - 2.0).abs() < 1e-5,
            "{custom:?}"
        );
    }

    #[test]
    fn parallel_rays_get_a_tiny_field_of_view() {
        let area = Rect::new(-3.0, -1.0, 3.0, 1.0);
        let projection = OrthographicProjection { area, ..OrthographicProjection::default_3d() };
        let view =
            camera_view(&GlobalTransform::IDENTITY, Some(&Projection::Orthographic(projection)));
        assert_eq!((view.vertical_fov, view.aspect), (PARALLEL_FOV, 3.0));
        let bare = camera_view(&GlobalTransform::IDENTITY, None);
        assert_eq!((bare.vertical_fov, bare.aspect), (std::f32::consts::FRAC_PI_4, 1.0));
    }
}
