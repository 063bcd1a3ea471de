//! Resolution scale where several cameras draw on one target, in viewports, and in screenshots.

use std::sync::{Arc, Mutex};

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Camera, Camera3d, ClearColorConfig, Hdr, RenderTarget, Viewport};
use bevy::color::Color;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::ecs::entity::Entity;
use bevy::math::{UVec2, Vec3};
use bevy::prelude::{Mesh3d, MeshMaterial3d, On};
use bevy::render::view::Msaa;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::transform::components::Transform;
use bevy_frugal_gi::resolution::ResolutionScale;
use frugal::stage::Stage;
use frugal_tests::set;
use frugal_trace::metrics::Picture;

tests!(
    a_scaled_overlay_leaves_the_image_under_it,
    a_scaled_overlay_draws_over_the_image,
    an_overlay_over_a_scaled_camera_leaves_its_image,
    a_viewport_is_filled_and_nothing_else,
    a_screenshot_shows_a_scaled_camera,
    every_scale_and_size_of_two_cameras_renders
);

const SIZE: UVec2 = UVec2::new(64, 36);

/// The layer of what overlays show.
const OVERLAY: RenderLayers = RenderLayers::layer(3);

fn stage() -> Stage {
    let mut stage = set::open(&set::scene("cornell"), set::options(SIZE.x, SIZE.y));
    set::look(&mut stage, Vec3::new(0.0, 1.0, 3.4), Vec3::new(0.0, 1.0, 0.0));
    set::apply(&mut stage, "min,resolution_scale=100%,gi_vpl_count=64");
    stage
}

fn picture(stage: &mut Stage) -> Picture {
    stage.get_ready().expect("a ready stage");
    stage.picture().expect("an image")
}

/// Adds a camera to the stage's target that is drawn after its own.
fn overlay(stage: &mut Stage, scale: f32) -> Entity {
    let camera = set::camera(stage);
    let world = stage.world_mut();
    let target = world.get::<RenderTarget>(camera).expect("a target").clone();
    let at = Transform::from_xyz(0.0, 0.0, 4.0);
    world
        .spawn((
            Camera3d::default(),
            Camera { order: 1, clear_color: ClearColorConfig::None, ..Default::default() },
            target,
            (Hdr, Msaa::Off, Tonemapping::None, DebandDither::Disabled),
            ResolutionScale(scale),
            OVERLAY,
            at,
        ))
        .id()
}

fn scale(stage: &mut Stage, scale: &str) {
    set::apply(stage, &format!("min,resolution_scale={scale},gi_vpl_count=64"));
}

/// Number of pixels that differ by more than `tolerance`, and their columns' range.
fn differing(a: &Picture, b: &Picture, tolerance: u8) -> (usize, Option<(u32, u32)>) {
    let columns: Vec<u32> = a
        .rgb
        .iter()
        .zip(&b.rgb)
        .enumerate()
        .filter(|(_, (a, b))| a.iter().zip(b.iter()).any(|(a, b)| a.abs_diff(*b) > tolerance))
        .map(|(index, _)| index as u32 % a.width)
        .collect();
    let range = columns.iter().min().copied().zip(columns.iter().max().copied());
    (columns.len(), range)
}

fn a_scaled_overlay_leaves_the_image_under_it() {
    let mut stage = stage();
    let alone = picture(&mut stage);
    for scale in [0.5, 0.83, 1.0] {
        let camera = overlay(&mut stage, scale);
        let both = picture(&mut stage);
        assert_eq!(differing(&alone, &both, 0), (0, None), "an empty overlay at {scale}");
        stage.world_mut().despawn(camera);
    }
    assert_eq!(differing(&alone, &picture(&mut stage), 0), (0, None));
}

fn a_scaled_overlay_draws_over_the_image() {
    let mut stage = stage();
    let alone = picture(&mut stage);
    overlay(&mut stage, 0.5);
    let world = stage.world_mut();
    let mesh = world
        .resource_mut::<bevy::asset::Assets<bevy::mesh::Mesh>>()
        .add(bevy::prelude::Cuboid::new(1.0, 1.0, 0.1));
    let material = world.resource_mut::<bevy::asset::Assets<bevy::pbr::StandardMaterial>>().add(
        bevy::pbr::StandardMaterial {
            base_color: Color::srgb(1.0, 1.0, 1.0),
            unlit: true,
            ..Default::default()
        },
    );
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), OVERLAY, Transform::default()));
    let both = picture(&mut stage);
    let (count, columns) = differing(&alone, &both, 0);
    // A square of 1 m, 4 m away, in a field of view of 45 degrees: 0.3 of the height.
    println!("    {count} pixels in columns {columns:?} differ");
    assert!((60..=220).contains(&count), "{count} pixels");
    assert!(columns.is_some_and(|(first, last)| first >= 20 && last <= 43), "{columns:?}");
    let middle = both.rgb[(SIZE.y / 2 * SIZE.x + SIZE.x / 2) as usize];
    assert!(middle.iter().all(|value| *value > 200), "{middle:?}");
}

fn an_overlay_over_a_scaled_camera_leaves_its_image() {
    let mut stage = stage();
    scale(&mut stage, "50%");
    let alone = picture(&mut stage);
    for scale in [0.5, 0.7, 1.0] {
        let camera = overlay(&mut stage, scale);
        let both = picture(&mut stage);
        assert_eq!(differing(&alone, &both, 0), (0, None), "an empty overlay at {scale}");
        stage.world_mut().despawn(camera);
    }
}

fn set_viewport(stage: &mut Stage, camera: Entity, x: u32, width: u32) {
    stage.world_mut().get_mut::<Camera>(camera).expect("a camera").viewport = Some(Viewport {
        physical_position: UVec2::new(x, 0),
        physical_size: UVec2::new(width, SIZE.y),
        ..Default::default()
    });
}

fn a_viewport_is_filled_and_nothing_else() {
    let mut stage = stage();
    let camera = set::camera(&mut stage);
    let half = SIZE.x / 2;
    set_viewport(&mut stage, camera, half, half);
    let native = picture(&mut stage);
    scale(&mut stage, "50%");
    let scaled = picture(&mut stage);
    let (count, columns) = differing(&native, &scaled, 2);
    println!("    {count} pixels in columns {columns:?} differ at half the resolution");
    assert!(count > 20, "the scale has an effect in a viewport");
    assert!(columns.is_some_and(|(first, _)| first >= half), "{columns:?}");
    // The same image as at another scale, softer.
    scale(&mut stage, "90%");
    let finer = picture(&mut stage);
    let sum = |picture: &Picture| {
        let inside = picture.rgb.iter().enumerate();
        let inside = inside.filter(|(index, _)| *index as u32 % SIZE.x >= half);
        inside.flat_map(|(_, rgb)| rgb.map(f64::from)).sum::<f64>()
    };
    let (coarse, fine) = (sum(&scaled), sum(&finer));
    assert!((coarse / fine - 1.0).abs() < 0.05, "{coarse} at 50 %, {fine} at 90 %");
    assert!(differing(&finer, &scaled, 0).1.is_some_and(|(first, _)| first >= half));
}

fn a_screenshot_shows_a_scaled_camera() {
    let mut stage = stage();
    scale(&mut stage, "50%");
    let shown = picture(&mut stage);
    let camera = set::camera(&mut stage);
    let world = stage.world_mut();
    let target = world.get::<RenderTarget>(camera).expect("a target").clone();
    let texels = Arc::new(Mutex::new(None));
    let taken = Arc::clone(&texels);
    world.spawn(Screenshot(target)).observe(move |shot: On<ScreenshotCaptured>| {
        *taken.lock().expect("the texels") = shot.image.data.clone();
    });
    // It arrives some frames later.
    let taken = (0..1000).find_map(|_| {
        stage.frame();
        std::thread::sleep(std::time::Duration::from_millis(1));
        texels.lock().expect("the texels").take()
    });
    let taken: Vec<u8> = taken.expect("a screenshot");
    let taken: f64 = taken.chunks_exact(4).flat_map(|it| &it[..3]).map(|it| f64::from(*it)).sum();
    let shown: f64 = shown.rgb.iter().flatten().map(|value| f64::from(*value)).sum();
    assert!((taken / shown - 1.0).abs() < 0.05, "{taken} in the screenshot, {shown} on the target");
}

fn every_scale_and_size_of_two_cameras_renders() {
    let mut stage = stage();
    let half = SIZE.x / 2;
    let first = set::camera(&mut stage);
    let second = overlay(&mut stage, 0.5);
    for scale_text in ["50%", "70%", "100%"] {
        for other in [0.1, 0.5, 1.0] {
            scale(&mut stage, scale_text);
            stage.world_mut().entity_mut(second).insert(ResolutionScale(other));
            (0..2).for_each(|_| stage.frame());
            set_viewport(&mut stage, first, 0, half);
            set_viewport(&mut stage, second, half, half);
            (0..2).for_each(|_| stage.frame());
            for camera in [first, second] {
                stage.world_mut().get_mut::<Camera>(camera).expect("a camera").viewport = None;
            }
        }
    }
    assert!(picture(&mut stage).rgb.iter().any(|rgb| rgb[0] > 0));
}
