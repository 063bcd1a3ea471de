//! What a map can show, to tell which changes of the scene it must be rendered again for.

use bevy::camera::primitives::Aabb;
use bevy::camera::{Projection, ScalingMode};
use bevy::math::{Affine3A, Vec3A};
use bevy::transform::components::{GlobalTransform, Transform};

/// Centre in world space and radius of a sphere around a mesh, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BoundingSphere {
    pub center: Vec3A,
    pub radius: f32,
}

/// Centre of a mesh's box in world space, and half its sides along the world's axes.
pub(super) fn world_box(aabb: &Aabb, transform: &GlobalTransform) -> (Vec3A, Vec3A) {
    let affine = transform.affine();
    (affine.transform_point3a(aabb.center), affine.matrix3.abs() * aabb.half_extents)
}

impl BoundingSphere {
    /// The sphere around a mesh's box.
    pub(super) fn mesh(aabb: &Aabb, transform: &GlobalTransform) -> Self {
        let (center, half) = world_box(aabb, transform);
        Self { center, radius: half.length() }
    }
}

/// The part of the world that a map's camera can show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MapExtent {
    /// All of it.
    Everything,
    /// Of a light with a position: as far as it reaches.
    Near(BoundingSphere),
    /// Oriented box of a directional light: transform and half extents.
    Inside { map_from_world: Affine3A, half: Vec3A },
}

impl MapExtent {
    /// That of a camera, whose transform is global.
    pub(super) fn new(transform: &Transform, projection: &Projection) -> Self {
        let found = match projection {
            Projection::Perspective(lens) => Self::Near(BoundingSphere {
                center: transform.translation.into(),
                // To the corners of the far plane.
                radius: lens.far * (1.0 + 2.0 * (0.5 * lens.fov).tan().powi(2)).sqrt(),
            }),
            Projection::Orthographic(lens) => match lens.scaling_mode {
                ScalingMode::Fixed { width, height } => Self::Inside {
                    map_from_world: transform.compute_affine().inverse(),
                    half: 0.5 * Vec3A::new(width, height, lens.far),
                },
                _ => Self::Everything,
            },
            Projection::Custom(_) => Self::Everything,
        };
        if found.is_finite() { found } else { Self::Everything }
    }

    fn is_finite(&self) -> bool {
        match self {
            Self::Everything => true,
            Self::Near(around) => around.center.is_finite() && around.radius.is_finite(),
            Self::Inside { map_from_world, half } => map_from_world.is_finite() && half.is_finite(),
        }
    }

    /// Whether something there may be in the map. True where either is not finite.
    pub(super) fn meets(&self, other: &BoundingSphere) -> bool {
        let is_outside = match self {
            Self::Everything => false,
            Self::Near(own) => {
                let reach = own.radius + other.radius;
                own.center.distance_squared(other.center) > reach * reach
            }
            Self::Inside { map_from_world, half } => {
                // The camera looks along −Z from its near plane.
                let at = map_from_world.transform_point3a(other.center) + Vec3A::Z * half.z;
                (at.abs() - *half).max_element() > other.radius
            }
        };
        !is_outside
    }
}

#[cfg(test)]
mod tests {
    use bevy::camera::{OrthographicProjection, PerspectiveProjection};
    use bevy::math::Vec3;

    use super::*;

    fn at(x: f32, y: f32, z: f32) -> BoundingSphere {
        BoundingSphere { center: Vec3A::new(x, y, z), radius: 1.0 }
    }

    #[test]
    fn a_point_light_reaches_as_far_as_its_range() {
        let lens = PerspectiveProjection {
            fov: std::f32::consts::FRAC_PI_2,
            far: 10.0,
            ..Default::default()
        };
        let extent = MapExtent::new(&Transform::from_xyz(5.0, 0.0, 0.0), &lens.clone().into());
        // To the corner of a cube's face at 10 m, and the other's radius.
        assert!(
            extent.meets(&at(5.0 + 18.2, 0.0, 0.0)) && !extent.meets(&at(5.0 + 18.5, 0.0, 0.0))
        );
        let endless = PerspectiveProjection { far: f32::INFINITY, ..lens };
        assert_eq!(MapExtent::new(&Transform::IDENTITY, &endless.into()), MapExtent::Everything);
    }

    #[test]
    fn parallel_light_meets_what_is_in_its_box() {
        let lens = OrthographicProjection {
            near: 0.0,
            far: 20.0,
            scaling_mode: ScalingMode::Fixed { width: 8.0, height: 6.0 },
            ..OrthographicProjection::default_3d()
        };
        let down = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
        let extent = MapExtent::new(&down, &lens.into());
        for (around, expected) in [
            (at(0.0, 0.0, 0.0), true),
            (at(4.9, 0.0, 0.0), true),
            (at(5.1, 0.0, 0.0), false),
            (at(0.0, 0.0, 3.9), true),
            (at(0.0, 0.0, 4.1), false),
            (at(0.0, 10.9, 0.0), true),
            (at(0.0, 11.1, 0.0), false),
            (at(0.0, -10.9, 0.0), true),
            (at(0.0, -11.1, 0.0), false),
        ] {
            assert_eq!(extent.meets(&around), expected, "{around:?}");
        }
    }

    #[test]
    fn what_is_not_finite_may_be_anywhere() {
        let lens = PerspectiveProjection { far: 10.0, ..Default::default() };
        let extent = MapExtent::new(&Transform::IDENTITY, &lens.into());
        assert!(extent.meets(&at(f32::NAN, 0.0, 0.0)));
        assert!(extent.meets(&BoundingSphere { center: Vec3A::splat(1e9), radius: f32::INFINITY }));
        assert!(extent.meets(&BoundingSphere { center: Vec3A::splat(1e9), radius: f32::NAN }));
    }
}
