//! Path-traced references for rendered images, on the CPU.

use std::sync::Arc;

use bevy::asset::Assets;
use bevy::math::UVec2;
use bevy::pbr::StandardMaterial;
use bevy::prelude::AlphaMode;
use frugal::scene::{self, Environment, LoadedScene, SceneDescription};
use frugal::stage::Stage;
use frugal_trace::bsdf::Shading;
use frugal_trace::integrator::{
    FirstHit, Pixels, ReferenceScene, Settings, View, Watch, render, surfaces,
};
use frugal_trace::metrics::Radiance;
use frugal_trace::scene::CameraPose;

use crate::set;

/// `scene` without its environment light, of which the reference would trace bounces that the
/// measured methods do not render.
pub fn without_environment(scene: &SceneDescription) -> SceneDescription {
    SceneDescription { environment: Environment::None, ..scene.clone() }
}

/// The scene and the time of a view in the arguments of benchmarks, `SCENE@SECONDS`: a scene of the
/// repository or a scene file.
///
/// # Panics
/// If it is neither, or the time no number.
pub fn view(text: &str) -> (SceneDescription, f32) {
    let (name, seconds) = text.split_once('@').unwrap_or((text, "0"));
    let seconds = seconds.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
    let scene = if name.ends_with(".ron") {
        scene::load(name).unwrap_or_else(|error| panic!("{error}")).description
    } else {
        set::scene(name)
    };
    (scene, seconds)
}

/// Settings of a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tracing {
    /// Width and height, pixels.
    pub size: UVec2,
    /// Paths per pixel.
    pub samples: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Start of the paths within a pixel.
    pub pixels: Pixels,
}

/// One bounce of the scene's punctual lights between Lambertian surfaces, nits.
pub fn one_bounce(scene: &SceneDescription, pose: CameraPose, tracing: Tracing) -> Radiance {
    bounces(scene, pose, tracing, Some(1))
}

/// [`one_bounce`] with up to `most` bounces, or all.
pub fn bounces(
    scene: &SceneDescription,
    pose: CameraPose,
    tracing: Tracing,
    most: Option<u32>,
) -> Radiance {
    let traced = traced(&set::loaded(&without_environment(scene)));
    trace(&traced, &scene.view(pose, tracing.size), tracing, most)
}

/// What a square view of 90 degrees shows of surfaces that punctual lights illuminate, without bounces, nits.
pub fn seen_from(scene: &SceneDescription, pose: CameraPose, size: u32) -> (View, Radiance) {
    let traced = traced(&set::loaded(&without_environment(scene)));
    let size = UVec2::splat(size);
    let view = View { pose, vertical_fov_degrees: 90.0, near: 0.001, size };
    let settings = Settings {
        samples: 4,
        bounces: Some(0),
        shading: Shading::Lambertian,
        ..Default::default()
    };
    let image = render(&traced, &view, &settings, Watch::default());
    (view, image.unwrap_or_else(|| panic!("nothing interrupts")).direct)
}

/// [`one_bounce`] on surfaces without textures, as [`strip_textures`] leaves them: the path tracer
/// reads unfiltered texels and the renderer filters them, so that at single pixels textures would
/// differ more than light does.
pub fn one_bounce_untextured(
    scene: &SceneDescription,
    pose: CameraPose,
    tracing: Tracing,
) -> Radiance {
    trace(&untextured(scene), &scene.view(pose, tracing.size), tracing, Some(1))
}

/// The surface at the centre of each pixel, without alpha masks.
pub fn surfaces_untextured(
    scene: &SceneDescription,
    pose: CameraPose,
    size: UVec2,
) -> Vec<Option<FirstHit>> {
    surfaces(&untextured(scene), &scene.view(pose, size))
}

fn untextured(scene: &SceneDescription) -> ReferenceScene {
    let LoadedScene { description, geometry, .. } = set::loaded(&without_environment(scene));
    let mut geometry = Arc::unwrap_or_clone(geometry);
    geometry.textures.clear();
    for material in &mut geometry.materials {
        (material.base_color_texture, material.alpha) =
            (None, frugal_trace::scene::AlphaMode::Opaque);
    }
    traced(&LoadedScene::with_geometry(description, geometry))
}

fn traced(scene: &LoadedScene) -> ReferenceScene {
    scene.reference().unwrap_or_else(|error| panic!("{error}"))
}

/// Removes the textures and alpha masks of all materials of a stage.
pub fn strip_textures(stage: &mut Stage) {
    let mut materials = stage.world_mut().resource_mut::<Assets<StandardMaterial>>();
    for (_, material) in materials.iter_mut() {
        (material.base_color_texture, material.alpha_mode) = (None, AlphaMode::Opaque);
    }
}

fn trace(
    scene: &ReferenceScene,
    view: &View,
    Tracing { samples, seed, pixels, .. }: Tracing,
    bounces: Option<u32>,
) -> Radiance {
    let settings = Settings {
        samples,
        bounces,
        seed,
        shading: Shading::Lambertian,
        pixels,
        ..Default::default()
    };
    render(scene, view, &settings, Watch::default())
        .unwrap_or_else(|| panic!("nothing interrupts"))
        .indirect
}

/// Mean over pixels and channels of |a − b|.
pub fn mean_absolute_difference<'a>(
    a: impl IntoIterator<Item = &'a [f32; 3]>,
    b: impl IntoIterator<Item = &'a [f32; 3]>,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0u32);
    for (a, b) in a.into_iter().flatten().zip(b.into_iter().flatten()) {
        sum += (f64::from(*a) - f64::from(*b)).abs();
        count += 1;
    }
    sum / f64::from(count.max(1))
}
