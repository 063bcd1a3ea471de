//! What lies between a surface's indirect light and the image: fog, ambient occlusion, and the
//! order of Bevy's passes.

use std::any::TypeId;

use bevy::asset::{Assets, RenderAssetUsages};
use bevy::color::{Alpha, Color};
use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::schedule::{IntoScheduleConfigs, Schedules};
use bevy::ecs::system::IntoSystem;
use bevy::image::Image;
use bevy::light::{IrradianceVolume, LightProbe};
use bevy::math::{Rect, Vec3};
use bevy::mesh::Mesh;
use bevy::pbr::deferred::deferred_lighting;
use bevy::pbr::{DistanceFog, FogFalloff, Lightmap, StandardMaterial, screen_space_reflections};
use bevy::render::RenderApp;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::GiSystems;
use frugal::stage::{Component, Radiance, Stage};
use frugal_tests::{meshes, set};

use super::gi::{PLAIN, corner, sun};

tests!(
    fog_dims_indirect_light_as_it_dims_direct_light,
    a_material_without_fog_keeps_its_indirect_light,
    a_material_s_occlusion_dims_its_indirect_light,
    the_screen_s_occlusion_dims_indirect_light_in_creases,
    indirect_light_is_there_before_reflections_and_the_sky,
    irradiance_volumes_light_only_what_is_not_gathered,
    lightmaps_and_gathered_light_add_up,
);

const EYE: Vec3 = Vec3::new(0.0, 1.2, 3.0);

/// The corner with all light, seen as in [`corner`].
fn full() -> Stage {
    let mut stage = set::bare(
        vec![sun(Vec3::new(0.2, -1.0, -0.6))],
        set::radiance_options(48, 27, Component::Full),
    );
    meshes::spawn_corner(&mut stage, 0.5);
    set::look(&mut stage, EYE, Vec3::new(0.0, 0.8, -2.0));
    set::apply(&mut stage, PLAIN);
    stage
}

/// Images without and with indirect light.
fn both(stage: &mut Stage) -> [Radiance; 2] {
    [format!("{PLAIN},gi_vpl_count=0"), PLAIN.into()].map(|settings| {
        set::apply(stage, &settings);
        set::radiance(stage)
    })
}

fn fog_dims_indirect_light_as_it_dims_direct_light() {
    let mut stage = full();
    let camera = set::camera(&mut stage);
    let [direct, all] = both(&mut stage);
    for falloff in [
        FogFalloff::Linear { start: 2.0, end: 8.0 },
        FogFalloff::Exponential { density: 0.3 },
        FogFalloff::ExponentialSquared { density: 0.15 },
        FogFalloff::Atmospheric {
            extinction: Vec3::new(0.1, 0.2, 0.4),
            inscattering: Vec3::splat(0.1),
        },
    ] {
        for opacity in [1.0, 0.5] {
            let fog = DistanceFog {
                color: Color::BLACK.with_alpha(opacity),
                falloff: falloff.clone(),
                ..Default::default()
            };
            stage.world_mut().entity_mut(camera).insert(fog);
            let [foggy_direct, foggy] = both(&mut stage);
            let (mut tested, mut dimmest) = (0, 1.0f32);
            let clear = direct.rgb.iter().flatten().zip(all.rgb.iter().flatten());
            let seen = foggy_direct.rgb.iter().flatten().zip(foggy.rgb.iter().flatten());
            for ((direct, all), (foggy_direct, foggy)) in clear.zip(seen) {
                let indirect = all - direct;
                if *direct < 50.0 || indirect < 50.0 {
                    continue;
                }
                let (expected, found) = (foggy_direct / direct, (foggy - foggy_direct) / indirect);
                // Half floats round each of four values by up to a thousandth.
                let rounding = 2e-3 * all / indirect;
                assert!(
                    (found - expected).abs() < rounding + 2e-3,
                    "{falloff:?}: {found} {expected}"
                );
                (tested, dimmest) = (tested + 1, dimmest.min(found));
            }
            println!("    {falloff:?}, opacity {opacity}: {tested} values, dimmest {dimmest:.2}");
            assert!(tested > 500 && dimmest < 0.9, "{tested} {dimmest}");
        }
    }
}

/// Changes every material.
fn change_materials(stage: &mut Stage, change: impl Fn(&mut StandardMaterial)) {
    let mut materials = stage.world_mut().resource_mut::<Assets<StandardMaterial>>();
    let ids: Vec<_> = materials.ids().collect();
    for id in ids {
        let mut material = materials.get(id).expect("a material").clone();
        change(&mut material);
        drop(materials.insert(id, material));
    }
}

fn a_material_without_fog_keeps_its_indirect_light() {
    let mut stage = full();
    change_materials(&mut stage, |material| material.fog_enabled = false);
    let clear = set::radiance(&mut stage);
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(DistanceFog {
        color: Color::BLACK,
        falloff: FogFalloff::Exponential { density: 0.3 },
        ..Default::default()
    });
    assert!(set::radiance(&mut stage) == clear);
}

/// Occlusion of a texture of one value, after its eight bits.
const OCCLUSION: u8 = 64;

fn occlude(stage: &mut Stage) {
    let texel = [[OCCLUSION; 4]];
    let texture = meshes::texture(stage, TextureFormat::Rgba8Unorm, 1, 1, &texel);
    change_materials(stage, |material| material.occlusion_texture = Some(texture.clone()));
}

fn a_material_s_occlusion_dims_its_indirect_light() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let open = set::radiance(&mut stage);
    occlude(&mut stage);
    let occluded = set::radiance(&mut stage);
    let expected = f32::from(OCCLUSION) / 255.0;
    let mut tested = 0;
    for (open, occluded) in open.rgb.iter().flatten().zip(occluded.rgb.iter().flatten()) {
        if *open > 50.0 {
            assert!((occluded / open - expected).abs() < 0.01, "{occluded} {open}");
            tested += 1;
        }
    }
    assert!(tested > 500, "{tested}");
}

fn the_screen_s_occlusion_dims_indirect_light_in_creases() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let open = set::radiance(&mut stage);
    // The stage's camera has occlusion, and its knob says how much.
    let with_occlusion = |stage: &mut Stage, settings: &str, level: &str| {
        set::apply(stage, &format!("{PLAIN},{settings}ambient_occlusion={level}"));
        set::radiance(stage)
    };
    let dimmed = with_occlusion(&mut stage, "", "16");
    let ratios: Vec<f32> = open
        .rgb
        .iter()
        .zip(&dimmed.rgb)
        .filter(|(open, _)| open[1] > 50.0)
        .map(|(open, dimmed)| dimmed[1] / open[1])
        .collect();
    let (least, most) = ratios
        .iter()
        .fold((f32::MAX, 0.0f32), |(least, most), ratio| (least.min(*ratio), most.max(*ratio)));
    println!("    the screen's occlusion leaves {least:.2} to {most:.2} of indirect light");
    assert!(least < 0.9 && most > 0.95 && most < 1.001, "{least} {most}");
    assert!(with_occlusion(&mut stage, "", "off") == open);

    // Where rays find what occludes, nothing is occluded twice.
    let traced = with_occlusion(&mut stage, "gi_visibility=coarse,", "off");
    assert!(with_occlusion(&mut stage, "gi_visibility=coarse,", "16") == traced);

    // What the material already occludes is not occluded again.
    occlude(&mut stage);
    let material = with_occlusion(&mut stage, "", "off").mean();
    let both = with_occlusion(&mut stage, "", "16").mean();
    assert!((both / material - 1.0).abs() < 0.02, "{both} {material}");
}

fn in_the_composite() {}

fn indirect_light_is_there_before_reflections_and_the_sky() {
    let stage = set::bare_with(vec![], set::radiance_options(32, 32, Component::Full), |app| {
        app.sub_app_mut(RenderApp)
            .add_systems(Core3d, in_the_composite.in_set(GiSystems::Composite));
    });
    let schedules = stage.render_world().resource::<Schedules>();
    let passes: Vec<TypeId> = schedules
        .get(Core3d)
        .expect("the schedule of 3D cameras")
        .systems()
        .expect("it ran")
        .map(|(_, system)| system.system_type())
        .collect();
    let at = |system: TypeId, name: &str| {
        passes.iter().position(|pass| *pass == system).unwrap_or_else(|| panic!("no {name}"))
    };
    let composite = at(in_the_composite.system_type_id(), "composite");
    assert!(at(deferred_lighting.system_type_id(), "deferred lighting") < composite);
    // Bevy draws the sky, whose aerial perspective dims what is behind it, after opaque meshes.
    let (reflections, opaque) =
        (screen_space_reflections.system_type_id(), main_opaque_pass_3d.system_type_id());
    assert!(composite < at(reflections, "screen-space reflections"));
    assert!(composite < at(opaque, "opaque meshes"));
}

/// A volume of one voxel of white light around everything.
fn spawn_volume(stage: &mut Stage) {
    // A voxel's six faces: two along the height, three along the depth.
    let size = Extent3d { width: 1, height: 2, depth_or_array_layers: 3 };
    let faces = vec![255; 6 * 4];
    let format = TextureFormat::Rgba8Unorm;
    let voxels =
        Image::new(size, TextureDimension::D3, faces, format, RenderAssetUsages::RENDER_WORLD);
    let world = stage.world_mut();
    let voxels = world.resource_mut::<Assets<Image>>().add(voxels);
    world.spawn((
        LightProbe::default(),
        IrradianceVolume { voxels, intensity: 2000.0, ..Default::default() },
        Transform::from_scale(Vec3::splat(40.0)),
    ));
}

fn irradiance_volumes_light_only_what_is_not_gathered() {
    let mut stage = full();
    let [direct, all] = both(&mut stage);
    spawn_volume(&mut stage);
    (0..8).for_each(|_| stage.frame());
    let [baked, gathered] = both(&mut stage);
    println!(
        "    mean: direct {:.0}, with a volume {:.0}; gathered {:.0}, with a volume {:.0}",
        direct.mean(),
        baked.mean(),
        all.mean(),
        gathered.mean()
    );
    assert!(baked.mean() > 1.2 * direct.mean(), "without GI the volume lights");
    assert!(gathered == all, "its light does not count twice");
    set::gi(&mut stage).irradiance_volumes = true;
    let added = set::radiance(&mut stage).mean() - all.mean();
    let expected = baked.mean() - direct.mean();
    assert!((added / expected - 1.0).abs() < 0.02, "{added} {expected}");
}

/// The corner with a plate, which has a lightmap or not, without and with indirect light.
fn with_plate(has_lightmap: bool) -> [Radiance; 2] {
    let mut stage = full();
    let mut plate = meshes::plate(true);
    let coordinates = plate.attribute(Mesh::ATTRIBUTE_UV_0).expect("coordinates").clone();
    plate.insert_attribute(Mesh::ATTRIBUTE_UV_1, coordinates);
    let material = StandardMaterial { lightmap_exposure: 5000.0, ..meshes::diffuse(0.8, 0.8, 0.8) };
    let place = Transform::from_xyz(0.0, 0.02, -0.8).with_scale(Vec3::new(3.0, 1.0, 2.0));
    let plate = meshes::spawn(&mut stage, plate, material, place);
    if has_lightmap {
        let image = meshes::texture(&mut stage, TextureFormat::Rgba8Unorm, 1, 1, &[[255; 4]]);
        let lightmap =
            Lightmap { image, uv_rect: Rect::new(0.0, 0.0, 1.0, 1.0), bicubic_sampling: false };
        stage.world_mut().entity_mut(plate).insert(lightmap);
    }
    both(&mut stage)
}

/// A limit, which the documents state: Bevy's deferred rendering passes a lightmap's light on as
/// emission, so that nothing tells a pixel with a lightmap from others.
fn lightmaps_and_gathered_light_add_up() {
    let [direct, all] = with_plate(false).map(|image| image.mean());
    let [baked, added] = with_plate(true).map(|image| image.mean());
    println!(
        "    mean: direct {direct:.0}, gathered {all:.0}; with a lightmap {baked:.0}, {added:.0}"
    );
    assert!(baked > 1.05 * direct, "the lightmap lights");
    assert!(
        ((added - baked) / (all - direct) - 1.0).abs() < 0.02,
        "{added} {baked} {all} {direct}"
    );
}
