//! Indirect light in fog volumes: its closed form, path-traced light, and what fog must not show.

use bevy::asset::{Assets, RenderAssetUsages};
use bevy::camera::Exposure;
use bevy::image::Image;
use bevy::light::{FogVolume, VolumetricFog};
use bevy::math::{DVec3, Quat, Vec3};
use bevy::prelude::{Entity, Transform};
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use frugal::scene::SceneDescription;
use frugal::stage::{Component, Radiance, Stage};
use frugal_tests::{reference, set};
use frugal_trace::scene::CameraPose;

use crate::furnace;

tests!(
    fog_in_a_closed_sphere_is_the_closed_form,
    fog_has_the_light_of_the_path_tracer,
    fog_in_a_dark_room_stays_dark,
    fog_is_lit_once_and_by_choice,
    fog_comes_and_goes_with_gi,
    values_out_of_range_are_no_light,
);

const SETTINGS: &str = "min,effects=high,gi_refresh_period=1,gi_vpl_count=1024,gi_interleave=4x4,gi_visibility=fine,gi_pixel_fraction=1/4,rsm_resolution=128,resolution_scale=100%";
/// Frames until the places' light has settled.
const FRAMES: u32 = 80;
const SIZE: (u32, u32) = (48, 32);

/// Fog with coefficients in 1/m.
fn fog(scattering: f32, absorption: f32) -> FogVolume {
    FogVolume {
        density_factor: 1.0,
        scattering,
        absorption,
        scattering_asymmetry: 0.0,
        ..Default::default()
    }
}

/// A scene in which the camera draws fog.
fn stage(scene: &str, eye: Vec3, target: Vec3) -> Stage {
    let options = set::radiance_options(SIZE.0, SIZE.1, Component::Full);
    let mut stage = set::open(&set::scene(scene), options);
    let camera = set::camera(&mut stage);
    // This ambient light would be seen.
    let drawn = VolumetricFog { ambient_intensity: 100.0, step_count: 64, ..Default::default() };
    stage.world_mut().entity_mut(camera).insert(drawn);
    set::apply(&mut stage, SETTINGS);
    set::look(&mut stage, eye, target);
    stage
}

fn add(stage: &mut Stage, fog: FogVolume, place: Transform) -> Entity {
    stage.world_mut().spawn((fog, place)).id()
}

fn frames(stage: &mut Stage, count: u32) -> Radiance {
    (0..count).for_each(|_| stage.frame());
    stage.radiance().expect("an image")
}

fn sum(radiance: &Radiance) -> f64 {
    radiance.rgb.iter().flatten().map(|value| f64::from(*value)).sum()
}

fn fog_in_a_closed_sphere_is_the_closed_form() {
    let (eye, target) = (Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.0, 0.4, -2.0));
    let mut stage = stage("furnace", eye, target);
    let clear = frames(&mut stage, FRAMES);
    let place = Transform::from_scale(Vec3::splat(10.0));
    let volume = add(&mut stage, fog(0.0, 0.2), place);
    let dimmed = frames(&mut stage, 20);
    // The wall's light reaches every point from every side, so that the phase function does not count.
    for (asymmetry, scattering) in [(0.0, 0.15), (0.7, 0.15), (-0.4, 0.05)] {
        let thick =
            FogVolume { scattering_asymmetry: asymmetry, ..fog(scattering, 0.2 - scattering) };
        stage.world_mut().entity_mut(volume).insert(thick);
        let foggy = frames(&mut stage, FRAMES);
        let light = furnace::direct_radiance();
        let mut worst: f64 = 0.0;
        for ((clear, dimmed), foggy) in clear.rgb.iter().zip(&dimmed.rgb).zip(&foggy.rgb) {
            let [clear, dimmed, foggy] = [clear, dimmed, foggy].map(|rgb| f64::from(rgb[1]));
            let expected = light * f64::from(scattering) / 0.2 * (1.0 - dimmed / clear);
            worst = worst.max(((foggy - dimmed) / expected - 1.0).abs());
        }
        println!("    asymmetry {asymmetry}: off by at most {:.1} %", 100.0 * worst);
        // The places' noise; that of their first moment counts with three times the asymmetry.
        assert!(worst < 0.06 + 0.12 * f64::from(asymmetry.abs()), "{worst}");
    }
    // Beer and Lambert: the wall is 2.2 to 2.6 m away.
    let ratio = sum(&dimmed) / sum(&clear);
    assert!(((-0.2_f64 * 2.6).exp()..(-0.2_f64 * 2.2).exp()).contains(&ratio), "{ratio}");
    // A texture of half the density is fog of half the density.
    let mut images = stage.world_mut().resource_mut::<Assets<Image>>();
    let half = images.add(Image::new_fill(
        Extent3d { width: 2, height: 2, depth_or_array_layers: 2 },
        TextureDimension::D3,
        &[128],
        TextureFormat::R8Unorm,
        RenderAssetUsages::all(),
    ));
    let textured = FogVolume { density_texture: Some(half), ..fog(0.3, 0.1) };
    stage.world_mut().entity_mut(volume).insert(textured);
    let textured = sum(&frames(&mut stage, FRAMES));
    stage.world_mut().entity_mut(volume).insert(fog(0.3 * 128.0 / 255.0, 0.1 * 128.0 / 255.0));
    let even = sum(&frames(&mut stage, 20));
    assert!((textured / even - 1.0).abs() < 2e-3, "{textured} {even}");
}

/// Punctual lights' first reflection as a point receives it, by path tracing: directions that it comes
/// from, radiance, and solid angles.
fn traced(scene: &SceneDescription, at: Vec3) -> Vec<(DVec3, f64, f64)> {
    let mut found = Vec::new();
    for (forward, up) in [
        (Vec3::X, Vec3::Y),
        (Vec3::NEG_X, Vec3::Y),
        (Vec3::Y, Vec3::Z),
        (Vec3::NEG_Y, Vec3::Z),
        (Vec3::Z, Vec3::Y),
        (Vec3::NEG_Z, Vec3::Y),
    ] {
        let rotation = Transform::default().looking_to(forward, up).rotation;
        let (view, seen) = reference::seen_from(scene, CameraPose { position: at, rotation }, 16);
        found.extend(view.rays().into_iter().zip(&seen.rgb).map(|(direction, rgb)| {
            let cosine = direction.dot(forward.as_dvec3());
            (direction, f64::from(rgb[1]), cosine * cosine * cosine)
        }));
    }
    found
}

/// Mean of light, weighed by the phase function towards an eye that looks along `along` (Henyey and
/// Greenstein 1941).
fn scattered(light: &[(DVec3, f64, f64)], along: DVec3, asymmetry: f64) -> f64 {
    let square = asymmetry * asymmetry;
    let phase = |direction: DVec3| {
        (1.0 - square) / (1.0 + square - 2.0 * asymmetry * direction.dot(along)).powf(1.5)
    };
    let sum: f64 =
        light.iter().map(|(from, radiance, angle)| phase(*from) * radiance * angle).sum();
    sum / light.iter().map(|(_, _, angle)| angle).sum::<f64>()
}

fn fog_has_the_light_of_the_path_tracer() {
    let extinction = 0.1;
    let scene = set::scene("two_rooms");
    // Of the logarithm, over views: with the first moment of the phase function, and without.
    let mut errors = [0.0; 2];
    for (eye, target) in [
        (Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6)),
        (Vec3::new(-1.0, 0.6, -1.6), Vec3::new(-2.4, 2.2, 1.4)),
        (Vec3::new(-3.2, 2.0, 1.8), Vec3::new(-1.6, 0.2, -1.4)),
    ] {
        let along = (target - eye).as_dvec3().normalize();
        let mut stage = stage("two_rooms", eye, target);
        set::make_lambertian(&mut stage);
        // A cube of 1.2 m, 1 m ahead of the eye, as the eye looks.
        let rotation = Quat::from_rotation_arc(Vec3::NEG_Z, along.as_vec3());
        let translation = eye + along.as_vec3() * 1.6;
        let place = Transform { translation, rotation, scale: Vec3::splat(1.2) };
        let volume = add(&mut stage, fog(0.0, extinction), place);
        let center = |stage: &mut Stage, count: u32| {
            let image = frames(stage, count);
            let pixels = [(23, 15), (24, 15), (23, 16), (24, 16)];
            pixels.iter().map(|(x, y)| f64::from(image.rgb[y * 48 + x][1])).sum::<f64>() / 4.0
        };
        let dimmed = center(&mut stage, FRAMES);
        let points: Vec<f64> = (0..4).map(|i| (f64::from(i) + 0.5) * 0.3).collect();
        let light: Vec<_> = points
            .iter()
            .map(|away| traced(&scene, eye + (along * (1.0 + away)).as_vec3()))
            .collect();
        let mut shown = |asymmetry: f32| {
            let scatters = FogVolume { scattering_asymmetry: asymmetry, ..fog(extinction, 0.0) };
            stage.world_mut().entity_mut(volume).insert(scatters);
            let shown = center(&mut stage, 4) - dimmed;
            let expected: f64 = points
                .iter()
                .zip(&light)
                .map(|(away, light)| {
                    let scattered = scattered(light, along, f64::from(asymmetry));
                    0.3 * f64::from(extinction) * (-f64::from(extinction) * away).exp() * scattered
                })
                .sum();
            println!("    asymmetry {asymmetry} from {eye}: {shown:.4} of {expected:.4} nits");
            [shown, expected]
        };
        let [even, expected] = shown(0.0);
        assert!((0.9..1.1).contains(&(even / expected)), "{even} {expected}");
        for asymmetry in [0.5, -0.3] {
            let [shown, expected] = shown(asymmetry);
            assert!((0.75..1.33).contains(&(shown / expected)), "{shown} {expected}");
            for (error, light) in errors.iter_mut().zip([shown, even]) {
                *error += (light / expected).ln().abs() / 6.0;
            }
        }
    }
    println!("    asymmetric fog: off by {:.3}, as even fog by {:.3}", errors[0], errors[1]);
    assert!(errors[0] < 0.6 * errors[1], "{errors:?}");
}

fn fog_in_a_dark_room_stays_dark() {
    let mut stage = stage("two_rooms", Vec3::new(0.8, 1.7, 2.0), Vec3::new(3.2, 1.0, -1.6));
    let place = Transform::from_xyz(2.0, 1.4, 0.0).with_scale(Vec3::new(3.6, 2.6, 4.4));
    add(&mut stage, fog(0.5, 0.0), place);
    let darkest = [4, 30, 80].map(|count| frames(&mut stage, count).mean());
    println!("    {darkest:?} nits");
    assert!(darkest.iter().all(|mean| *mean <= 1e-3), "{darkest:?}");
}

fn fog_is_lit_once_and_by_choice() {
    let (eye, target) = (Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6));
    let mut stage = stage("two_rooms", eye, target);
    let clear = sum(&frames(&mut stage, FRAMES));
    let held = set::gathered(&stage).bytes;
    let place = Transform::from_scale(Vec3::splat(20.0));
    let volume = add(&mut stage, fog(0.02, 0.0), place);
    let foggy = sum(&frames(&mut stage, FRAMES));
    assert!(set::gathered(&stage).bytes > held);
    let change = (foggy / clear - 1.0).abs();
    println!("    thin fog changes the image by {:.2} %", 100.0 * change);
    // Bevy's ambient light of 100 would be thousands of nits.
    assert!((1e-3..0.1).contains(&change), "{change}");
    // Fog that the camera does not light is not drawn: Bevy draws none without volumetric lights.
    set::gi(&mut stage).fog = false;
    assert_eq!(sum(&frames(&mut stage, 8)), clear);
    set::gi(&mut stage).fog = true;
    assert!(sum(&frames(&mut stage, 8)) != clear);
    stage.world_mut().despawn(volume);
    assert_eq!(sum(&frames(&mut stage, 8)), clear);
}

fn fog_comes_and_goes_with_gi() {
    let (eye, target) = (Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6));
    let mut stage = stage("two_rooms", eye, target);
    add(&mut stage, fog(0.5, 0.0), Transform::from_scale(Vec3::splat(20.0)));
    let lit = frames(&mut stage, FRAMES).mean();
    let off = format!("{SETTINGS},gi_vpl_count=0");
    // GI fades in 0.8 s, 24 frames.
    let mut seen = vec![lit];
    set::switch(&mut stage, &off);
    seen.extend((0..30).map(|_| frames(&mut stage, 1).mean()));
    let clear = seen[seen.len() - 1];
    set::switch(&mut stage, SETTINGS);
    seen.extend((0..30).map(|_| frames(&mut stage, 1).mean()));
    let most = seen.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    println!("    {lit} to {clear} nits, {most} at most in a frame");
    assert!((lit - clear).abs() > 0.2 * clear, "{lit} and {clear} nits");
    // What fog hides fades beside what it adds, so that steps differ.
    assert!(most < 0.2 * (lit - clear).abs(), "{seen:?}");
}

fn values_out_of_range_are_no_light() {
    let (eye, target) = (Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6));
    let mut stage = stage("two_rooms", eye, target);
    let clear = sum(&frames(&mut stage, 20));
    let place = Transform::from_scale(Vec3::splat(20.0));
    let volume = add(&mut stage, fog(0.0, 0.0), place);
    for value in [f32::NAN, f32::INFINITY, -1.0, 0.0] {
        let wrong = FogVolume { density_factor: value, ..fog(0.1, 0.1) };
        stage.world_mut().entity_mut(volume).insert(wrong);
        assert_eq!(sum(&frames(&mut stage, 3)), clear, "density {value}");
    }
    let finite = |stage: &mut Stage, what: &str| {
        let image = frames(stage, 3);
        assert!(image.rgb.iter().flatten().all(|value| (0.0..1e8).contains(value)), "{what}");
    };
    for value in [f32::NAN, f32::NEG_INFINITY, 1e-30, 1e30, -5.0] {
        let odd = FogVolume {
            scattering: value,
            scattering_asymmetry: value,
            light_intensity: value,
            density_texture_offset: Vec3::splat(value),
            ..fog(0.1, 0.1)
        };
        stage.world_mut().entity_mut(volume).insert(odd);
        finite(&mut stage, &format!("{value}"));
    }
    stage.world_mut().entity_mut(volume).insert(fog(0.1, 0.1));
    for scale in [Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::splat(1e20), Vec3::splat(f32::NAN)] {
        stage.world_mut().entity_mut(volume).insert(Transform::from_scale(scale));
        finite(&mut stage, &format!("{scale}"));
    }
    // Without exposure, without steps.
    stage.world_mut().entity_mut(volume).insert(place);
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(Exposure { ev100: 30.0 });
    finite(&mut stage, "dark");
    let none = VolumetricFog { step_count: 0, ..Default::default() };
    stage.world_mut().entity_mut(camera).insert(none);
    finite(&mut stage, "no steps");
}
