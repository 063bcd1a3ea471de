//! The camera that is measured.

use bevy::anti_alias::contrast_adaptive_sharpening::ContrastAdaptiveSharpening;
use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::Smaa;
use bevy::anti_alias::taa::TemporalAntiAliasing;
use bevy::asset::{Assets, Handle, RenderAssetUsages};
use bevy::camera::{Camera, Hdr, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use bevy::image::Image;
use bevy::post_process::auto_exposure::AutoExposure;
use bevy::post_process::bloom::Bloom;
use bevy::post_process::dof::DepthOfField;
use bevy::post_process::effect_stack::{ChromaticAberration, LensDistortion, Vignette};
use bevy::post_process::motion_blur::MotionBlur;
use bevy::render::camera::TemporalJitter;
use bevy::render::render_resource::{
    Extent3d, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
};
use bevy::render::view::Msaa;

use super::{Component, Output, StageOptions};
use crate::gi::{FrugalGi, GiOutput, GiShading};

/// Makes `camera` render what `options` ask for, and returns its target. Its own effects stay, but in
/// radiance, which must contain none but occlusion.
pub(super) fn take(world: &mut World, camera: Entity, options: &StageOptions) -> Handle<Image> {
    let target = world.resource_mut::<Assets<Image>>().add(target_image(options));
    let mut camera = world.entity_mut(camera);
    camera.insert(RenderTarget::Image(target.clone().into()));
    if let Some(mut camera) = camera.get_mut::<Camera>() {
        camera.is_active = true;
        camera.viewport = None;
        camera.sub_camera_view = None;
    }
    if options.output == Output::Radiance {
        camera.insert((Tonemapping::None, DebandDither::Disabled, Msaa::Off, Hdr));
        camera.remove::<(Bloom, DepthOfField, MotionBlur, AutoExposure)>();
        camera.remove::<(ChromaticAberration, LensDistortion, Vignette)>();
        camera.remove::<(Smaa, Fxaa, TemporalAntiAliasing, ContrastAdaptiveSharpening)>();
        camera.remove::<TemporalJitter>();
    }
    let Some(mut gi) = camera.get_mut::<FrugalGi>() else { return target };
    // What is measured is motion, and a picture at rest is that of its last gather.
    gi.rest_frames = 0;
    match options.component {
        Component::Full => {}
        Component::Direct => gi.vpl_count = 0,
        Component::Global => gi.output = GiOutput::IndirectOnly,
        Component::Indirect => {
            gi.output = GiOutput::IndirectOnly;
            (gi.emissive, gi.environment_samples) = (false, 0);
            gi.shading = GiShading::Lambertian;
        }
    }
    target
}

/// Names of the knobs that would undo what `options` ask of the camera.
pub(super) fn overridden_knobs(options: &StageOptions) -> &'static [&'static str] {
    match options.component {
        Component::Direct => &["gi_vpl_count"],
        Component::Indirect => &["gi_environment_samples"],
        Component::Full | Component::Global => &[],
    }
}

fn target_image(options: &StageOptions) -> Image {
    let format = match options.output {
        Output::Display => TextureFormat::Rgba8UnormSrgb,
        Output::Radiance => TextureFormat::Rgba16Float,
    };
    let size = Extent3d { width: options.size.x, height: options.size.y, depth_or_array_layers: 1 };
    let mut image = Image::new_uninit(
        size,
        TextureDimension::D2,
        format,
        RenderAssetUsages::RENDER_WORLD | RenderAssetUsages::MAIN_WORLD,
    );
    image.texture_descriptor = TextureDescriptor {
        label: Some("frugal/stage/target"),
        usage: TextureUsages::RENDER_ATTACHMENT
            | TextureUsages::COPY_SRC
            | TextureUsages::TEXTURE_BINDING,
        ..image.texture_descriptor
    };
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radiance_has_no_effects_of_a_lens() {
        let mut world = World::new();
        world.init_resource::<Assets<Image>>();
        let lens = (Vignette::default(), LensDistortion::default(), Bloom::default());
        let camera = world.spawn((Camera::default(), lens)).id();
        let effects = |world: &World| {
            let camera = world.entity(camera);
            let lens = [camera.contains::<Vignette>(), camera.contains::<LensDistortion>()];
            (lens, camera.contains::<Bloom>())
        };
        take(&mut world, camera, &StageOptions::default());
        assert_eq!(effects(&world), ([true; 2], true), "a display has them");
        let radiance = StageOptions { output: Output::Radiance, ..StageOptions::default() };
        take(&mut world, camera, &radiance);
        assert_eq!(effects(&world), ([false; 2], false));
    }
}
