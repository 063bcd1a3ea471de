//! Every level of every built-in knob takes effect, and switching back leaves no trace.

use std::collections::BTreeMap;

use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::{Smaa, SmaaPreset};
use bevy::asset::Assets;
use bevy::color::Srgba;
use bevy::ecs::query::With;
use bevy::image::Image;
use bevy::light::{
    CascadeShadowConfig, DirectionalLight, DirectionalLightShadowMap, PointLightShadowMap,
};
use bevy::math::{UVec2, Vec3};
use bevy::pbr::{
    ScreenSpaceAmbientOcclusion, ScreenSpaceAmbientOcclusionQualityLevel, StandardMaterial,
};
use bevy::post_process::bloom::Bloom;
use bevy::render::camera::MipBias;
use bevy::render::render_resource::TextureFormat;
use bevy_frugal_gi::gi::{FrugalGi, GiVisibility, RsmView};
use bevy_frugal_gi::knobs::{AppliedKnobs, KnobLevels};
use bevy_frugal_gi::resolution::ResolutionScale;
use frugal::scene::Environment;
use frugal::stage::Stage;
use frugal_tests::set;
use frugal_trace::metrics::{Picture, Reference};

tests!(
    every_level_is_applied_changes_the_image_and_leaves_no_trace,
    bloom_follows_the_resolution_scale,
    cheaper_levels_evaluate_fewer_pairs
);

const SIZE: UVec2 = UVec2::new(64, 36);

/// A textured scene with sun and ambient light, in which every knob has an effect.
fn stage() -> Stage {
    let mut scene = set::scene("courtyard");
    scene.environment = Environment::Constant([900.0; 3]);
    let mut stage = set::open(&scene, set::options(SIZE.x, SIZE.y));
    add_mip_levels(&mut stage);
    set::look(&mut stage, Vec3::new(4.9, 2.0, 2.2), Vec3::new(-4.0, 1.8, -3.4));
    stage
}

/// Gives the scene's textures the mip levels that Bevy's loader does not make, and `texture_detail`
/// works by.
fn add_mip_levels(stage: &mut Stage) {
    let mut images = stage.world_mut().resource_mut::<Assets<Image>>();
    let textures: Vec<_> = images
        .iter()
        .filter(|(_, image)| {
            image.texture_descriptor.format == TextureFormat::Rgba8UnormSrgb
                && image.texture_descriptor.mip_level_count == 1
                && image.data.as_ref().is_some_and(|data| data.len() > 4)
        })
        .map(|(id, _)| id)
        .collect();
    assert!(!textures.is_empty(), "the scene is textured");
    for id in textures {
        let Some(mut image) = images.get_mut(id) else { continue };
        let (mut width, mut height) = (image.width() as usize, image.height() as usize);
        let mut level = image.data.clone().expect("texels");
        let mut data = level.clone();
        let mut levels = 1;
        while width > 1 && height > 1 {
            // Light is averaged, not its encoding; alpha has none.
            let texel = |x: usize, y: usize, channel: usize| {
                let value = f32::from(level[(y * width + x) * 4 + channel]) / 255.0;
                if channel == 3 { value } else { Srgba::gamma_function(value) }
            };
            let encoded = |mean: f32, channel: usize| {
                let value = if channel == 3 { mean } else { Srgba::gamma_function_inverse(mean) };
                (value * 255.0).round() as u8
            };
            let (half_width, half_height) = (width / 2, height / 2);
            let mut next = Vec::with_capacity(half_width * half_height * 4);
            for (y, x) in (0..half_height).flat_map(|y| (0..half_width).map(move |x| (y, x))) {
                for channel in 0..4 {
                    let (x, y) = (2 * x, 2 * y);
                    let sum = texel(x, y, channel)
                        + texel(x + 1, y, channel)
                        + texel(x, y + 1, channel)
                        + texel(x + 1, y + 1, channel);
                    next.push(encoded(sum / 4.0, channel));
                }
            }
            (level, width, height, levels) = (next, half_width, half_height, levels + 1);
            data.extend(&level);
        }
        image.data = Some(data);
        image.texture_descriptor.mip_level_count = levels;
    }
    // A material's bind group keeps the textures that it was made with.
    let mut materials = stage.world_mut().resource_mut::<Assets<StandardMaterial>>();
    let all: Vec<_> = materials.iter().map(|(id, _)| id).collect();
    for id in all {
        if let Some(mut material) = materials.get_mut(id) {
            *material = material.clone();
        }
    }
    stage.get_ready().expect("a ready stage");
}

fn render(stage: &mut Stage) -> Picture {
    stage.frame();
    stage.picture().expect("an image")
}

fn luma(image: &Picture) -> f64 {
    image.luma().iter().map(|luma| f64::from(*luma)).sum::<f64>() / image.rgb.len() as f64
}

/// Asserts that the app's state matches knob `name` at `value`.
fn assert_applied(stage: &mut Stage, name: &str, value: f64) {
    let camera = set::camera(stage);
    let world = stage.world_mut();
    let gi = world.get::<FrugalGi>(camera).expect("a GI camera").clone();
    match name {
        "gi_vpl_count" => assert_eq!(f64::from(gi.vpl_count), value),
        "gi_interleave" => assert_eq!(f64::from(gi.interleave.side()), value),
        "gi_visibility" => {
            let values = [0.0, 1.0, 2.0, 8.0];
            let at = GiVisibility::ALL.iter().position(|level| *level == gi.visibility);
            assert_eq!(at.map(|at| values[at]), Some(value));
        }
        "gi_environment_samples" => assert_eq!(f64::from(gi.environment_samples), value),
        "gi_pixel_fraction" => assert_eq!(gi.pixel_fraction.share(), value),
        "gi_refresh_period" => assert_eq!(f64::from(gi.refresh_period), value.recip()),
        "rsm_resolution" => {
            assert_eq!(f64::from(gi.rsm_resolution), value);
            // A near and a far cascade.
            assert_eq!(world.query::<&RsmView>().iter(world).count(), 2);
        }
        "shadow_map_resolution" => {
            assert_eq!(world.resource::<DirectionalLightShadowMap>().size as f64, value);
            assert_eq!(world.resource::<PointLightShadowMap>().size as f64, value / 2.0);
        }
        "shadow_cascades" => {
            let mut lights = world.query_filtered::<&CascadeShadowConfig, With<DirectionalLight>>();
            assert!(lights.iter(world).all(|cascades| cascades.bounds.len() as f64 == value));
        }
        "ambient_occlusion" => {
            let samples = world.get::<ScreenSpaceAmbientOcclusion>(camera).map_or(0, |occlusion| {
                match occlusion.quality_level {
                    ScreenSpaceAmbientOcclusionQualityLevel::Custom {
                        slice_count,
                        samples_per_slice_side,
                    } => slice_count * samples_per_slice_side * 2,
                    _ => u32::MAX,
                }
            });
            assert_eq!(f64::from(samples), value);
        }
        "antialiasing" => {
            let steps = match world.get::<Smaa>(camera).map(|smaa| smaa.preset) {
                None => f64::from(u8::from(world.get::<Fxaa>(camera).is_some())),
                Some(SmaaPreset::Low) => 4.0,
                Some(SmaaPreset::Medium) => 8.0,
                Some(SmaaPreset::High) => 16.0,
                Some(SmaaPreset::Ultra) => 32.0,
            };
            assert_eq!(steps, value);
        }
        "texture_detail" => {
            assert_eq!(world.get::<MipBias>(camera).map(|bias| f64::from(bias.0)), Some(-value));
        }
        "post_processing" => {
            let texture =
                world.get::<Bloom>(camera).map(|bloom| f64::from(bloom.max_mip_dimension));
            assert!(if value == 0.0 {
                texture.is_none()
            } else {
                texture.is_some_and(|size| size <= f64::from(SIZE.y) * value)
            });
        }
        // The scene has none of the effects; their steps are tested beside the knob.
        "effects" => {}
        // Which meshes are left is tested beside the knob.
        "view_distance" => {}
        "resolution_scale" => {
            assert_eq!(world.get::<ResolutionScale>(camera), Some(&ResolutionScale(value as f32)));
        }
        _ => panic!("knob {name} has no test of its own: add a check of its effect"),
    }
}

fn every_level_is_applied_changes_the_image_and_leaves_no_trace() {
    let mut stage = stage();
    let space = stage.space().clone();
    let best = space.highest();
    let at = |knob: usize, level: usize| best.with_level(knob, level);
    // Applies each level once, as an app does before it switches levels.
    for (index, knob) in space.knobs().iter().enumerate() {
        for level in 0..knob.levels.len() {
            stage.apply(at(index, level));
            stage.frame();
        }
    }
    stage.apply(best);
    stage.get_ready().expect("a ready stage");
    let reference = stage.picture().expect("an image");
    let ssim = Reference::new(&reference).expect("an image");
    let mut changed: BTreeMap<&str, usize> = BTreeMap::new();
    let mut ends = Vec::new();
    for (index, knob) in space.knobs().iter().enumerate() {
        let mut errors = Vec::new();
        for (number, level) in knob.levels.iter().enumerate() {
            stage.apply(at(index, number));
            let first = render(&mut stage);
            assert_applied(&mut stage, &knob.name, level.value);
            let converged = render(&mut stage);
            // If deferred lighting is late, the mean falls to about half.
            assert!(
                luma(&first) >= 0.5 * luma(&converged) && luma(&converged) > 10.0,
                "{}={}",
                knob.name,
                level.label
            );
            *changed.entry(&knob.name).or_default() += usize::from(converged != reference);
            errors.push(ssim.error(&converged).expect("images of one size"));
        }
        ends.push([errors[0], errors[errors.len() - 2]]);
        println!("    {}: {errors:.4?}", knob.name);
        let camera = set::camera(&mut stage);
        let applied = stage.world_mut().get::<AppliedKnobs>(camera).expect("applied knobs");
        let last = knob.levels.last().map(|level| level.value);
        assert_eq!(applied.value(&knob.name), last, "{}", knob.name);
        stage.apply(best);
        stage.frame();
        let back = render(&mut stage);
        let differing = back.rgb.iter().zip(&reference.rgb).filter(|(a, b)| a != b).count();
        assert_eq!(differing, 0, "back from {}: number of pixels that differ", knob.name);
    }
    // Neighbouring levels of one view may differ by noise alone.
    set::look(&mut stage, Vec3::new(-6.0, 1.7, 5.0), Vec3::new(2.0, 1.2, -2.0));
    stage.apply(best);
    stage.get_ready().expect("a ready stage");
    let ssim = Reference::new(&stage.picture().expect("an image")).expect("an image");
    for (index, knob) in space.knobs().iter().enumerate() {
        for (end, number) in [0, knob.levels.len() - 2].into_iter().enumerate() {
            stage.apply(at(index, number));
            stage.frame();
            let converged = render(&mut stage);
            ends[index][end] += ssim.error(&converged).expect("images of one size");
        }
        let [cheapest, last_but_one] = ends[index];
        println!("    {}: {cheapest:.4} and {last_but_one:.4} in two views", knob.name);
        // With most VPLs a pixel evaluates 1,024 of them at the best level and the one below: that one's
        // sets hold four times as many, and the difference is the noise of the best image itself.
        let is_ordered = knob.name != "gi_interleave";
        assert!(!is_ordered || cheapest >= last_but_one, "{}: lower levels err more", knob.name);
    }
    println!("    levels whose image differs from the best: {changed:?}");
    // Nothing moves here; `refresh.rs` tests the refresh period with moving light.
    assert_eq!(changed.remove("gi_refresh_period"), Some(0));
    assert_eq!(changed.remove("effects"), Some(0));
    // All of it is near; `distant.rs` has what is far.
    assert_eq!(changed.remove("view_distance"), Some(0));
    assert!(changed.iter().all(|(_, count)| *count > 0), "a knob changes nothing: {changed:?}");
}

/// Predicted number of pairs of a frame at `settings`: gathered pixels × VPLs per pixel.
fn predicted_pairs(stage: &Stage, settings: KnobLevels) -> u64 {
    let value = |name: &str| stage.space().value(settings, name).expect("a built-in knob");
    let size = ResolutionScale(value("resolution_scale") as f32).apply(SIZE);
    let (width, height) = match value("gi_pixel_fraction") {
        share if share > 0.9 => (1, 1),
        share if share > 0.4 => (2, 1),
        share if share > 0.2 => (2, 2),
        _ => (4, 4),
    };
    let sharing = value("gi_interleave") * value("gi_interleave");
    let per_pixel = (value("gi_vpl_count") / sharing).ceil().min(1024.0) as u64;
    u64::from(size.x.div_ceil(width)) * u64::from(size.y.div_ceil(height)) * per_pixel
}

fn bloom_follows_the_resolution_scale() {
    let mut stage = stage();
    let camera = set::camera(&mut stage);
    let mut largest = |text: &str| {
        set::apply(&mut stage, text);
        stage.frame();
        stage.world_mut().get::<Bloom>(camera).expect("bloom").max_mip_dimension
    };
    let (whole, half) = (largest("max"), largest("max,resolution_scale=50%"));
    assert!(half < whole, "{half} of {whole}");
    assert_eq!(largest("max"), whole);
}

fn cheaper_levels_evaluate_fewer_pairs() {
    let mut stage = stage();
    let space = stage.space().clone();
    let base = space
        .parse("min,gi_vpl_count=1024,gi_pixel_fraction=1/1,resolution_scale=100%")
        .expect("settings");
    for name in ["gi_vpl_count", "gi_interleave", "gi_pixel_fraction", "resolution_scale"] {
        let index = space.index_of(name).expect("a built-in knob");
        let mut before = None;
        for level in 0..space.knobs()[index].levels.len() {
            let settings = base.with_level(index, level);
            stage.apply(settings);
            stage.frame();
            let pairs = set::gathered(&stage).pairs;
            assert_eq!(pairs, predicted_pairs(&stage, settings), "{}", space.describe(settings));
            assert!(
                before.is_none_or(|before| pairs > before),
                "{name} {level}: {pairs} after {before:?}"
            );
            before = Some(pairs);
        }
    }
}
