//! Cameras far from what they look at: telephoto lenses, parallel projections, views from above a
//! large world.

use bevy::camera::{OrthographicProjection, PerspectiveProjection, Projection, ScalingMode};
use bevy::math::Vec3;
use frugal::stage::{Component, Radiance, Stage};
use frugal_tests::{meshes, set};

use super::gi::{PLAIN, sun};
use super::refresh::turn_the_sun;

tests!(
    a_distant_camera_sees_the_sun_s_bounce_where_it_looks,
    the_view_distance_leaves_out_what_is_far,
    a_distant_parallel_camera_sees_what_a_near_one_sees,
    a_parallel_camera_and_a_long_lens_have_a_history,
);

/// A corner in the middle of a dark plain of 2 km.
fn plain() -> Stage {
    let mut stage = set::bare(
        vec![sun(Vec3::new(0.1, -1.0, -0.1))],
        set::radiance_options(48, 27, Component::Indirect),
    );
    meshes::spawn_corner(&mut stage, 0.5);
    let dark = meshes::diffuse(0.02, 0.02, 0.02);
    meshes::spawn_box(&mut stage, Vec3::new(0.0, -1.5, 0.0), Vec3::new(2000.0, 1.0, 2000.0), dark);
    set::apply(&mut stage, &format!("{PLAIN},rsm_resolution=128,view_distance=100%"));
    stage
}

fn set_lens(stage: &mut Stage, lens: impl Into<Projection>) {
    let camera = set::camera(stage);
    *stage.world_mut().get_mut::<Projection>(camera).expect("a lens") = lens.into();
}

/// A parallel projection 4 m high.
fn parallel() -> OrthographicProjection {
    OrthographicProjection {
        near: 0.0,
        far: 2000.0,
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 4.0 },
        ..OrthographicProjection::default_3d()
    }
}

/// From which the corner is seen.
const TOWARD: Vec3 = Vec3::new(0.2, 0.5, 1.0);
const CORNER: Vec3 = Vec3::new(0.0, 0.6, -1.0);

fn seen_from(stage: &mut Stage, distance: f32) -> Radiance {
    set::look(stage, CORNER + TOWARD.normalize() * distance, CORNER);
    set::radiance(stage)
}

fn a_distant_camera_sees_the_sun_s_bounce_where_it_looks() {
    let mut stage = plain();
    let near = seen_from(&mut stage, 6.0).mean();
    // A telephoto lens with the same field of view across the corner.
    let lens = stage.vertical_fov_degrees().to_radians();
    for distance in [60.0, 200.0, 600.0] {
        let fov = 2.0 * ((0.5 * lens).tan() * 6.0 / distance).atan();
        set_lens(
            &mut stage,
            PerspectiveProjection { fov, near: 1.0, far: 2000.0, ..Default::default() },
        );
        let far = seen_from(&mut stage, distance).mean();
        println!("    from {distance} m: {far:.1} nits, from 6 m: {near:.1}");
        assert!((far / near - 1.0).abs() < 0.25, "from {distance} m: {far} {near}");
    }
}

fn the_view_distance_leaves_out_what_is_far() {
    let mut stage = plain();
    let fov = stage.vertical_fov_degrees().to_radians();
    let mut at = |level: &str, distance: f32| {
        set::apply(&mut stage, &format!("{PLAIN},rsm_resolution=128,view_distance={level}"));
        set_lens(
            &mut stage,
            PerspectiveProjection { fov, near: 0.1, far: 40.0, ..Default::default() },
        );
        seen_from(&mut stage, distance).mean()
    };
    // From 15 m away all but the ground, on which the camera stands, is beyond 10 m.
    let shares: Vec<f64> =
        ["25%", "50%", "75%"].iter().map(|level| at(level, 15.0) / at("100%", 15.0)).collect();
    println!("    from 15 m, of a far plane at 40 m: {shares:.3?} of the light");
    assert!(shares[0] < 0.5 && (shares[1] - 1.0).abs() < 0.02 && (shares[2] - 1.0).abs() < 0.02);
    let near = at("25%", 6.0) / at("100%", 6.0);
    assert!((near - 1.0).abs() < 0.02, "from 6 m: {near:.3} of the light");
}

fn a_distant_parallel_camera_sees_what_a_near_one_sees() {
    let mut stage = plain();
    set_lens(&mut stage, parallel());
    for rays in ["none", "coarse"] {
        set::apply(
            &mut stage,
            &format!("{PLAIN},rsm_resolution=128,view_distance=100%,gi_visibility={rays}"),
        );
        let near = seen_from(&mut stage, 10.0);
        for distance in [100.0, 1000.0] {
            let far = seen_from(&mut stage, distance);
            let pairs = far.rgb.iter().flatten().zip(near.rgb.iter().flatten());
            let off = pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
                / near.rgb.len() as f64
                / 3.0
                / near.mean();
            println!("    rays {rays}, from {distance} m: off by {off:.3}");
            assert!(off < 0.1 && near.mean() > 1.0, "rays {rays}, from {distance} m: {off}");
        }
    }
}

/// Mean change from frame to frame while the camera moves sideways and the sun turns, relative to
/// the mean.
fn flicker(lens: &Projection, distance: f32, frames: u32) -> f64 {
    let mut stage = plain();
    set_lens(&mut stage, lens.clone());
    set::apply(&mut stage, &format!("{PLAIN},gi_vpl_count=64,gi_interleave=4x4"));
    let mut last = seen_from(&mut stage, distance);
    set::gi(&mut stage).history_frames = frames;
    let mut change = 0.0;
    for frame in 0..24 {
        turn_the_sun(&mut stage, 0.002);
        let aside = Vec3::X * 0.005 * (frame + 1) as f32;
        let eye = CORNER + TOWARD.normalize() * distance;
        set::look(&mut stage, eye + aside, CORNER + aside);
        stage.frame();
        let next = stage.radiance().expect("radiance");
        let pairs = next.rgb.iter().flatten().zip(last.rgb.iter().flatten());
        let sum: f64 = pairs.map(|(a, b)| f64::from((a - b).abs())).sum();
        change += if frame < 8 { 0.0 } else { sum / next.rgb.len() as f64 / 3.0 / next.mean() };
        last = next;
    }
    change / 16.0
}

fn a_parallel_camera_and_a_long_lens_have_a_history() {
    let long = PerspectiveProjection { fov: 0.02, near: 1.0, far: 2000.0, ..Default::default() };
    for (name, lens, distance) in [
        ("parallel, 10 m", Projection::from(parallel()), 10.0),
        ("parallel, 500 m", parallel().into(), 500.0),
        ("long lens, 200 m", long.into(), 200.0),
    ] {
        let [without, with] = [1, 16].map(|frames| flicker(&lens, distance, frames));
        println!("    {name}: {without:.4} changes without history, {with:.4} with it");
        assert!(with < 0.6 * without, "{name}: {with} {without}");
    }
}
