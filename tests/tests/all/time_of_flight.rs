//! The example `time_of_flight` against path tracing: the same room, light and camera.

#[path = "../../../examples/time_of_flight/pass.rs"]
mod pass;
#[path = "../../../examples/time_of_flight/room.rs"]
mod room;

use std::sync::LazyLock;

use bevy::asset::Assets;
use bevy::color::ColorToComponents;
use bevy::math::{DVec2, UVec2};
use bevy::mesh::{Mesh, MeshVertexAttribute};
use bevy::prelude::Cuboid;
use bevy::render::render_asset::RenderAssets;
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy_frugal_gi::gi::{GiInterleave, GiShading, GiVisibility};
use frugal::stage::{Component, Stage};
use frugal_tests::cost::quantile;
use frugal_tests::{gpu, meshes, set};
use frugal_trace::bsdf::Shading;
use frugal_trace::integrator::{Pixels, ReferenceScene, Settings, Watch};
use frugal_trace::light::{Light, Sky};
use frugal_trace::scene::{RayScene, SceneGeometry, SceneMaterial, SceneMesh};
use frugal_trace::time::{Capture, capture, without_bounce};

tests!(
    phasors_are_those_of_one_traced_bounce,
    one_bounce_is_most_of_the_error_of_all,
    the_comparison_detects_wrong_phasors,
);

const SIZE: UVec2 = UVec2::new(48, 27);
/// Hertz.
const FREQUENCY: f64 = 20e6;

fn light() -> Light {
    let pose = room::view(SIZE).pose;
    let [inner_angle, outer_angle] = room::CONE_DEGREES;
    Light::Spot {
        position: pose.position,
        direction: pose.forward(),
        luminous_power: room::CANDELA * 4.0 * std::f32::consts::PI,
        range: room::RANGE,
        inner_angle,
        outer_angle,
        color: [1.0; 3],
    }
}

fn stage() -> Stage {
    let mut stage =
        set::bare_with(vec![light()], set::radiance_options(48, 27, Component::Indirect), |app| {
            app.add_plugins(pass::PhasorPlugin);
        });
    for (size, centre, color) in room::BLOCKS {
        let [red, green, blue] = color.to_linear().to_f32_array_no_alpha();
        meshes::spawn_box(&mut stage, centre, size, meshes::diffuse(red, green, blue));
    }
    let pose = room::view(SIZE).pose;
    stage.place(pose.position, pose.rotation);
    let mut gi = set::gi_without_knobs(&mut stage);
    (gi.bounces, gi.interleave, gi.visibility) = (1, GiInterleave::One, GiVisibility::Coarse);
    (gi.vpl_count, gi.rest_frames, gi.shading) = (1024, 0, GiShading::Lambertian);
    stage
}

/// What a sensor at `frequency` measures, read as if it were at [`FREQUENCY`].
fn measured(stage: &mut Stage, frequency: f64) -> Capture {
    let world = stage.world_mut();
    let mut buffers = world.resource_mut::<Assets<ShaderBuffer>>();
    let sensor = pass::Sensor::new(frequency, room::CANDELA, SIZE, &mut buffers);
    world.insert_resource(sensor);
    stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
    (0..4).for_each(|_| stage.frame());
    let world = stage.render_world();
    let pixels = &world.resource::<pass::Sensor>().pixels;
    let buffer = world.resource::<RenderAssets<GpuShaderBuffer>>().get(pixels);
    let bytes = gpu::read_buffer(world, &buffer.expect("the sensor's buffer").buffer);
    pass::capture(&room::view(SIZE), FREQUENCY, &bytes).unwrap_or_else(|error| panic!("{error}"))
}

static MEASURED: LazyLock<Capture> = LazyLock::new(|| measured(&mut stage(), FREQUENCY));

fn traced(bounces: Option<u32>) -> Capture {
    let mut geometry = SceneGeometry::default();
    for (size, centre, color) in room::BLOCKS {
        let mesh = Mesh::from(Cuboid::from_size(size)).translated_by(centre);
        let vectors = |attribute: MeshVertexAttribute| {
            let values = mesh.attribute(attribute).and_then(|values| values.as_float3());
            values.expect("a cuboid has it").iter().map(|vector| (*vector).into()).collect()
        };
        geometry.meshes.push(SceneMesh {
            positions: vectors(Mesh::ATTRIBUTE_POSITION),
            normals: vectors(Mesh::ATTRIBUTE_NORMAL),
            indices: mesh.indices().expect("a cuboid has them").iter().map(|i| i as u32).collect(),
            material: geometry.materials.len(),
            ..Default::default()
        });
        let base_color = color.to_linear().to_f32_array();
        geometry.materials.push(SceneMaterial { base_color, ..Default::default() });
    }
    let rays = RayScene::from_geometry(&geometry);
    let scene = ReferenceScene::new(geometry.into(), rays.into(), &[light()], Sky::Black)
        .unwrap_or_else(|error| panic!("{error}"));
    let settings = Settings {
        samples: 1024,
        bounces,
        shading: Shading::Lambertian,
        pixels: Pixels::Middle,
        ..Default::default()
    };
    capture(&scene, &room::view(SIZE), &settings, FREQUENCY, Watch::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

static ONE_BOUNCE: LazyLock<Capture> = LazyLock::new(|| traced(Some(1)));

/// Median and 90th percentile.
fn quantiles(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.collect();
    assert!(!values.is_empty() && values.iter().all(|value| value.is_finite()), "{values:?}");
    [0.5, 0.9].map(|share| quantile(&mut values, share))
}

/// Differences of phases, degrees, and of amplitudes, as shares.
fn differences(found: &[DVec2], expected: &[DVec2]) -> [[f64; 2]; 2] {
    let pairs = || found.iter().zip(expected);
    let phases = pairs().map(|(a, b)| a.angle_to(*b).abs().to_degrees());
    let amplitudes = pairs().map(|(a, b)| (a.length() / b.length() - 1.0).abs());
    [quantiles(phases), quantiles(amplitudes)]
}

/// Differences of depths, centimetres.
fn apart(found: &[Option<f64>], expected: &[Option<f64>]) -> [f64; 2] {
    let pairs = found.iter().zip(expected);
    quantiles(pairs.filter_map(|(a, b)| Some(((*a)? - (*b)?).abs() * 100.0)))
}

fn bounced(capture: &Capture) -> Vec<DVec2> {
    capture.all().iter().zip(capture.direct()).map(|(all, direct)| all - direct).collect()
}

/// Whether median and 90th percentile are within those of `bound`.
fn are_within(found: [f64; 2], bound: [f64; 2]) -> bool {
    found[0] <= bound[0] && found[1] <= bound[1]
}

/// Bounds of phases, degrees: about twice what was measured.
const PHASES: [f64; 2] = [0.15, 0.4];

fn phasors_are_those_of_one_traced_bounce() {
    let (found, expected) = (&*MEASURED, &*ONE_BOUNCE);
    let distances = apart(found.distances(), expected.distances());
    let depths = apart(&found.depths(found.all()), &expected.depths(expected.all()));
    let [direct, all] =
        [differences(found.direct(), expected.direct()), differences(found.all(), expected.all())];
    let indirect = differences(&bounced(found), &bounced(expected));
    println!(
        "    median and 90 %: distances {distances:.3?} cm, depths {depths:.3?} cm apart; phases in degrees, amplitudes as shares: direct {direct:.4?}, bounced {indirect:.4?}, all {all:.4?}"
    );
    assert!(are_within(distances, [0.01; 2]), "{distances:?}");
    // Vulkan's sines are exact to 0.03 degrees. The G-buffer has eight bits of colour.
    assert!(are_within(direct[0], [0.1; 2]) && are_within(direct[1], [0.01; 2]), "{direct:?}");
    assert!(are_within(indirect[0], [0.8, 4.0]), "{indirect:?}");
    assert!(are_within(indirect[1], [0.03, 0.2]), "{indirect:?}");
    assert!(are_within(all[0], PHASES) && are_within(all[1], [0.01, 0.04]), "{all:?}");
    assert!(are_within(depths, [0.3, 0.8]), "{depths:?}");
}

fn one_bounce_is_most_of_the_error_of_all() {
    let (found, one, every) = (&*MEASURED, &*ONE_BOUNCE, traced(None));
    let error =
        |capture: &Capture, phasors: &[DVec2]| apart(&capture.depths(phasors), capture.distances());
    let corrected = |capture: &Capture| {
        let direct = without_bounce(capture, f64::from(room::CANDELA), 3);
        error(capture, &direct.unwrap_or_else(|error| panic!("{error}")))
    };
    let [own, one, all] = [found, one, &every].map(|capture| error(capture, capture.all()));
    let rest = apart(&found.depths(found.all()), &every.depths(every.all()));
    let [own_corrected, all_corrected] = [corrected(found), corrected(&every)];
    println!(
        "    errors of depth, cm, median and 90 %: {own:.2?}, traced {one:.2?}, of all bounces {all:.2?}, {rest:.2?} from that; corrected {own_corrected:.2?}, of all bounces {all_corrected:.2?}"
    );
    assert!((own[0] - one[0]).abs() < 0.3 && (own[1] - one[1]).abs() < 0.5, "{own:?} {one:?}");
    assert!((0.65..0.8).contains(&(own[0] / all[0])), "{own:?} {all:?}");
    assert!(are_within(rest, [7.0, 15.0]), "{rest:?}");
    assert!(are_within(own_corrected, [0.4 * own[0], 0.6 * own[1]]), "{own_corrected:?}");
    assert!(are_within(all_corrected, [0.5 * all[0], 0.8 * all[1]]), "{all_corrected:?}");
}

fn the_comparison_detects_wrong_phasors() {
    let far = PHASES.map(|degrees| 10.0 * degrees);
    let detects = |what: &str, phasors: &[DVec2]| {
        let [phases, _] = differences(phasors, ONE_BOUNCE.all());
        println!("    {what}: phases {phases:.2?} degrees off");
        assert!(phases[0] > far[0] && phases[1] > far[1], "{what}: {phases:?}");
    };
    detects("paths 5 % too long", measured(&mut stage(), FREQUENCY * 1.05).all());
    detects("direct light alone", MEASURED.direct());
}
