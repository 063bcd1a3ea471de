//! Errors measured in a running app, against those of whole images that the tool compares.

use std::time::Duration;

use bevy::asset::Assets;
use bevy::camera::Camera;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::world::EntityWorldMut;
use bevy::math::{UVec2, Vec3};
use bevy_frugal_gi::control::{Budget, ErrorFeedback, PowerController};
use bevy_frugal_gi::error_meter::{ErrorMeter, ErrorProbe, MeasuredError};
use bevy_frugal_gi::frontier::FrontierMap;
use bevy_frugal_gi::knobs::KnobSettings;
use bevy_frugal_gi::units::Watts;
use frugal::stage::Stage;
use frugal_tests::{map, set};
use frugal_trace::metrics::ssim;

tests!(
    whole_images_have_the_error_that_the_tool_measures,
    parts_have_the_error_of_the_whole_in_the_mean,
    a_part_of_a_split_screen_is_compared_with_its_own_view,
    measuring_leaves_the_camera_s_image_and_nothing_behind,
    the_controller_learns_from_measurements,
);

const EYE: Vec3 = Vec3::new(-0.8, 1.7, 2.0);
const TARGET: Vec3 = Vec3::new(-3.2, 1.0, -1.6);
/// Frames after which a measurement has arrived.
const FRAMES: u32 = 24;

fn stage() -> Stage {
    let mut stage = set::open(&set::scene("two_rooms"), set::options(96, 54));
    set::look(&mut stage, EYE, TARGET);
    stage
}

/// Measures again and again, in whole images.
fn meter(share: f32) -> ErrorMeter {
    ErrorMeter { period: Duration::ZERO, share, frames: 8 }
}

fn measured(stage: &mut Stage, camera: Entity) -> MeasuredError {
    *stage.world_mut().get::<MeasuredError>(camera).expect("a meter")
}

/// The next measurement.
fn measure(stage: &mut Stage, camera: Entity) -> f64 {
    let before = measured(stage, camera).count;
    for _ in 0..10 * FRAMES {
        stage.frame();
        let now = measured(stage, camera);
        if now.count > before {
            return now.last.expect("an error");
        }
    }
    panic!("nothing was measured");
}

/// 1 − SSIM of `settings` against the best, each after frames enough to rest.
fn of_pictures(stage: &mut Stage, settings: &str) -> f64 {
    let [reference, picture] = ["max", settings].map(|settings| {
        set::apply(stage, settings);
        stage.get_ready().expect("ready");
        (0..FRAMES).for_each(|_| stage.frame());
        stage.picture().expect("a picture")
    });
    ssim::error(&reference, &picture).expect("of one size")
}

fn whole_images_have_the_error_that_the_tool_measures() {
    let mut stage = stage();
    let camera = set::camera(&mut stage);
    for settings in [
        "max,gi_pixel_fraction=1/16",
        "max,gi_vpl_count=64,gi_interleave=8x8",
        "max,resolution_scale=50%",
        "max,gi_vpl_count=0",
    ] {
        let expected = of_pictures(&mut stage, settings);
        stage.world_mut().entity_mut(camera).insert(meter(1.0));
        let error = measure(&mut stage, camera);
        stage.world_mut().entity_mut(camera).remove::<ErrorMeter>();
        println!("    {settings}: measured {error:.4}, by pictures {expected:.4}");
        assert!((error - expected).abs() < 0.002 + 0.05 * expected, "{error} {expected}");
    }
}

fn parts_have_the_error_of_the_whole_in_the_mean() {
    let mut stage = stage();
    let camera = set::camera(&mut stage);
    let expected = of_pictures(&mut stage, "max,gi_pixel_fraction=1/16,resolution_scale=70%");
    stage.world_mut().entity_mut(camera).insert(meter(0.5));
    let errors: Vec<f64> = (0..12)
        .map(|step| {
            // A view that stays is measured once.
            set::look(&mut stage, EYE + Vec3::X * (1e-3 * step as f32), TARGET);
            measure(&mut stage, camera)
        })
        .collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!("    quarters {errors:.4?}: {mean:.4}, by pictures {expected:.4}");
    assert!((mean / expected - 1.0).abs() < 0.25, "{mean} {expected}");
    for _ in 0..2 * FRAMES {
        stage.frame();
    }
    assert_eq!(measured(&mut stage, camera).count, 12, "a view that stays is measured once");
}

fn a_part_of_a_split_screen_is_compared_with_its_own_view() {
    let mut stage = stage();
    let left = set::camera(&mut stage);
    set::apply(&mut stage, "max,gi_pixel_fraction=1/16");
    let right = set::add_camera(&mut stage, EYE + Vec3::X * 0.6, TARGET + Vec3::Y * 0.4);
    let size = UVec2::new(48, 54);
    set::set_viewport(&mut stage, left, UVec2::ZERO, size);
    set::set_viewport(&mut stage, right, UVec2::new(48, 0), size);
    for camera in [left, right] {
        stage.world_mut().entity_mut(camera).insert(meter(1.0));
        let error = measure(&mut stage, camera);
        stage.world_mut().entity_mut(camera).remove::<ErrorMeter>();
        println!("    {error:.4}");
        assert!((0.0005..0.15).contains(&error), "views that do not match have more: {error}");
    }
}

fn measuring_leaves_the_camera_s_image_and_nothing_behind() {
    let mut stage = stage();
    let camera = set::camera(&mut stage);
    set::apply(&mut stage, "max,gi_pixel_fraction=1/4,gi_vpl_count=256");
    stage.get_ready().expect("ready");
    for _ in 0..100 {
        stage.frame();
    }
    let cameras = |stage: &mut Stage| {
        let world = stage.world_mut();
        world.query_filtered::<(), With<Camera>>().iter(world).count()
    };
    let before = (cameras(&mut stage), stage.picture().expect("a picture"));
    stage.world_mut().entity_mut(camera).insert(meter(1.0));
    let (mut most, mut probes) = (0.0_f64, 0);
    for _ in 0..FRAMES {
        stage.frame();
        let world = stage.world_mut();
        probes = probes.max(world.query::<&ErrorProbe>().iter(world).count());
        let now = stage.picture().expect("a picture");
        most = most.max(ssim::error(&before.1, &now).expect("of one size"));
    }
    println!("    at most {most:.5} while it is measured");
    assert_eq!((probes, measured(&mut stage, camera).count), (1, 1));
    // The maps of the probe are drawn, and the camera's with them: another set of samples.
    assert!(most < 0.002, "{most}");
    for _ in 0..4 {
        stage.frame();
    }
    assert_eq!(cameras(&mut stage), before.0);
    // Its settings, then its meter, go in the middle of a measurement.
    let ends: [fn(EntityWorldMut); 2] = [
        |mut camera| {
            camera.remove::<KnobSettings>();
        },
        |mut camera| {
            camera.remove::<ErrorMeter>();
        },
    ];
    for (number, end) in ends.into_iter().enumerate() {
        set::apply(&mut stage, "max,gi_pixel_fraction=1/4,gi_vpl_count=256");
        set::look(&mut stage, EYE + Vec3::X * (0.1 + 0.1 * number as f32), TARGET);
        for _ in 0..4 {
            stage.frame();
        }
        assert!(cameras(&mut stage) > before.0, "a probe renders: {number}");
        end(stage.world_mut().entity_mut(camera));
        for _ in 0..4 {
            stage.frame();
        }
        assert_eq!(cameras(&mut stage), before.0, "{number}");
    }
}

fn the_controller_learns_from_measurements() {
    let mut stage = stage();
    let camera = set::camera(&mut stage);
    set::apply(&mut stage, "max");
    let knobs = stage.space().subset(["gi_vpl_count", "gi_pixel_fraction"]).expect("knobs");
    let world = stage.world_mut();
    let map = world.resource_mut::<Assets<FrontierMap>>().add(map::one_cube(knobs));
    world.entity_mut(camera).insert((PowerController(map), Budget::power(Watts(2.5))));
    for _ in 0..40 {
        stage.frame();
    }
    let feedback = |stage: &mut Stage| *stage.world_mut().get::<ErrorFeedback>(camera).unwrap();
    let before = feedback(&mut stage);
    assert_eq!((before.count(), before.target(0.05, Some(0.04))), (0.0, Some(0.04)));
    stage.world_mut().entity_mut(camera).insert(meter(1.0));
    let error = measure(&mut stage, camera);
    let after = feedback(&mut stage);
    let target = after.target(0.05, Some(0.04)).expect("a target");
    println!("    measured {error:.4} of 0.05 predicted: the target is {target:.4}");
    assert_eq!(after.count(), 1.0);
    assert!(target > 0.04 && error < 0.03, "less than predicted: {error} {target}");
}
