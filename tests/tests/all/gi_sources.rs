//! Light without a punctual light: emissive surfaces and the sky.

use std::f64::consts::PI;

use bevy::asset::{Assets, Handle, RenderAssetUsages};
use bevy::color::{Alpha, Color, LinearRgba};
use bevy::ecs::entity::Entity;
use bevy::image::Image;
use bevy::light::EnvironmentMapLight;
use bevy::math::primitives::{Plane3d, Sphere};
use bevy::math::{Quat, Vec2, Vec3};
use bevy::mesh::{Mesh, MeshBuilder, Meshable, VertexAttributeValues};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::prelude::AlphaMode;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::gi::inspect::{self, GiEmitters};
use frugal::stage::{Component, Radiance, Stage};
use frugal_tests::{gpu, meshes, set};
use half::f16;

use super::gi::{assert_costs_nothing, sides, sun};

tests!(
    a_panel_lights_a_floor_by_its_form_factor,
    the_inside_of_an_emissive_sphere_is_lit_evenly,
    a_panel_s_radiance_agrees_with_the_light_on_a_floor,
    emissive_surfaces_add_to_punctual_lights,
    light_follows_an_emissive_surface,
    only_the_bright_part_of_an_emissive_texture_emits,
    only_the_opaque_part_of_a_mask_emits,
    a_surface_that_is_not_emissive_costs_nothing,
    emission_that_is_not_finite_or_huge_stays_finite,
    a_floor_under_an_even_sky_is_lit_by_all_of_it,
    a_wall_hides_half_the_sky,
    the_sky_lights_a_room_through_its_door_only,
    the_sky_rotates_as_in_bevy,
    without_rays_or_samples_bevy_renders_the_sky,
    a_sky_that_is_not_finite_or_huge_stays_finite,
    a_still_sky_gives_identical_frames,
);

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
    lights_by_a_quarter([255, 0, 0, 255], [0, 0, 0, 255], |texture| StandardMaterial {
        emissive_texture: Some(texture),
        ..emissive_material(4.0 * NITS)
    });
}

fn only_the_opaque_part_of_a_mask_emits() {
    let red = LinearRgba { green: 0.0, blue: 0.0, ..emissive_material(4.0 * NITS).emissive };
    lights_by_a_quarter([0, 0, 0, 200], [0, 0, 0, 100], |texture| StandardMaterial {
        base_color: Color::WHITE,
        base_color_texture: Some(texture),
        alpha_mode: AlphaMode::Mask(0.5),
        emissive: red,
        ..emissive_material(0.0)
    });
}

/// Tests the light of a panel with a texture of which the first quarter emits red.
fn lights_by_a_quarter(
    quarter: [u8; 4],
    rest: [u8; 4],
    material: impl FnOnce(Handle<Image>) -> StandardMaterial,
) {
    let mut stage = bare(Component::Global);
    spawn_floor(&mut stage, 8.0);
    let texture = meshes::texture(
        &mut stage,
        TextureFormat::Rgba8UnormSrgb,
        4,
        1,
        &[quarter, rest, rest, rest],
    );
    spawn_panel(&mut stage, Vec3::new(0.0, 1.0, -1.0), Vec2::new(4.0, 0.4), material(texture));
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
    let emitters = stage.world_mut().resource::<GiEmitters>();
    assert_eq!((emitters.surface_count(), emitters.texel_count()), (0, 0));
    // A camera without light of emissive surfaces, and one without global illumination.
    spawn_panel(&mut stage, Vec3::new(0.0, 1.0, 0.0), Vec2::splat(1.0), emissive_material(NITS));
    assert!(set::radiance(&mut stage).mean() > 1.0);
    assert_eq!(stage.world_mut().resource::<GiEmitters>().surface_count(), 1);
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

fn assert_finite(label: &str, stage: &mut Stage) -> f64 {
    let radiance = set::radiance(stage);
    assert!(
        radiance.rgb.iter().flatten().all(|value| value.is_finite() && *value >= 0.0),
        "{label}: a pixel is not finite or is negative"
    );
    radiance.mean()
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

fn a_wall_hides_half_the_sky() {
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
