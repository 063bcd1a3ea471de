//! Light without a punctual light: emissive surfaces and the sky.

pub(crate) mod emissive;
pub(crate) mod sky;

use std::f64::consts::PI;

use bevy::color::LinearRgba;
use bevy::ecs::entity::Entity;
use bevy::math::primitives::Plane3d;
use bevy::math::{Quat, Vec2, Vec3};
use bevy::mesh::{Mesh, MeshBuilder, Meshable};
use bevy::pbr::StandardMaterial;
use bevy::transform::components::Transform;
use frugal::stage::{Component, Radiance, Stage};
use frugal_tests::{meshes, set};

/// Exposure of a bare stage: 1 ÷ (1.2 · 2⁸).
const EXPOSURE: f32 = 1.0 / (1.2 * 256.0);
/// Full resolution, with rays.
const RAYS: &str = "min,gi_refresh_period=1,gi_vpl_count=1024,gi_interleave=2x2,gi_visibility=fine,gi_pixel_fraction=1/1,resolution_scale=100%";
const NITS: f32 = 1000.0;

/// An albedo of 0.8 after quantisation in the G-buffer.
fn albedo() -> f64 {
    meshes::stored_albedo(0.8)
}

/// Tiles along the side of a floor.
const FLOOR_TILES: u32 = 31;
const FLOOR_TRIANGLES: u32 = 2 * FLOOR_TILES * FLOOR_TILES;

fn bare(component: Component) -> Stage {
    let mut stage = set::bare(vec![], set::radiance_options(48, 27, component));
    set::apply(&mut stage, RAYS);
    set::make_lambertian(&mut stage);
    stage
}

/// A black material that emits `nits`.
fn emissive_material(nits: f32) -> StandardMaterial {
    StandardMaterial {
        emissive: LinearRgba::rgb(1.0, 1.0, 1.0) * (nits * EXPOSURE),
        ..meshes::diffuse(0.0, 0.0, 0.0)
    }
}

/// Spawns a rectangle of `size` metres at `center`, facing down.
fn spawn_panel(stage: &mut Stage, center: Vec3, size: Vec2, material: StandardMaterial) -> Entity {
    let mesh = Plane3d::new(Vec3::Y, size * 0.5).mesh().build();
    let turned = Quat::from_rotation_x(std::f32::consts::PI);
    meshes::spawn(stage, mesh, material, Transform::from_translation(center).with_rotation(turned))
}

/// Spawns a tiled floor: a software rasteriser loses depth precision in triangles that are
/// thousands of times larger than their visible part (SwiftShader by half a pixel's width).
fn spawn_floor(stage: &mut Stage, size: f32) {
    let mut mesh =
        Plane3d::new(Vec3::Y, Vec2::splat(0.5 * size)).mesh().subdivisions(FLOOR_TILES - 1).build();
    mesh.remove_attribute(Mesh::ATTRIBUTE_UV_0);
    meshes::spawn(stage, mesh, meshes::diffuse(0.8, 0.8, 0.8), Transform::default());
}

/// Points the camera at a few centimetres of floor around the origin.
fn look_at_floor(stage: &mut Stage) {
    set::look(stage, Vec3::new(0.0, 0.06, 0.03), Vec3::ZERO);
}

fn deviation(radiance: &Radiance, expected: f64) -> (f64, f64) {
    let off: Vec<f64> =
        radiance.rgb.iter().flatten().map(|value| f64::from(*value) / expected - 1.0).collect();
    assert!(off.iter().all(|value| value.is_finite()), "a pixel is not finite");
    (
        off.iter().map(|off| off.abs()).fold(0.0, f64::max),
        off.iter().sum::<f64>() / off.len() as f64,
    )
}

/// Form factor of a horizontal point and a parallel rectangle of `width` × `length` metres, centred
/// `height` metres above it.
fn form_factor(width: f64, length: f64, height: f64) -> f64 {
    let (x, y) = (width / 2.0 / height, length / 2.0 / height);
    let (a, b) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    4.0 / (2.0 * PI) * (x / a * (y / a).atan() + y / b * (x / b).atan())
}

fn assert_finite(label: &str, stage: &mut Stage) -> f64 {
    let radiance = set::radiance(stage);
    assert!(
        radiance.rgb.iter().flatten().all(|value| value.is_finite() && *value >= 0.0),
        "{label}: a pixel is not finite or is negative"
    );
    radiance.mean()
}
