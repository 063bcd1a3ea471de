//! Light of the sky.

use std::f64::consts::PI;

use bevy::asset::{Assets, RenderAssetUsages};
use bevy::image::Image;
use bevy::light::EnvironmentMapLight;
use bevy::math::{Quat, Vec2, Vec3};
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::inspect;
use frugal::stage::{Component, Stage};
use frugal_tests::{meshes, set};
use half::f16;

use super::{
    FLOOR_TRIANGLES, NITS, RAYS, albedo, assert_finite, bare, deviation, emissive_material,
    look_at_floor, spawn_floor, spawn_panel,
};
use crate::gi::assert_costs_nothing;

tests!(
    a_floor_under_an_even_sky_is_lit_by_all_of_it,
    a_wall_occludes_half_the_sky,
    the_sky_lights_a_room_through_its_door_only,
    the_sky_rotates_as_in_bevy,
    without_rays_or_samples_bevy_renders_the_sky,
    a_gathered_sky_and_bevys_own_fade_into_each_other,
    a_sky_that_is_not_finite_or_huge_stays_finite,
    a_still_sky_gives_identical_frames,
);

/// Gives the stage's camera an environment map of six uniform faces (+X, −X, +Y, −Y, +Z, −Z), whose
/// values are multiplied by `intensity`.
pub(crate) fn surround(stage: &mut Stage, faces: [[f32; 3]; 6], intensity: f32, rotation: Quat) {
    const EDGE: u32 = 4;
    let face =
        |[red, green, blue]: &[f32; 3]| vec![[*red, *green, *blue, 1.0]; (EDGE * EDGE) as usize];
    // Every GPU can filter half floats.
    let texels = faces
        .iter()
        .flat_map(face)
        .flatten()
        .flat_map(|value| f16::from_f32(value).to_le_bytes())
        .collect();
    let size = Extent3d { width: EDGE, height: EDGE, depth_or_array_layers: 6 };
    let mut image = Image::new(
        size,
        TextureDimension::D2,
        texels,
        TextureFormat::Rgba16Float,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_view_descriptor = Some(TextureViewDescriptor {
        dimension: Some(TextureViewDimension::Cube),
        ..Default::default()
    });
    let map = stage.world_mut().resource_mut::<Assets<Image>>().add(image);
    let camera = set::camera(stage);
    let light = EnvironmentMapLight {
        diffuse_map: map.clone(),
        specular_map: map,
        intensity,
        rotation,
        ..Default::default()
    };
    stage.world_mut().entity_mut(camera).insert(light);
}

fn a_floor_under_an_even_sky_is_lit_by_all_of_it() {
    let mut stage = bare(Component::Global);
    spawn_floor(&mut stage, 20.0);
    surround(&mut stage, [[1.0, 0.5, 0.25]; 6], NITS, Quat::IDENTITY);
    look_at_floor(&mut stage);
    for interleave in ["2x2", "4x4", "8x8"] {
        for samples in [8, 16, 32] {
            set::apply(
                &mut stage,
                &format!("{RAYS},gi_interleave={interleave},gi_environment_samples={samples}"),
            );
            let radiance = set::radiance(&mut stage);
            let expected = [1.0, 0.5, 0.25].map(|share| share * albedo() * f64::from(NITS));
            let off: Vec<f64> = radiance
                .rgb
                .iter()
                .flat_map(|rgb| (0..3).map(|c| (f64::from(rgb[c]) / expected[c] - 1.0).abs()))
                .collect();
            let most = off.iter().copied().fold(0.0, f64::max);
            println!("    {interleave}, {samples} samples: off by at most {:.1} %", most * 100.0);
            assert!(most < 0.06, "{most}");
        }
    }
    let gathered = set::gathered(&stage);
    assert_eq!(
        (gathered.pairs, gathered.rays),
        (48 * 27 * 32, 48 * 27 * 8),
        "no VPLs without punctual lights"
    );
    let occluders = FLOOR_TRIANGLES * 75;
    assert!(gathered.bytes < 256 * 1024 + u64::from(occluders), "{}", gathered.bytes);
    // In the full image it replaces Bevy's environment light instead of adding to it.
    let mut stage = bare(Component::Full);
    spawn_floor(&mut stage, 20.0);
    surround(&mut stage, [[1.0; 3]; 6], NITS, Quat::IDENTITY);
    look_at_floor(&mut stage);
    set::apply(&mut stage, &format!("{RAYS},gi_environment_samples=32"));
    let ours = set::radiance(&mut stage).mean();
    set::apply(&mut stage, &format!("{RAYS},gi_environment_samples=0"));
    let bevy_s = set::radiance(&mut stage).mean();
    println!("    {ours:.1} nits by the plugin, {bevy_s:.1} by Bevy");
    assert!((ours / bevy_s - 1.0).abs() < 0.06, "{ours} {bevy_s}");
}

fn a_wall_occludes_half_the_sky() {
    let mut stage = bare(Component::Global);
    spawn_floor(&mut stage, 20.0);
    meshes::spawn_box(
        &mut stage,
        Vec3::new(0.0, 100.0, -1.5),
        Vec3::new(1000.0, 200.0, 1.0),
        meshes::diffuse(0.0, 0.0, 0.0),
    );
    surround(&mut stage, [[1.0; 3]; 6], NITS, Quat::IDENTITY);
    look_at_floor(&mut stage);
    let expected = 0.5 * albedo() * f64::from(NITS);
    for (visibility, samples) in [("fine", 8), ("fine", 32), ("coarse", 16)] {
        set::apply(
            &mut stage,
            &format!("{RAYS},gi_visibility={visibility},gi_environment_samples={samples}"),
        );
        let (most, mean) = deviation(&set::radiance(&mut stage), expected);
        println!(
            "    {visibility}, {samples} samples: off by at most {:.0} %, {:+.1} % in the mean",
            most * 100.0,
            mean * 100.0
        );
        assert!(mean.abs() < 0.04, "{mean}");
    }
}

/// Spawns a room of 4 × 3 × 4 m, optionally with a door of 1 m × 2 m in the wall at z = −2.
fn spawn_room(stage: &mut Stage, has_door: bool) {
    let mut wall = |center: [f32; 3], size: [f32; 3]| {
        meshes::spawn_box(stage, center.into(), size.into(), meshes::diffuse(0.8, 0.8, 0.8));
    };
    wall([0.0, -0.1, 0.0], [5.0, 0.2, 5.0]);
    wall([0.0, 3.1, 0.0], [5.0, 0.2, 5.0]);
    wall([-2.1, 1.5, 0.0], [0.2, 3.4, 5.0]);
    wall([2.1, 1.5, 0.0], [0.2, 3.4, 5.0]);
    wall([0.0, 1.5, 2.1], [5.0, 3.4, 0.2]);
    if has_door {
        wall([-1.25, 1.5, -2.1], [1.5, 3.4, 0.2]);
        wall([1.25, 1.5, -2.1], [1.5, 3.4, 0.2]);
        wall([0.0, 2.5, -2.1], [1.0, 1.0, 0.2]);
    } else {
        wall([0.0, 1.5, -2.1], [5.0, 3.4, 0.2]);
    }
}

fn the_sky_lights_a_room_through_its_door_only() {
    let mut found = Vec::new();
    for has_door in [true, false] {
        let mut stage = bare(Component::Global);
        spawn_room(&mut stage, has_door);
        surround(&mut stage, [[1.0; 3]; 6], NITS, Quat::IDENTITY);
        set::look(&mut stage, Vec3::new(0.0, 1.6, -1.0), Vec3::new(0.0, 0.8, 2.0));
        for visibility in ["coarse", "fine"] {
            set::apply(
                &mut stage,
                &format!("{RAYS},gi_visibility={visibility},gi_environment_samples=16"),
            );
            found.push(set::radiance(&mut stage).mean());
        }
    }
    println!(
        "    with a door {:.2} nits coarse, {:.2} fine; closed {:.5} and {:.5}",
        found[0], found[1], found[2], found[3]
    );
    // About one ray in ten reaches the door: with two rays per pixel, the mean over all pixels has
    // an error of about a tenth.
    assert!(
        found[1] > 0.005 * f64::from(NITS) && (found[0] / found[1] - 1.0).abs() < 0.3,
        "{found:?}"
    );
    assert!(found[2] < 1e-4 * found[1] && found[3] < 1e-4 * found[1], "it leaks: {found:?}");
}

fn the_sky_rotates_as_in_bevy() {
    // Six colours. A wall mostly receives the colour that it faces, by the plugin's samples and by
    // Bevy's look-up.
    let faces = [
        [1.0, 0.1, 0.1],
        [0.1, 1.0, 0.1],
        [0.1, 0.1, 1.0],
        [0.9, 0.9, 0.1],
        [0.1, 0.9, 0.9],
        [0.9, 0.1, 0.9],
    ];
    let mut stage = bare(Component::Full);
    // One wall at a time in front of the camera, so that walls do not occlude each other.
    let wall = meshes::spawn_box(
        &mut stage,
        Vec3::ZERO,
        Vec3::new(4.0, 4.0, 0.2),
        meshes::diffuse(0.8, 0.8, 0.8),
    );
    let order = |rgb: [f64; 3]| {
        let mut channels = [0, 1, 2];
        channels.sort_by(|a, b| rgb[*b].total_cmp(&rgb[*a]));
        let (first, second, third) = (rgb[channels[0]], rgb[channels[1]], rgb[channels[2]]);
        // The brightest channel, or the brightest two.
        if second - third > first - second {
            vec![channels[0].min(channels[1]), channels[0].max(channels[1])]
        } else {
            vec![channels[0]]
        }
    };
    for rotation in [
        Quat::IDENTITY,
        Quat::from_rotation_y(PI as f32 / 2.0),
        Quat::from_rotation_x(PI as f32 / 2.0),
        Quat::from_rotation_z(PI as f32 / 2.0),
    ] {
        surround(&mut stage, faces, NITS, rotation);
        for turn in 0..4 {
            let facing = Quat::from_rotation_y(turn as f32 * PI as f32 / 2.0);
            stage.world_mut().get_mut::<Transform>(wall).expect("the wall").rotation = facing;
            set::look(&mut stage, facing * Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO);
            let orders: Vec<_> = [0, 32]
                .into_iter()
                .map(|samples| {
                    set::apply(&mut stage, &format!("{RAYS},gi_environment_samples={samples}"));
                    order(set::channel_means(&set::radiance(&mut stage)))
                })
                .collect();
            assert_eq!(orders[0], orders[1], "turned by {rotation}, facing {}", facing * Vec3::Z);
        }
    }
}

fn without_rays_or_samples_bevy_renders_the_sky() {
    let mut stage = bare(Component::Full);
    spawn_room(&mut stage, false);
    surround(&mut stage, [[1.0; 3]; 6], NITS, Quat::IDENTITY);
    set::look(&mut stage, Vec3::new(0.0, 1.6, -1.0), Vec3::new(0.0, 0.8, 2.0));
    let mean = |stage: &mut Stage, more: &str| {
        set::apply(stage, &format!("{RAYS},{more}"));
        (set::radiance(stage).mean(), inspect::gpu_state(stage.render_world()).skies)
    };
    let (off, without_gi) =
        (mean(&mut stage, "gi_environment_samples=0"), mean(&mut stage, "gi_vpl_count=0"));
    assert!(
        off.0 > 0.5 * albedo() * f64::from(NITS) && off == without_gi && off.1 == 0,
        "{off:?} {without_gi:?}"
    );
    assert_eq!(mean(&mut stage, "gi_visibility=none"), off);
    assert_costs_nothing(&mut stage);
    let on = mean(&mut stage, "gi_environment_samples=8");
    assert!(on.0 < 1e-3 * off.0 && on.1 == 1, "{on:?}");
    assert_eq!(mean(&mut stage, "gi_environment_samples=0"), off);
    // Removing the map removes all its resources.
    mean(&mut stage, "gi_environment_samples=8");
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).remove::<EnvironmentMapLight>();
    assert_eq!(mean(&mut stage, "gi_environment_samples=8"), (0.0, 0));
    assert!(inspect::gpu_state(stage.render_world()).cameras.is_empty());
}

fn a_gathered_sky_and_bevys_own_fade_into_each_other() {
    let mut stage = bare(Component::Full);
    spawn_room(&mut stage, false);
    surround(&mut stage, [[1.0; 3]; 6], NITS, Quat::IDENTITY);
    set::look(&mut stage, Vec3::new(0.0, 1.6, -1.0), Vec3::new(0.0, 0.8, 2.0));
    let [on, off] =
        ["gi_environment_samples=8", "gi_vpl_count=0"].map(|more| format!("{RAYS},{more}"));
    // The room is closed: dark by rays, bright without.
    set::apply(&mut stage, &off);
    let bright = set::radiance(&mut stage).mean();
    set::apply(&mut stage, &on);
    let dark = set::radiance(&mut stage).mean();
    assert!(dark < 1e-3 * bright, "{dark} of {bright} nits");
    const FRAMES: usize = 24;
    for (settings, from, to) in [(&off, dark, bright), (&on, bright, dark)] {
        set::switch(&mut stage, settings);
        for step in 1..=FRAMES {
            stage.frame();
            let shown = stage.radiance().expect("radiance").mean();
            let expected = from + (to - from) * step as f64 / FRAMES as f64;
            assert!(
                (shown - expected).abs() < 0.01 * bright,
                "{settings}, frame {step}: {shown}, not {expected} nits"
            );
        }
    }
}

fn a_sky_that_is_not_finite_or_huge_stays_finite() {
    let mut stage = bare(Component::Global);
    spawn_floor(&mut stage, 20.0);
    look_at_floor(&mut stage);
    let dark = [0.0; 3];
    for (label, faces, intensity) in [
        ("black", [dark; 6], 1.0),
        (
            "NaN and infinity",
            [[f32::NAN; 3], [f32::INFINITY; 3], [1.0; 3], [-1.0; 3], [1e30; 3], dark],
            1000.0,
        ),
        ("faint", [[1e-20; 3]; 6], 1.0),
        ("bright", [[5e4; 3]; 6], 1e16),
        ("brighter", [[5e4; 3]; 6], 1e34),
        ("no intensity", [[1.0; 3]; 6], 0.0),
        ("broken intensity", [[1.0; 3]; 6], f32::NAN),
    ] {
        surround(&mut stage, faces, intensity, Quat::IDENTITY);
        set::apply(&mut stage, &format!("{RAYS},gi_environment_samples=8"));
        let mean = assert_finite(label, &mut stage);
        println!("    {label}: {mean:e} nits");
        assert_eq!(
            mean > 1e-3,
            !["black", "faint", "no intensity", "broken intensity"].contains(&label),
            "{label}: {mean}"
        );
    }
}

fn a_still_sky_gives_identical_frames() {
    let mut stage = bare(Component::Full);
    spawn_room(&mut stage, true);
    surround(
        &mut stage,
        [[0.2; 3], [0.2; 3], [1.0; 3], [0.1; 3], [0.5; 3], [0.3; 3]],
        NITS,
        Quat::IDENTITY,
    );
    spawn_panel(&mut stage, Vec3::new(0.0, 2.9, 0.0), Vec2::splat(0.5), emissive_material(NITS));
    set::look(&mut stage, Vec3::new(0.0, 1.6, -1.0), Vec3::new(0.0, 0.8, 2.0));
    set::apply(&mut stage, &format!("{RAYS},gi_environment_samples=16"));
    let first = set::radiance(&mut stage);
    for _ in 0..10 {
        stage.frame();
        assert!(stage.radiance().expect("an image") == first);
    }
}
