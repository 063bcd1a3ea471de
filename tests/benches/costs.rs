//! Cost of the controller when nothing changes, and memory of global illumination at its largest
//! settings.
//!
//! `make bench BENCH=costs`

#![expect(missing_docs, reason = "the macros of criterion make public functions")]

use std::hint::black_box;
use std::time::Duration;

use bevy::MinimalPlugins;
use bevy::app::App;
use bevy::asset::{AssetPlugin, Assets};
use bevy::light::{FogVolume, VolumetricFog};
use bevy::math::{Quat, Vec3};
use bevy::transform::components::{GlobalTransform, Transform};
use bevy_frugal_gi::control::{Budget, ControlPlugin, PowerController, select};
use bevy_frugal_gi::frontier::{CameraView, FrontierMap, FrontierMapPlugin, FrontierStore};
use bevy_frugal_gi::knobs::{Knob, KnobSpace};
use bevy_frugal_gi::prelude::FrugalGi;
use bevy_frugal_gi::units::Watts;
use criterion::{Criterion, criterion_group, criterion_main};
use frugal_tests::{map, meshes, set};
use frugal_trace::light::Light;
use frugal_trace::metrics::{Picture, Reference};

fn knobs() -> KnobSpace {
    let knob = |number: u32| Knob::new(&format!("knob_{number}"), [0.0, 1.0, 2.0, 3.0]);
    KnobSpace::new((0..10).map(knob).collect()).expect("a space")
}

fn app(cameras: u32) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), FrontierMapPlugin, ControlPlugin));
    app.finish();
    app.cleanup();
    let map = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(map::one_cube(knobs()));
    for number in 0..cameras {
        let transform = Transform::from_xyz(number as f32 % 9.0 - 4.0, 1.0, 0.5);
        app.world_mut().spawn((
            transform,
            GlobalTransform::from(transform),
            PowerController(map.clone()),
            Budget::power(Watts(2.5)),
        ));
    }
    // The settings reach their target.
    (0..10).for_each(|_| app.update());
    app
}

fn controller(criterion: &mut Criterion) {
    let map = map::one_cube(knobs());
    let view = CameraView {
        position: Vec3::new(1.0, 2.0, 3.0),
        rotation: Quat::from_rotation_y(0.3),
        vertical_fov: 1.0,
        aspect: 1.8,
    };
    let budget = Budget::power(Watts(2.5));
    criterion.bench_function("look up and select", |bencher| {
        bencher.iter(|| {
            let found = map.look_up(black_box(&view))?;
            select(found.frontier, black_box(&budget))
        });
    });
    for cameras in [0, 1, 4, 64] {
        let mut app = app(cameras);
        criterion.bench_function(
            &format!("update of an app with {cameras} still cameras"),
            |bencher| {
                bencher.iter(|| app.update());
            },
        );
    }
}

/// Images that a search compares: throughput of the error metric on one core.
fn metric(criterion: &mut Criterion) {
    for (width, height) in [(320_u32, 180_u32), (1920, 1080)] {
        let image = |shift: u32| {
            let level = |index: u32| [((index * 7 + shift * (index % 5)) % 256) as u8; 3];
            Picture { width, height, rgb: (0..width * height).map(level).collect() }
        };
        let reference = Reference::new(&image(0)).expect("an image");
        let other = image(3);
        criterion.bench_function(&format!("1 - SSIM of {width}x{height} pixels"), |bencher| {
            bencher.iter(|| reference.error(black_box(&other)));
        });
    }
}

/// Printed, not timed.
fn memory(_: &mut Criterion) {
    if frugal::stage::adapter().is_none() {
        println!("no graphics adapter: memory is not measured");
        return;
    }
    let lights = vec![
        Light::Directional { direction: Vec3::NEG_Y, illuminance: 1e4, color: [1.0; 3] },
        Light::Point { position: Vec3::Y, luminous_power: 1e4, range: 30.0, color: [1.0; 3] },
        Light::Spot {
            position: Vec3::Y,
            direction: Vec3::NEG_Y,
            luminous_power: 1e4,
            range: 30.0,
            inner_angle: 20.0,
            outer_angle: 30.0,
            color: [1.0; 3],
        },
    ];
    for (width, height) in [(320, 180), (1920, 1080)] {
        let mut stage = set::bare(lights.clone(), set::options(width, height));
        meshes::spawn_box(
            &mut stage,
            Vec3::ZERO,
            Vec3::new(4.0, 0.2, 4.0),
            meshes::diffuse(0.8, 0.8, 0.8),
        );
        set::apply(
            &mut stage,
            "min,gi_vpl_count=4096,gi_interleave=2x2,gi_visibility=fine,gi_pixel_fraction=1/1,rsm_resolution=256,resolution_scale=100%",
        );
        (0..3).for_each(|_| stage.frame());
        let gathered = set::gathered(&stage);
        println!(
            "GI memory at {width}x{height}, largest settings, sun + spot + point: {:.1} MiB",
            gathered.bytes as f64 / 1048576.0
        );
    }
}

/// A frame of a moving camera in fog, without and with indirect light in it.
fn fog(criterion: &mut Criterion) {
    if frugal::stage::adapter().is_none() {
        println!("no graphics adapter: fog is not measured");
        return;
    }
    for is_lit in [false, true] {
        let mut stage = set::open(&set::scene("two_rooms"), set::options(640, 360));
        let camera = set::camera(&mut stage);
        let world = stage.world_mut();
        world.spawn((FogVolume::default(), Transform::from_scale(Vec3::splat(40.0))));
        world.entity_mut(camera).insert(VolumetricFog::default());
        world.get_mut::<FrugalGi>(camera).expect("GI").fog = is_lit;
        set::apply(&mut stage, "default");
        let mut step = 0.0;
        let mut frame = || {
            step += 0.01;
            let eye = Vec3::new(-0.8 + f32::sin(step), 1.7, 2.0);
            set::look(&mut stage, eye, Vec3::new(-3.2, 1.0, -1.6));
            stage.frame();
        };
        (0..30).for_each(|_| frame());
        let name = format!("frame in fog, 640x360, indirect light in it: {is_lit}");
        criterion.bench_function(&name, |bencher| bencher.iter(&mut frame));
    }
}

criterion_group! {
    name = costs;
    config = Criterion::default().warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(2));
    targets = controller, metric, memory, fog
}
criterion_main!(costs);
