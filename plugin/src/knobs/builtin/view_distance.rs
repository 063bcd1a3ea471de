//! Distance beyond which a camera draws no mesh.

use std::any::TypeId;

use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{NoFrustumCulling, VisibilitySystems, VisibleEntities};
use bevy::prelude::*;

use crate::knobs::{FieldKnob, Knob, KnobField};

/// A quarter, a half, three quarters or all of the distance to the camera's far plane. Lower levels
/// leave out meshes whose bounds lie farther away, with their draws; fog hides where they end.
/// Their shadows and their indirect light stay.
///
/// Bevy does not cull by the far plane, so this does at every level but the last, which leaves
/// Bevy's visibility as it is. Meshes with `NoFrustumCulling`, a sky dome for example, and those
/// without bounds stay.
pub(super) fn knob() -> FieldKnob {
    let levels =
        [25, 50, 75, 100].map(|percent| (f64::from(percent) / 100.0, format!("{percent}%")));
    FieldKnob::new(
        Knob::labelled("view_distance", levels),
        KnobField::new(|share: &mut ViewShare| &mut share.0, |level, _| level.value as f32).added(),
    )
}

/// Share of the distance to the far plane, 0 to 1.
#[derive(Component, Clone, Copy, Default)]
struct ViewShare(f32);

pub(super) fn build(app: &mut App) {
    app.add_systems(
        PostUpdate,
        cull_by_distance
            .after(VisibilitySystems::CheckVisibility)
            .run_if(any_with_component::<ViewShare>),
    );
}

/// Far plane of a projection, metres; infinite where it has none.
fn far(projection: &Projection) -> f32 {
    match projection {
        Projection::Perspective(lens) => lens.far,
        Projection::Orthographic(lens) => lens.far,
        Projection::Custom(_) => f32::INFINITY,
    }
}

fn cull_by_distance(
    mut cameras: Query<(&ViewShare, &Camera, &Projection, &GlobalTransform, &mut VisibleEntities)>,
    meshes: Query<(&GlobalTransform, &Aabb), Without<NoFrustumCulling>>,
) {
    for (share, camera, projection, transform, mut visible) in &mut cameras {
        let distance = share.0 * far(projection);
        if !camera.is_active || share.0 >= 1.0 || !distance.is_finite() {
            continue;
        }
        let eye = transform.translation_vec3a();
        // `retain` keeps the order, on which Bevy relies.
        visible.get_mut(TypeId::of::<Mesh3d>()).retain(|mesh| {
            let Ok((place, bounds)) = meshes.get(*mesh) else { return true };
            let center = place.affine().transform_point3a(bounds.center);
            let nearest = eye.distance(center) - place.radius_vec3a(bounds.half_extents);
            // Meshes at NaN are left to Bevy.
            let is_beyond = nearest > distance;
            !is_beyond
        });
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3A;

    use super::*;
    use crate::knobs::KnobDriver;

    fn seen(level: usize, far: f32, places: &[f32]) -> usize {
        let mut app = App::new();
        build(&mut app);
        let mut visible = VisibleEntities::default();
        for place in places {
            let bounds = Aabb { center: Vec3A::ZERO, half_extents: Vec3A::splat(0.5) };
            let at = GlobalTransform::from_translation(Vec3::X * *place);
            let mesh = app.world_mut().spawn((bounds, at)).id();
            visible.push(mesh, TypeId::of::<Mesh3d>());
        }
        let dome = (Aabb::default(), GlobalTransform::from_xyz(1e6, 0.0, 0.0), NoFrustumCulling);
        let dome = app.world_mut().spawn(dome).id();
        visible.push(dome, TypeId::of::<Mesh3d>());
        let lens = Projection::Perspective(PerspectiveProjection {
            far,
            ..PerspectiveProjection::default()
        });
        let camera = (Camera::default(), lens, GlobalTransform::IDENTITY, visible);
        let camera = app.world_mut().spawn(camera).id();
        let levels = knob().knob().levels;
        knob().apply(app.world_mut(), camera, &levels[level]);
        app.update();
        let visible = app.world().get::<VisibleEntities>(camera).expect("a list");
        assert!(visible.get(TypeId::of::<Mesh3d>()).contains(&dome), "a sky dome stays");
        visible.len(TypeId::of::<Mesh3d>()) - 1
    }

    #[test]
    fn lower_levels_draw_fewer_meshes() {
        let places: Vec<f32> = (0..100).map(|place| place as f32).collect();
        let counts = [0, 1, 2, 3].map(|level| seen(level, 100.0, &places));
        // Bounds that reach into the distance count; Bevy's own culling is not part of this test.
        assert_eq!(counts, [26, 51, 76, 100]);
    }

    #[test]
    fn odd_numbers_cull_nothing() {
        let odd = [f32::NAN, f32::INFINITY, 0.0];
        for far in [f32::NAN, f32::INFINITY] {
            assert_eq!(seen(0, far, &odd), 3, "{far}");
        }
        assert_eq!(seen(0, 0.0, &[f32::NAN, 0.0]), 2);
    }
}
