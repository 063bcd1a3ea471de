//! The lights that bounce, and their data for the shader.

use bevy::camera::primitives::{Frustum, Sphere};
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::color::{Color, ColorToComponents};
use bevy::ecs::prelude::*;
use bevy::light::{DirectionalLight, PointLight, SpotLight, SunDisk};
use bevy::math::{Quat, Vec2, Vec3};
use bevy::render::render_resource::ShaderType;
use bevy::transform::components::GlobalTransform;

/// `rsm/resolve.wgsl`'s `Light`: one map's light and its range in the store.
#[derive(Component, ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::gi) struct RsmLight {
    /// Linear RGB: lux of parallel light, else candela.
    pub intensity: Vec3,
    /// Of a texel: area across the rays (m²) where light is parallel, else solid angle in the
    /// middle of the view (sr).
    pub texel_area_or_solid_angle: f32,
    /// World space, metres.
    pub position: Vec3,
    /// 1/m²; 0 where the range is infinite.
    pub inverse_range_squared: f32,
    /// World space, unit length.
    pub direction: Vec3,
    /// Spot: attenuation is saturate(cos · scale + offset)².
    pub cone_scale: f32,
    /// See `cone_scale`.
    pub cone_offset: f32,
    /// First texel in the store.
    pub texel_offset: u32,
    /// Texels along the map's edge. The map's texels stay in the store while it is not rendered.
    pub resolution: u32,
    /// Parallel: share of half the map's width and height over which light fades towards its
    /// border.
    pub fade: Vec2,
}

/// Shape of a light's emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LightShape {
    /// Parallel rays.
    Directional,
    /// A cone of `outer` radians half angle.
    Spot {
        /// Radians.
        inner: f32,
        /// Radians, below π/2.
        outer: f32,
    },
    /// In all directions.
    Point,
}

/// A light that bounces.
#[derive(Clone, Debug)]
pub(super) struct BouncingLight {
    pub entity: Entity,
    pub layers: RenderLayers,
    pub shape: LightShape,
    /// Linear RGB, lux or candela.
    pub intensity: Vec3,
    pub position: Vec3,
    pub rotation: Quat,
    /// Metres; infinite where parallel.
    pub range: f32,
    /// Of the disk of parallel light in the sky, radians.
    pub disk: f32,
}

/// A light's entity, component, place, render layers and visibility.
pub(super) type Placed<'a, L> =
    (Entity, &'a L, &'a GlobalTransform, Option<&'a RenderLayers>, &'a InheritedVisibility);

/// Factor of the importance of a light that reaches nothing in view: its light comes from there only
/// by a further reflection.
const OUT_OF_VIEW: f32 = 0.1;

/// Candela per lumen of a point or spot light: Bevy divides both by 4π, so that a spot is as bright
/// in its cone as a point light.
const CANDELA_PER_LUMEN: f32 = 1.0 / (4.0 * std::f32::consts::PI);

impl BouncingLight {
    pub(crate) fn directional(
        (entity, light, at, layers, visible): Placed<DirectionalLight>,
        disk: Option<&SunDisk>,
    ) -> Option<Self> {
        let intensity = linear(light.color) * light.illuminance;
        Self {
            disk: disk.map_or_else(|| SunDisk::default().angular_size, |disk| disk.angular_size),
            position: Vec3::ZERO,
            ..Self::new((entity, at, layers), LightShape::Directional, intensity, f32::INFINITY)
        }
        .if_valid(visible)
    }

    pub(crate) fn spot((entity, light, at, layers, visible): Placed<SpotLight>) -> Option<Self> {
        // As Bevy clamps it.
        let outer = light.outer_angle.min(std::f32::consts::FRAC_PI_2 - 1e-4);
        let shape = LightShape::Spot { inner: light.inner_angle.min(outer), outer };
        let intensity = linear(light.color) * light.intensity * CANDELA_PER_LUMEN;
        Self::new((entity, at, layers), shape, intensity, light.range).if_valid(visible)
    }

    pub(crate) fn point((entity, light, at, layers, visible): Placed<PointLight>) -> Option<Self> {
        let intensity = linear(light.color) * light.intensity * CANDELA_PER_LUMEN;
        Self {
            rotation: Quat::IDENTITY,
            ..Self::new((entity, at, layers), LightShape::Point, intensity, light.range)
        }
        .if_valid(visible)
    }

    fn new(
        (entity, at, layers): (Entity, &GlobalTransform, Option<&RenderLayers>),
        shape: LightShape,
        intensity: Vec3,
        range: f32,
    ) -> Self {
        let (position, rotation) = (at.translation(), at.rotation());
        let layers = layers.cloned().unwrap_or_default();
        Self { entity, layers, shape, intensity, position, rotation, range, disk: 0.0 }
    }

    /// `None` for a hidden light, and one of zero, negative or non-finite intensity or of a non-finite pose: it
    /// costs nothing.
    fn if_valid(self, visible: &InheritedVisibility) -> Option<Self> {
        let lit = self.intensity.is_finite()
            && self.intensity.min_element() >= 0.0
            && self.intensity.max_element() > 0.0;
        let has_pose = self.position.is_finite() && self.rotation.is_finite() && self.range > 0.0;
        (visible.get() && lit && has_pose).then_some(self)
    }

    /// Illuminance in lux at a camera, by which lights are ranked when there are too many: what it
    /// lights on the image falls with the square of the distance, too. Less where it lights nothing
    /// in view.
    pub(crate) fn importance(&self, camera: Vec3, frustum: &Frustum) -> f32 {
        let brightest = self.intensity.max_element();
        if self.shape == LightShape::Directional {
            return brightest;
        }
        let reach = Sphere { center: self.position.into(), radius: self.range };
        let share = if frustum.intersects_sphere(&reach, false) { 1.0 } else { OUT_OF_VIEW };
        share * brightest / self.position.distance_squared(camera).max(1.0)
    }

    /// Texels along the edge of each of its maps when a single one has `resolution`.
    pub(crate) fn resolution(&self, resolution: u32) -> u32 {
        // A face of a quarter of the size has texels of 90° ÷ resolution · 4: at 3 m about as large
        // as those of a sun's near cascade. Small resolutions are not reduced.
        if self.shape == LightShape::Point {
            (resolution / 4).max(32).min(resolution / 2).max(8)
        } else {
            resolution
        }
    }

    /// `saturate(cos · scale + offset)²` is the cone's attenuation.
    pub(crate) fn cone(&self) -> (f32, f32) {
        match self.shape {
            LightShape::Spot { inner, outer } => {
                let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-4);
                (scale, -outer.cos() * scale)
            }
            _ => (0.0, 1.0),
        }
    }
}

fn linear(color: Color) -> Vec3 {
    color.to_linear().to_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dark_and_invalid_lights_do_not_bounce() {
        let entity = Entity::PLACEHOLDER;
        let is_lit = |light: &PointLight, at: Vec3| {
            let at = GlobalTransform::from_translation(at);
            let visible = InheritedVisibility::VISIBLE;
            BouncingLight::point((entity, light, &at, None, &visible)).is_some()
        };
        let point = |intensity| is_lit(&PointLight { intensity, ..Default::default() }, Vec3::ZERO);
        assert_eq!(
            [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-20, 1e20].map(point),
            [false, false, false, false, true, true]
        );
        let at = |position| is_lit(&PointLight::default(), position);
        assert!(!at(Vec3::NAN) && at(Vec3::splat(1e6)));
    }

    #[test]
    fn a_spot_is_full_inside_and_dark_outside_its_cone() {
        let light = SpotLight { inner_angle: 0.3, outer_angle: 0.6, ..Default::default() };
        let at = GlobalTransform::IDENTITY;
        let spot = |visible: InheritedVisibility| {
            BouncingLight::spot((Entity::PLACEHOLDER, &light, &at, None, &visible))
        };
        assert!(spot(InheritedVisibility::HIDDEN).is_none());
        let light = spot(InheritedVisibility::VISIBLE).expect("a lit spot");
        let (scale, offset) = light.cone();
        let attenuation = |angle: f32| (angle.cos() * scale + offset).clamp(0.0, 1.0).powi(2);
        assert!((attenuation(0.3) - 1.0).abs() < 1e-5 && attenuation(0.6) < 1e-5);
        assert!((0.01..0.99).contains(&attenuation(0.45)));
    }
}
