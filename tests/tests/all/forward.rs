//! Indirect light on meshes that are not deferred: as on deferred ones, once, and not through walls.

use bevy::color::LinearRgba;
use bevy::light::EnvironmentMapLight;
use bevy::material::OpaqueRendererMethod;
use bevy::math::Vec3;
use bevy::pbr::StandardMaterial;
use bevy::prelude::{AlphaMode, Cuboid, Mesh, Transform};
use bevy_frugal_gi::gi::GiRefresh;
use frugal::stage::{Component, Radiance, Stage};
use frugal_tests::{meshes, set};

tests!(
    twins_receive_what_deferred_meshes_do,
    deferred_meshes_are_lit_once,
    the_dark_room_stays_dark,
    without_such_meshes_nothing_is_kept,
    light_settles_and_then_takes_no_rays,
    spacings_out_of_range_are_no_light,
);

const SETTINGS: &str = "min,gi_refresh_period=1,gi_vpl_count=1024,gi_interleave=4x4,gi_visibility=fine,gi_environment_samples=32,gi_pixel_fraction=1/1,rsm_resolution=128,resolution_scale=100%";

/// How a mesh is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drawn {
    Deferred,
    Forward,
    /// Forward, and moved by a joint alone.
    Skinned,
    /// Of opacity 1, among transparent meshes.
    Blended,
    /// Deferred, and so bright that it tells its pixels.
    Emissive,
}

impl Drawn {
    fn material(self) -> StandardMaterial {
        let mut material = meshes::diffuse(0.7, 0.7, 0.7);
        match self {
            Self::Deferred => {}
            Self::Forward | Self::Skinned => {
                material.opaque_render_method = OpaqueRendererMethod::Forward;
            }
            Self::Blended => material.alpha_mode = AlphaMode::Blend,
            Self::Emissive => material.emissive = LinearRgba::rgb(1e4, 1e4, 1e4),
        }
        material
    }
}

fn frames(stage: &mut Stage, count: u32) -> Radiance {
    (0..count).for_each(|_| stage.frame());
    stage.radiance().expect("an image")
}

/// A scene with a box of 40 cm at a place, seen from another.
fn with_twin(scene: &str, at: Vec3, eye: Vec3, drawn: Drawn) -> Stage {
    let options = set::radiance_options(64, 64, Component::Full);
    let mut stage = set::open(&set::scene(scene), options);
    let (twin, place) = (Mesh::from(Cuboid::from_length(0.4)), Transform::from_translation(at));
    if drawn == Drawn::Skinned {
        let twin = meshes::with_joints(twin, |_| 0);
        let twin = meshes::spawn(&mut stage, twin, drawn.material(), Transform::default());
        let joint = meshes::add_joints(&mut stage, twin, 1)[0];
        stage.world_mut().entity_mut(joint).insert(place);
    } else {
        meshes::spawn(&mut stage, twin, drawn.material(), place);
    }
    set::apply(&mut stage, SETTINGS);
    // As Bevy's forward shading of ambient light.
    set::make_lambertian(&mut stage);
    set::look(&mut stage, eye, at);
    stage
}

/// The image without light of bounces and of the sky, and with it.
fn both(stage: &mut Stage, count: u32) -> [Radiance; 2] {
    let all = frames(stage, count);
    // Without GI, Bevy's own light of the sky has no shadows.
    let camera = set::camera(stage);
    stage.world_mut().entity_mut(camera).remove::<EnvironmentMapLight>();
    set::apply(stage, &format!("{SETTINGS},gi_vpl_count=0"));
    [frames(stage, 8), all]
}

fn luminance(rgb: &[f32; 3]) -> f64 {
    rgb.iter().map(|value| f64::from(*value)).sum()
}

fn twins_receive_what_deferred_meshes_do() {
    // In a lit room: near its middle, near the floor, near walls, in a corner.
    for (scene, at, eye) in [
        ("two_rooms", Vec3::new(-2.0, 1.2, -0.6), Vec3::new(-2.6, 1.6, 0.9)),
        ("two_rooms", Vec3::new(-1.2, 0.25, 0.9), Vec3::new(-2.6, 1.2, -0.2)),
        ("two_rooms", Vec3::new(-3.4, 1.0, -1.4), Vec3::new(-2.2, 1.5, -0.4)),
        ("two_rooms", Vec3::new(-0.6, 1.6, -1.7), Vec3::new(-1.8, 1.5, -0.6)),
        ("two_rooms", Vec3::new(-3.0, 0.6, 1.6), Vec3::new(-1.8, 1.3, 0.8)),
    ] {
        let [emissive, _] = both(&mut with_twin(scene, at, eye, Drawn::Emissive), 8);
        let images = [Drawn::Deferred, Drawn::Forward, Drawn::Blended, Drawn::Skinned]
            .map(|drawn| both(&mut with_twin(scene, at, eye, drawn), 160));
        let [deferred, _] = &images[0];
        let emits =
            |i: usize| luminance(&emissive.rgb[i]) > 2.0 * luminance(&deferred.rgb[i]) + 1.0;
        let pixels: Vec<usize> = (0..deferred.rgb.len()).filter(|i| emits(*i)).collect();
        let [reference, forward, blended, skinned] = images.map(|[direct, all]| {
            let sum: f64 =
                pixels.iter().map(|i| luminance(&all.rgb[*i]) - luminance(&direct.rgb[*i])).sum();
            sum / pixels.len() as f64
        });
        println!(
            "    {scene} {at}: {} pixels, {reference:.2}; forward {:.3}, blended {:.3}, skinned {:.3} of it",
            pixels.len(),
            forward / reference,
            blended / reference,
            skinned / reference
        );
        assert!(pixels.len() > 60 && reference > 0.1, "{} {reference}", pixels.len());
        for ratio in [forward, blended, skinned].map(|light| light / reference) {
            assert!((0.85..=1.15).contains(&ratio), "{scene} {at}: {ratio}");
        }
    }
}

fn deferred_meshes_are_lit_once() {
    let (at, eye) = (Vec3::new(-2.0, 1.2, -0.6), Vec3::new(-2.6, 1.6, 0.9));
    let image = |spacing: f32| {
        let mut stage = with_twin("two_rooms", at, eye, Drawn::Forward);
        set::gi(&mut stage).forward_spacing = spacing;
        frames(&mut stage, 60)
    };
    let (with, without) = (image(0.5), image(0.0));
    let differ: Vec<usize> =
        (0..with.rgb.len()).filter(|i| with.rgb[*i] != without.rgb[*i]).collect();
    // The box covers a part of the image; its surroundings are the same to the last bit.
    println!("    {} of {} pixels differ", differ.len(), with.rgb.len());
    assert!((100..with.rgb.len() / 2).contains(&differ.len()), "{}", differ.len());
    assert!(differ.iter().all(|i| luminance(&with.rgb[*i]) > luminance(&without.rgb[*i])));
    let corners = [0, 63, 64 * 63, 64 * 64 - 1];
    assert!(corners.iter().all(|corner| !differ.contains(corner)));
}

fn the_dark_room_stays_dark() {
    let (at, eye) = (Vec3::new(2.2, 1.2, -0.6), Vec3::new(1.4, 1.5, 0.9));
    for drawn in [Drawn::Forward, Drawn::Blended] {
        let mut stage = with_twin("two_rooms", at, eye, drawn);
        let mut darkest: f64 = 0.0;
        for count in [4, 30, 100] {
            darkest = darkest.max(frames(&mut stage, count).mean());
        }
        println!("    {drawn:?}: at most {darkest:.6} nits");
        assert!(darkest <= 1e-3, "{darkest}");
    }
}

fn without_such_meshes_nothing_is_kept() {
    let (at, eye) = (Vec3::new(-2.0, 1.2, -0.6), Vec3::new(-2.6, 1.6, 0.9));
    let bytes = |drawn, spacing: f32| {
        let mut stage = with_twin("two_rooms", at, eye, drawn);
        set::gi(&mut stage).forward_spacing = spacing;
        frames(&mut stage, 12);
        set::gathered(&stage).bytes as i64
    };
    let kept = bytes(Drawn::Forward, 0.5) - bytes(Drawn::Forward, 0.0);
    println!("    {kept} bytes");
    assert!((1_000_000..2_600_000).contains(&kept), "{kept}");
    assert_eq!(bytes(Drawn::Deferred, 0.5), bytes(Drawn::Deferred, 0.0));
}

fn light_settles_and_then_takes_no_rays() {
    let (at, eye) = (Vec3::new(-2.0, 1.2, -0.6), Vec3::new(-2.6, 1.6, 0.9));
    let mut stage = with_twin("two_rooms", at, eye, Drawn::Forward);
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    frames(&mut stage, 30);
    let begun = set::gathered(&stage).rays;
    frames(&mut stage, 600);
    let settled = set::gathered(&stage).rays;
    println!("    {begun} rays, settled {settled}");
    assert!(begun > 0 && settled == 0, "{begun} {settled}");
}

fn spacings_out_of_range_are_no_light() {
    let (at, eye) = (Vec3::new(-2.0, 1.2, -0.6), Vec3::new(-2.6, 1.6, 0.9));
    let mut stage = with_twin("two_rooms", at, eye, Drawn::Forward);
    frames(&mut stage, 4);
    set::gi(&mut stage).forward_spacing = 0.0;
    let none = frames(&mut stage, 8);
    for spacing in [f32::NAN, f32::INFINITY, -1.0] {
        set::gi(&mut stage).forward_spacing = spacing;
        assert!(frames(&mut stage, 8) == none, "{spacing}");
    }
    for spacing in [1e-30, 1e-3, 1e30] {
        set::gi(&mut stage).forward_spacing = spacing;
        let image = frames(&mut stage, 8);
        assert!(image.rgb.iter().flatten().all(|value| value.is_finite()), "{spacing}");
    }
}
