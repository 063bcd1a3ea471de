//! Light of emissive surfaces.

use std::f64::consts::PI;

use bevy::asset::{Assets, Handle, RenderAssetUsages};
use bevy::color::{Alpha, Color, LinearRgba};
use bevy::image::Image;
use bevy::math::primitives::Sphere;
use bevy::math::{Vec2, Vec3};
use bevy::mesh::{Mesh, Meshable, VertexAttributeValues};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::prelude::AlphaMode;
use bevy::render::render_resource::TextureFormat;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::inspect::GiEmitters;
use bevy_frugal_gi::gi::{FrugalGi, GiTextureCopies};
use frugal::stage::{Component, Stage};
use frugal_tests::{gpu, meshes, set};

use super::{
    NITS, RAYS, albedo, assert_finite, bare, deviation, emissive_material, form_factor,
    look_at_floor, spawn_floor, spawn_panel,
};
use crate::gi::{assert_costs_nothing, sides, sun};

tests!(
    a_panel_lights_a_floor_by_its_form_factor,
    the_inside_of_an_emissive_sphere_is_lit_evenly,
    a_panel_s_radiance_agrees_with_the_light_on_a_floor,
    emissive_surfaces_add_to_punctual_lights,
    light_follows_an_emissive_surface,
    only_the_bright_part_of_an_emissive_texture_emits,
    only_the_opaque_part_of_a_mask_emits,
    textures_that_the_cpu_cannot_read_emit_alike,
    a_surface_that_is_not_emissive_costs_nothing,
    emission_that_is_not_finite_or_huge_stays_finite,
);

fn a_panel_lights_a_floor_by_its_form_factor() {
    for (size, height) in
        [(Vec2::new(2.0, 1.0), 2.0), (Vec2::new(4.0, 4.0), 1.0), (Vec2::new(0.2, 0.2), 3.0)]
    {
        let mut stage = bare(Component::Global);
        spawn_floor(&mut stage, 20.0);
        spawn_panel(&mut stage, Vec3::new(0.0, height, 0.0), size, emissive_material(NITS));
        look_at_floor(&mut stage);
        let expected =
            albedo() * f64::from(NITS) * form_factor(size.x.into(), size.y.into(), height.into());
        for visibility in ["none", "coarse", "fine"] {
            set::apply(&mut stage, &format!("{RAYS},gi_visibility={visibility}"));
            let (most, mean) = deviation(&set::radiance(&mut stage), expected);
            println!(
                "    {size} m at {height} m, {visibility}: {expected:.2} nits, off by at most {:.1} %, {:+.2} % in the mean",
                most * 100.0,
                mean * 100.0
            );
            // The light falls off slightly within the visible part of the floor.
            assert!(most < 0.08 && mean.abs() < 0.03, "{most} {mean}");
        }
    }
}

fn the_inside_of_an_emissive_sphere_is_lit_evenly() {
    let mut stage = bare(Component::Global);
    let mut mesh: Mesh = Sphere::new(2.0).mesh().ico(12).expect("a sphere");
    mesh.invert_winding().expect("triangles");
    if let Some(VertexAttributeValues::Float32x3(normals)) =
        mesh.attribute_mut(Mesh::ATTRIBUTE_NORMAL)
    {
        normals.iter_mut().flatten().for_each(|value| *value = -*value);
    }
    let material = StandardMaterial {
        base_color: meshes::diffuse(0.8, 0.8, 0.8).base_color,
        ..emissive_material(NITS)
    };
    meshes::spawn(&mut stage, mesh, material, Transform::default());
    set::look(&mut stage, Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.0, 0.4, -2.0));
    set::apply(&mut stage, &format!("{RAYS},gi_vpl_count=4096"));
    let (most, mean) = deviation(&set::radiance(&mut stage), albedo() * f64::from(NITS));
    println!("    off by at most {:.1} %, {:+.2} % in the mean", most * 100.0, mean * 100.0);
    // The geometry term is bounded for two VPLs next to a pixel; the facets lose 1 % of the solid
    // angle.
    assert!(most < 0.1 && mean.abs() < 0.03, "{most} {mean}");
}

fn a_panel_s_radiance_agrees_with_the_light_on_a_floor() {
    // For deferred and forward rendering, and for any weight of exposure.
    use bevy::material::OpaqueRendererMethod::{Deferred, Forward};
    let expected_on_floor = albedo() * form_factor(2.0, 2.0, 2.0);
    let (opaque, mask, blend) = (AlphaMode::Opaque, AlphaMode::Mask(0.5), AlphaMode::Blend);
    for (method, alpha_mode, weight) in [
        (Deferred, opaque, 0.0),
        (Deferred, opaque, 1.0),
        (Forward, opaque, 0.0),
        (Forward, opaque, 0.4),
        (Forward, opaque, 1.0),
        (Deferred, mask, 0.4),
        (Deferred, blend, 0.0),
        (Deferred, blend, 0.4),
        (Deferred, AlphaMode::Add, 0.0),
        (Deferred, AlphaMode::Premultiplied, 0.0),
    ] {
        let mut stage = bare(Component::Full);
        spawn_floor(&mut stage, 20.0);
        let base_color = meshes::diffuse(0.0, 0.0, 0.0).base_color.with_alpha(0.75);
        let material = StandardMaterial {
            base_color,
            alpha_mode,
            opaque_render_method: method,
            emissive_exposure_weight: weight,
            ..emissive_material(NITS)
        };
        spawn_panel(&mut stage, Vec3::new(0.0, 2.0, 0.0), Vec2::splat(2.0), material);
        set::look(&mut stage, Vec3::new(0.0, 1.5, 0.15), Vec3::new(0.0, 2.0, 0.0));
        let visible = set::radiance(&mut stage).mean();
        look_at_floor(&mut stage);
        let lit = set::radiance(&mut stage).mean();
        println!(
            "    {method:?}, {alpha_mode:?}, weight {weight}: panel {visible:.2} nits, floor {lit:.2}"
        );
        assert!(
            (lit / visible / expected_on_floor - 1.0).abs() < 0.03,
            "{} of {expected_on_floor}",
            lit / visible
        );
    }
}

fn emissive_surfaces_add_to_punctual_lights() {
    // The sun's map precedes the panel's texels in the store. The light of both adds up.
    let mut found = Vec::new();
    for (has_sun, nits) in [(true, 0.0), (false, NITS), (true, NITS)] {
        let lights = if has_sun { vec![sun(Vec3::NEG_Y)] } else { vec![] };
        let mut stage = set::bare(lights, set::radiance_options(48, 27, Component::Global));
        set::apply(&mut stage, RAYS);
        spawn_floor(&mut stage, 6.0);
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, 1.0, -2.0),
            Vec3::new(4.0, 2.0, 0.2),
            meshes::diffuse(0.5, 0.5, 0.5),
        );
        let mut panel = emissive_material(nits);
        panel.cull_mode = None;
        spawn_panel(&mut stage, Vec3::new(1.5, 1.5, 0.0), Vec2::splat(0.5), panel);
        set::look(&mut stage, Vec3::new(0.0, 1.2, 3.0), Vec3::new(0.0, 0.8, -2.0));
        found.push(set::radiance(&mut stage).mean());
        let flux: f64 = gpu::total_flux(&gpu::rsm_texels(&stage))[1];
        if !has_sun {
            // Two sides of 0.25 m².
            let expected = PI * f64::from(NITS) * 0.25 * 2.0;
            assert!((flux / expected - 1.0).abs() < 1e-4, "{flux} lumens of {expected}");
        }
    }
    println!("    sun {:.2} nits, panel {:.2}, both {:.2}", found[0], found[1], found[2]);
    assert!(found[0] > 1.0 && found[1] > 1.0);
    assert!((found[2] / (found[0] + found[1]) - 1.0).abs() < 0.03, "{found:?}");
}

fn light_follows_an_emissive_surface() {
    let mut stage = bare(Component::Global);
    spawn_floor(&mut stage, 8.0);
    let panel = spawn_panel(
        &mut stage,
        Vec3::new(-1.5, 1.0, -1.0),
        Vec2::splat(0.4),
        emissive_material(NITS),
    );
    set::look(&mut stage, Vec3::new(0.0, 1.5, 3.0), Vec3::new(0.0, 0.0, -1.0));
    let (left, right) = sides(&mut stage);
    assert!(left > 2.0 * right && left > 1.0, "{left} {right}");
    stage.world_mut().get_mut::<Transform>(panel).expect("the panel").translation.x = 1.5;
    let (moved_left, moved_right) = sides(&mut stage);
    println!("    left and right {left:.2} {right:.2} nits, then {moved_left:.2} {moved_right:.2}");
    assert!((moved_right / left - 1.0).abs() < 0.1 && (moved_left / right - 1.0).abs() < 0.1);
    // It is switched off and on, hidden, shown and removed.
    let handle = stage
        .world_mut()
        .get::<MeshMaterial3d<StandardMaterial>>(panel)
        .expect("a material")
        .0
        .clone();
    let set_emission = |stage: &mut Stage, nits: f32| {
        let mut materials = stage.world_mut().resource_mut::<Assets<StandardMaterial>>();
        materials.get_mut(&handle).expect("the material").emissive =
            emissive_material(nits).emissive;
        sides(stage)
    };
    assert_eq!(set_emission(&mut stage, 0.0), (0.0, 0.0));
    let (_, twice) = set_emission(&mut stage, 2.0 * NITS);
    assert!((twice / moved_right - 2.0).abs() < 0.01, "{twice}");
    stage.world_mut().entity_mut(panel).insert(bevy::camera::visibility::Visibility::Hidden);
    assert_eq!(sides(&mut stage), (0.0, 0.0));
    stage.world_mut().entity_mut(panel).insert(bevy::camera::visibility::Visibility::Visible);
    assert!(sides(&mut stage).1 > 1.0);
    stage.world_mut().despawn(panel);
    assert_eq!(sides(&mut stage), (0.0, 0.0));
    assert_eq!(stage.world_mut().resource::<GiEmitters>().texel_count(), 0);
}

fn only_the_bright_part_of_an_emissive_texture_emits() {
    // White where u is below a quarter, black elsewhere.
    lights_by_a_quarter(
        |stage| quarter_texture(stage, [255, 0, 0, 255], [0, 0, 0, 255]),
        with_emissive_texture,
    );
}

fn textures_that_the_cpu_cannot_read_emit_alike() {
    let kept_for_the_gpu = |stage: &mut Stage| {
        let texture = quarter_texture(stage, [255, 0, 0, 255], [0, 0, 0, 255]);
        meshes::keep_for_the_gpu(stage, &texture);
        texture
    };
    let (mut stage, texture) = lights_by_a_quarter(kept_for_the_gpu, with_emissive_texture);
    // Another image in its place is read anew.
    let black = Image { asset_usage: RenderAssetUsages::RENDER_WORLD, ..Image::default() };
    let black = Image { data: Some(vec![0; 4]), ..black };
    stage.world_mut().resource_mut::<Assets<Image>>().insert(&texture, black).expect("a place");
    assert_eq!(set::radiance(&mut stage).mean(), 0.0, "a black texture emits nothing");
    assert_eq!(stage.world_mut().resource::<GiTextureCopies>().waiting(), 0);

    lights_by_a_quarter(
        |stage| meshes::compressed_texture(stage, &[0xf800, 0, 0, 0]),
        with_emissive_texture,
    );
}

/// A texture of four texels, of which the first differs.
fn quarter_texture(stage: &mut Stage, quarter: [u8; 4], rest: [u8; 4]) -> Handle<Image> {
    meshes::texture(stage, TextureFormat::Rgba8UnormSrgb, 4, 1, &[quarter, rest, rest, rest])
}

fn with_emissive_texture(texture: Handle<Image>) -> StandardMaterial {
    StandardMaterial { emissive_texture: Some(texture), ..emissive_material(4.0 * NITS) }
}

fn only_the_opaque_part_of_a_mask_emits() {
    let red = LinearRgba { green: 0.0, blue: 0.0, ..emissive_material(4.0 * NITS).emissive };
    lights_by_a_quarter(
        |stage| quarter_texture(stage, [0, 0, 0, 200], [0, 0, 0, 100]),
        |texture| StandardMaterial {
            base_color: Color::WHITE,
            base_color_texture: Some(texture),
            alpha_mode: AlphaMode::Mask(0.5),
            emissive: red,
            ..emissive_material(0.0)
        },
    );
}

/// Tests the light of a panel with a texture of which the first quarter emits red. Returns its
/// stage, and the texture.
fn lights_by_a_quarter(
    texture: impl FnOnce(&mut Stage) -> Handle<Image>,
    material: impl FnOnce(Handle<Image>) -> StandardMaterial,
) -> (Stage, Handle<Image>) {
    let mut stage = bare(Component::Global);
    spawn_floor(&mut stage, 8.0);
    let texture = texture(&mut stage);
    let material = material(texture.clone());
    spawn_panel(&mut stage, Vec3::new(0.0, 1.0, -1.0), Vec2::new(4.0, 0.4), material);
    set::look(&mut stage, Vec3::new(0.0, 1.5, 3.0), Vec3::new(0.0, 0.0, -1.0));
    let radiance = set::radiance(&mut stage);
    let [red, green, blue] = set::channel_means(&radiance);
    let texels = gpu::rsm_texels(&stage);
    let flux = gpu::total_flux(&texels);
    // A texel of the texture covers one metre of the panel's four.
    let lit: Vec<f32> =
        texels.iter().filter(|texel| texel.flux[0] > 0.0).map(|texel| texel.position[0]).collect();
    let (least, most) =
        lit.iter().fold((f32::MAX, f32::MIN), |(least, most), x| (least.min(*x), most.max(*x)));
    println!(
        "    {red:.2} {green:.2} {blue:.2} nits from {least:.2} to {most:.2} m; {:.1} lumens",
        flux[0]
    );
    assert!(red > 1.0 && green == 0.0 && blue == 0.0);
    assert!(
        lit.len() > 900 && most - least < 1.01 && (least >= 0.99 || most <= -0.99),
        "{least} {most}"
    );
    let expected = PI * f64::from(4.0 * NITS) * 0.4;
    assert!((flux[0] / expected - 1.0).abs() < 0.01, "{} of {expected}", flux[0]);
    (stage, texture)
}

fn a_surface_that_is_not_emissive_costs_nothing() {
    let mut stage = bare(Component::Global);
    spawn_floor(&mut stage, 8.0);
    spawn_panel(&mut stage, Vec3::new(0.0, 1.0, 0.0), Vec2::splat(1.0), emissive_material(0.0));
    look_at_floor(&mut stage);
    // With rays, occluders are kept even without any light.
    set::apply(&mut stage, &format!("{RAYS},gi_visibility=none"));
    assert_eq!(set::radiance(&mut stage).mean(), 0.0);
    assert_costs_nothing(&mut stage);
    assert_eq!(stage.world_mut().resource::<GiEmitters>().texel_count(), 0);
    // A camera without light of emissive surfaces, and one without global illumination.
    spawn_panel(&mut stage, Vec3::new(0.0, 1.0, 0.0), Vec2::splat(1.0), emissive_material(NITS));
    assert!(set::radiance(&mut stage).mean() > 1.0);
    assert_eq!(stage.world_mut().resource::<GiEmitters>().texel_count(), 1024, "of one surface");
    let camera = set::camera(&mut stage);
    stage.world_mut().get_mut::<FrugalGi>(camera).expect("a GI camera").emissive = false;
    assert_eq!(set::radiance(&mut stage).mean(), 0.0);
    assert_costs_nothing(&mut stage);
    stage.world_mut().get_mut::<FrugalGi>(camera).expect("a GI camera").emissive = true;
    assert!(set::radiance(&mut stage).mean() > 1.0);
    set::apply(&mut stage, "min");
    set::radiance(&mut stage);
    assert_costs_nothing(&mut stage);
    assert_eq!(stage.world_mut().resource::<GiEmitters>().texel_count(), 0);
}

fn emission_that_is_not_finite_or_huge_stays_finite() {
    for (nits, is_lit) in [
        (f32::NAN, false),
        (f32::INFINITY, false),
        (-1.0, false),
        (1e-30, false),
        (1e20, true),
        (1e38, true),
    ] {
        let mut stage = bare(Component::Global);
        spawn_floor(&mut stage, 8.0);
        let mut material = emissive_material(0.0);
        material.emissive = LinearRgba::rgb(nits, nits, nits);
        spawn_panel(&mut stage, Vec3::new(0.0, 1.0, 0.0), Vec2::splat(1.0), material);
        look_at_floor(&mut stage);
        let mean = assert_finite(&format!("{nits} nits"), &mut stage);
        assert_eq!(mean > 1e3, is_lit, "{nits} nits: {mean}");
    }
    // Scaled to a point, to a huge size and to a line.
    let mut stage = bare(Component::Global);
    spawn_floor(&mut stage, 8.0);
    let panel = spawn_panel(
        &mut stage,
        Vec3::new(0.0, 1.0, 0.0),
        Vec2::splat(1.0),
        emissive_material(NITS),
    );
    stage.world_mut().get_mut::<Transform>(panel).expect("the panel").scale = Vec3::ZERO;
    look_at_floor(&mut stage);
    assert_eq!(assert_finite("scaled to zero", &mut stage), 0.0);
    stage.world_mut().get_mut::<Transform>(panel).expect("the panel").scale = Vec3::splat(1e12);
    assert_finite("scaled to 10¹² metres", &mut stage);
    stage.world_mut().get_mut::<Transform>(panel).expect("the panel").scale =
        Vec3::new(1e-12, 1.0, 1.0);
    assert_finite("a line", &mut stage);
}
