//! The light of further bounces, against closed forms and references, and its sources.

use bevy::color::LinearRgba;
use bevy::light::NotShadowCaster;
use bevy::math::primitives::Plane3d;
use bevy::math::{DVec3, Quat, UVec2, Vec2, Vec3};
use bevy::mesh::{MeshBuilder, Meshable};
use bevy::pbr::StandardMaterial;
use bevy::render::render_resource::TextureFormat;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::gi::inspect::{self, GiPatches};
use frugal::stage::{Component, Stage};
use frugal_tests::gather::irradiance;
use frugal_tests::reference::{self, Tracing};
use frugal_tests::{gpu, meshes, set};
use frugal_trace::integrator::Pixels;
use frugal_trace::metrics::Difference;
use frugal_trace::scene::CameraPose;

use super::super::furnace::{ALBEDO, deviation, direct_radiance};
use super::super::gi::{corner, sun};
use super::super::gi_sources::sky::surround;
use super::{RAYS, patches, with_bounces};

tests!(
    every_bounce_in_a_furnace_adds_its_albedo_times_the_last,
    two_bounces_and_all_are_near_the_reference,
    all_bounces_are_three_and_the_rest_of_a_series,
    patches_match_their_cpu_reference,
    patches_reflect_the_colours_of_their_texture,
    emissive_surfaces_and_the_sky_are_reflected_too,
    transmissive_surfaces_have_no_patches,
);

fn every_bounce_in_a_furnace_adds_its_albedo_times_the_last() {
    let mut stage =
        set::open(&set::scene("furnace"), set::radiance_options(48, 27, Component::Indirect));
    set::look(&mut stage, Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.0, 0.4, -2.0));
    set::apply(&mut stage, "max,rsm_resolution=128,gi_vpl_count=4096");
    let stored = meshes::stored_albedo(ALBEDO);
    let direct = direct_radiance() * stored / ALBEDO;
    for bounces in 1..=FrugalGi::MAX_BOUNCES {
        let expected = direct * (1..=bounces).map(|bounce| stored.powi(bounce as i32)).sum::<f64>();
        let (most, mean) = deviation(&set::radiance(with_bounces(&mut stage, bounces)), expected);
        println!(
            "    {bounces}: {expected:.1} nits, off by at most {:.1} %, {:.2} % in the mean",
            most * 100.0,
            mean * 100.0
        );
        // As for one bounce. Each bounce between patches loses a little light at points nearer to a
        // VPL than the radius of its disk.
        assert!(mean <= 0.003 * f64::from(bounces) && most <= 0.02, "{bounces}: {most} {mean}");
    }
    let all = set::radiance(with_bounces(&mut stage, FrugalGi::ALL_BOUNCES));
    let (most, mean) = deviation(&all, direct * stored / (1.0 - stored));
    println!("    all: off by at most {:.1} %, {:.2} % in the mean", most * 100.0, mean * 100.0);
    assert!(mean <= 0.02 && most <= 0.03, "{most} {mean}");
    assert!(set::radiance(with_bounces(&mut stage, u32::MAX)) == all);
    assert!(
        set::radiance(with_bounces(&mut stage, 0)) == set::radiance(with_bounces(&mut stage, 1))
    );
}

fn two_bounces_and_all_are_near_the_reference() {
    let size = UVec2::new(64, 36);
    let tracing = Tracing { size, samples: 256, seed: 1, pixels: Pixels::Middle };
    for (name, eye, target) in [
        ("cornell", Vec3::new(0.0, 2.75, 8.0), Vec3::new(0.0, 2.75, 0.0)),
        ("two_rooms", Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6)),
    ] {
        let scene = set::scene(name);
        let pose = CameraPose::looking_at(eye, target);
        let mut stage =
            set::open(&scene, set::radiance_options(size.x, size.y, Component::Indirect));
        stage.place(pose.position, pose.rotation);
        set::apply(&mut stage, "max,rsm_resolution=128");
        let mut off = |bounces, most| {
            let reference = reference::bounces(&scene, pose, tracing, most);
            let found = set::radiance(with_bounces(&mut stage, bounces));
            Difference::new(&found, &reference, None).expect("images of equal size")
        };
        for (label, bounces, most) in
            [("two bounces", 2, Some(2)), ("all", FrugalGi::ALL_BOUNCES, None)]
        {
            let (fewer, found) = (off(bounces - 1, most), off(bounces, most));
            println!(
                "    {name} from {eye}: {label} {:.3} of the mean, off by {:.3}; one fewer {:.3}",
                found.mean_ratio, found.relative_l1_boxes, fewer.mean_ratio
            );
            assert!((found.mean_ratio - 1.0).abs() < 0.06, "{name}, {label}: {found:?}");
            assert!(found.relative_l1_boxes < 0.15, "{name}, {label}: {found:?}");
        }
        assert!(off(1, Some(2)).mean_ratio < 0.9, "the second bounce is visible");
        assert!(off(3, None).mean_ratio < 0.9, "bounces after the third are visible");
    }
}

/// Light of patches in three bounces and in all, from that of two: a geometric series.
fn all_bounces_are_three_and_the_rest_of_a_series() {
    let mut stage =
        set::open(&set::scene("cornell"), set::radiance_options(32, 18, Component::Indirect));
    set::look(&mut stage, Vec3::new(0.0, 2.75, 8.0), Vec3::new(0.0, 2.75, 0.0));
    set::apply(&mut stage, RAYS);
    let mut light = |bounces| {
        set::radiance(with_bounces(&mut stage, bounces));
        patches(&stage).iter().map(|patch| patch.flux.map(f64::from)).collect::<Vec<_>>()
    };
    let (two, three, all) = (light(2), light(3), light(FrugalGi::ALL_BOUNCES));
    let sum =
        |light: &[[f64; 3]], channel: usize| light.iter().map(|own| own[channel]).sum::<f64>();
    let mut worst = 0.0f64;
    for channel in 0..3 {
        let ratio = sum(&three, channel) / sum(&two, channel) - 1.0;
        println!("    ratio of channel {channel}: {ratio:.3}");
        assert!(ratio > 0.1 && ratio < 0.9, "{ratio}");
        for ((two, three), all) in two.iter().zip(&three).zip(&all) {
            let third = three[channel] - two[channel];
            let expected = three[channel] + third * ratio / (1.0 - ratio);
            assert!(third >= -1e-4 * two[channel].abs(), "a bounce adds light");
            worst = worst.max((all[channel] - expected).abs() / expected.max(1e-3));
        }
    }
    println!("    off by at most {worst:.1e}");
    assert!(worst < 1e-3, "{worst}");
}

/// Without occluders, each patch receives the light of all bounce VPLs.
fn patches_match_their_cpu_reference() {
    let mut stage = corner(vec![sun(Vec3::new(-0.3, -1.0, -0.2))]);
    set::apply(&mut stage, RAYS);
    set::radiance(with_bounces(&mut stage, 2));
    let state = inspect::gpu_state(stage.render_world());
    let buffer = state.cameras[0].bounces.as_ref().expect("two bounces").bounce_vpls.clone();
    let bounce_vpls = gpu::vpl_slots(&gpu::read_buffer(stage.render_world(), &buffer));
    let (mut checked, mut worst) = (0, 0.0f64);
    for patch in patches(&stage).iter().filter(|patch| patch.extent > 0.0) {
        let [normal, position] = [patch.normal, patch.position].map(Vec3::from_array);
        // The wall's front and the floor's top, away from the corner, where rays may start inside
        // the other mesh.
        let albedo = match () {
            () if normal.z > 0.99 && position.y > 0.05 && position.y < 1.99 => 0.5,
            () if normal.y > 0.99 && position.y < 0.1 && position.z > -1.85 => 0.8,
            () => continue,
        };
        let expected = irradiance(
            &bounce_vpls,
            position.as_dvec3(),
            DVec3::from_array(patch.normal.map(f64::from)),
            1.0,
        )
        .map(|light| light * meshes::stored_albedo(albedo) * f64::from(patch.extent));
        for (found, expected) in patch.flux.into_iter().zip(expected) {
            let off = (f64::from(found) - expected).abs();
            if expected > 1e-3 {
                worst = worst.max(off / expected);
            } else {
                assert!(off < 1e-3, "{found} of {expected}");
            }
        }
        checked += 1;
    }
    println!("    {checked} patches, off by at most {worst:.1e}");
    assert!(checked > 200 && worst < 1e-3, "{checked} {worst}");
}

fn patches_reflect_the_colours_of_their_texture() {
    reflects_the_colours_of_a_texture(true);
    reflects_the_colours_of_a_texture(false);
}

/// `is_readable`: by the CPU, too.
fn reflects_the_colours_of_a_texture(is_readable: bool) {
    // A floor whose left half is red and whose right half is black.
    let mut stage =
        set::bare(vec![sun(Vec3::NEG_Y)], set::radiance_options(48, 27, Component::Indirect));
    let texture = if is_readable {
        let texels = [[255, 0, 0, 255], [0, 0, 0, 255]];
        meshes::texture(&mut stage, TextureFormat::Rgba8UnormSrgb, 2, 1, &texels)
    } else {
        meshes::compressed_texture(&mut stage, &[0xf800, 0])
    };
    let floor = Plane3d::new(Vec3::Y, Vec2::splat(2.0)).mesh().build();
    meshes::spawn(
        &mut stage,
        floor,
        StandardMaterial { base_color_texture: Some(texture), ..meshes::diffuse(1.0, 1.0, 1.0) },
        Transform::default(),
    );
    // Lit by a ceiling, which receives the sun's light only from a white slab below it.
    meshes::spawn_box(
        &mut stage,
        Vec3::new(0.0, 1.0, 0.0),
        Vec3::new(1.0, 0.1, 1.0),
        meshes::diffuse(0.8, 0.8, 0.8),
    );
    meshes::spawn_box(
        &mut stage,
        Vec3::new(6.0, 3.0, 0.0),
        Vec3::new(9.0, 0.1, 9.0),
        meshes::diffuse(0.8, 0.8, 0.8),
    );
    set::look(&mut stage, Vec3::new(0.0, 1.2, 5.0), Vec3::ZERO);
    set::apply(&mut stage, RAYS);
    set::radiance(with_bounces(&mut stage, 3));
    let (mut red, mut black, mut mixed) = (0, 0, 0);
    for patch in patches(&stage).iter().filter(|patch| {
        patch.extent > 0.0 && patch.position[1].abs() < 1e-3 && patch.normal[1] > 0.9
    }) {
        let [r, g, b] = patch.flux;
        assert!(g == 0.0 && b == 0.0, "{patch:?}");
        if patch.position[0] < -0.3 {
            red += usize::from(r > 0.0);
        } else if patch.position[0] > 0.3 {
            black += usize::from(r == 0.0);
            mixed += usize::from(r > 0.0);
        }
    }
    println!("    {red} red patches, {black} black ones, {mixed} of both");
    // A patch is the mean of a run of points: where one triangle ends, the next begins elsewhere.
    assert!(red > 20 && black > 20 && mixed <= 1, "{red} {black} {mixed}");
}

fn emissive_surfaces_and_the_sky_are_reflected_too() {
    // A floor and a ceiling. With an emissive panel below it, the ceiling is lit by the floor only.
    let slabs = || {
        let mut stage = set::bare(vec![], set::radiance_options(48, 27, Component::Global));
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, -0.1, 0.0),
            Vec3::new(6.0, 0.2, 6.0),
            meshes::diffuse(0.8, 0.8, 0.8),
        );
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, 3.0, 0.0),
            Vec3::new(6.0, 0.2, 6.0),
            meshes::diffuse(0.8, 0.8, 0.8),
        );
        set::look(&mut stage, Vec3::new(0.0, 1.0, 2.9), Vec3::new(0.0, 2.9, -2.0));
        set::apply(&mut stage, RAYS);
        set::make_lambertian(&mut stage);
        stage
    };
    let ceiling = |stage: &mut Stage, bounces| set::radiance(with_bounces(stage, bounces)).mean();
    let mut stage = slabs();
    let emissive = StandardMaterial {
        emissive: LinearRgba::rgb(5.0, 5.0, 5.0),
        ..meshes::diffuse(0.0, 0.0, 0.0)
    };
    let mesh = Plane3d::new(Vec3::NEG_Y, Vec2::splat(1.0)).mesh().build();
    meshes::spawn(&mut stage, mesh, emissive, Transform::from_xyz(0.0, 2.85, 0.0));
    // One bounce on the floor; then a path over the ceiling and the floor again.
    let (direct, once, twice) =
        (ceiling(&mut stage, 1), ceiling(&mut stage, 2), ceiling(&mut stage, 4));
    println!("    a panel's light: {direct:.3}, with bounces {once:.3} and {twice:.3} nits");
    assert!(direct < 0.1 && once > 1.0 && twice > 1.05 * once, "{direct} {once} {twice}");
    let mut stage = slabs();
    surround(&mut stage, [[1.0; 3]; 6], 1000.0, Quat::IDENTITY);
    set::apply(&mut stage, &format!("{RAYS},gi_environment_samples=32"));
    let (direct, once, twice) =
        (ceiling(&mut stage, 1), ceiling(&mut stage, 2), ceiling(&mut stage, 3));
    println!("    the sky's light: {direct:.3}, with bounces {once:.3} and {twice:.3} nits");
    assert!(
        once > 1.02 * direct && twice > once && twice < 1000.0 * 0.8,
        "{direct} {once} {twice}"
    );
}

fn transmissive_surfaces_have_no_patches() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    set::apply(&mut stage, RAYS);
    let count = |stage: &mut Stage| {
        set::radiance(with_bounces(stage, 2));
        stage.world_mut().resource::<GiPatches>().patch_count()
    };
    let all = count(&mut stage);
    assert_eq!(all, 2048);
    let on_top = |patches: &[gpu::Point]| {
        patches.iter().filter(|patch| patch.extent > 0.0 && patch.position[1] > 4.0).count()
    };
    for (label, material, casts) in [
        ("unlit", StandardMaterial { unlit: true, ..Default::default() }, true),
        ("glass", StandardMaterial { specular_transmission: 0.5, ..Default::default() }, true),
        (
            "blended",
            StandardMaterial { alpha_mode: bevy::prelude::AlphaMode::Blend, ..Default::default() },
            true,
        ),
        ("without shadow", StandardMaterial::default(), false),
        ("diffuse", StandardMaterial::default(), true),
    ] {
        let mesh = meshes::spawn_box(&mut stage, Vec3::new(0.0, 5.0, 0.0), Vec3::ONE, material);
        if !casts {
            stage.world_mut().entity_mut(mesh).insert(NotShadowCaster);
        }
        set::radiance(&mut stage);
        assert_eq!(on_top(&patches(&stage)) > 0, label == "diffuse", "{label}");
        assert!(stage.world_mut().despawn(mesh));
    }
}
