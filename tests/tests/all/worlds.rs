//! Worlds as apps build them: around a floating origin, and under Bevy's atmosphere.

use bevy::asset::Assets;
use bevy::camera::{Camera, Exposure};
use bevy::color::LinearRgba;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
use bevy::ecs::query::Without;
use bevy::light::atmosphere::ScatteringMedium;
use bevy::light::{
    Atmosphere, AtmosphereEnvironmentMapLight, DirectionalLight, EnvironmentMapLight,
    GeneratedEnvironmentMapLight,
};
use bevy::math::{Quat, UVec2, UVec3, Vec3};
use bevy::mesh::{Mesh, MeshBuilder, Meshable};
use bevy::pbr::{AtmosphereSettings, StandardMaterial};
use bevy::prelude::{Cuboid, Plane3d};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::GiRefresh;
use bevy_frugal_gi::knobs::KnobSettings;
use frugal::stage::{Component, Stage};
use frugal_tests::{meshes, set};
use frugal_trace::light::Light;
use frugal_trace::metrics::Radiance;

tests!(
    a_shifted_world_keeps_its_light,
    a_shift_renders_every_map_at_once,
    a_teleport_is_no_shift,
    cameras_share_an_atmosphere_whose_sky_follows_the_sun,
    bounced_sunlight_is_that_of_the_atmosphere,
    a_generated_sky_can_be_shared_go_and_come_back,
);

const SETTINGS: &str = "max,rsm_resolution=128,gi_vpl_count=1024,gi_interleave=4x4,gi_visibility=coarse,gi_pixel_fraction=1/4,gi_bounces=2,resolution_scale=100%";

fn white(color: f32) -> StandardMaterial {
    meshes::diffuse(color, color, color)
}

/// A room of 4 × 3 × 3 m with a red side, whose lights bounce: a sun, a spot, a point light, and an
/// emissive panel. Its walls are children of one root. A box swings, and a skinned one stands still.
struct Room {
    stage: Stage,
    swinging: Entity,
    /// By how much the world was shifted in all.
    origin: Vec3,
    frame: u32,
}

impl Room {
    fn new(extra: Vec<Light>) -> Self {
        let white_light = [1.0; 3];
        let mut lights = vec![
            Light::Directional {
                direction: Vec3::new(0.0, -1.0, -0.8),
                illuminance: 10_000.0,
                color: white_light,
            },
            Light::Spot {
                position: Vec3::new(1.5, 2.8, -1.0),
                direction: Vec3::new(-0.3, -1.0, -0.2),
                luminous_power: 60_000.0,
                color: white_light,
                range: 10.0,
                inner_angle: 20.0,
                outer_angle: 30.0,
            },
            Light::Point {
                position: Vec3::new(-1.5, 2.2, -2.2),
                luminous_power: 20_000.0,
                color: white_light,
                range: 10.0,
            },
        ];
        lights.extend(extra);
        let mut stage = set::bare(lights, set::radiance_options(64, 36, Component::Full));
        stage.world_mut().insert_resource(GiRefresh::OnChange);
        let grid = stage.world_mut().spawn(Transform::default()).id();
        let red = meshes::diffuse(0.8, 0.2, 0.1);
        for (center, size, material) in [
            (Vec3::new(0.0, -0.1, -1.5), Vec3::new(4.4, 0.2, 3.4), white(0.8)),
            (Vec3::new(0.0, 3.1, -1.5), Vec3::new(4.4, 0.2, 3.4), white(0.8)),
            (Vec3::new(0.0, 1.5, -3.1), Vec3::new(4.4, 3.0, 0.2), white(0.8)),
            (Vec3::new(-2.1, 1.5, -1.5), Vec3::new(0.2, 3.0, 3.0), red.clone()),
            (Vec3::new(2.1, 1.5, -1.5), Vec3::new(0.2, 3.0, 3.0), white(0.8)),
        ] {
            let wall = meshes::spawn_box(&mut stage, center, size, material);
            stage.world_mut().entity_mut(wall).insert(ChildOf(grid));
        }
        let panel = Plane3d::default().mesh().size(0.6, 0.6).build();
        let emissive = StandardMaterial { emissive: LinearRgba::rgb(8.0, 8.0, 2.0), ..white(0.0) };
        let facing = Transform::from_xyz(1.0, 1.2, -2.95)
            .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
        meshes::spawn(&mut stage, panel, emissive, facing);
        let small: Mesh = Cuboid::from_length(0.4).into();
        let swinging =
            meshes::spawn(&mut stage, small.clone(), red, Transform::from_xyz(0.4, 0.2, -1.0));
        let skinned = meshes::with_joints(small, |_| 0);
        let place = Transform::from_xyz(-0.8, 0.2, -1.2);
        let skinned = meshes::spawn(&mut stage, skinned, white(0.5), place);
        let joints = meshes::add_joints(&mut stage, skinned, 1);
        *stage.world_mut().get_mut::<Transform>(joints[0]).expect("a joint") = place;
        set::apply(&mut stage, SETTINGS);
        set::look(&mut stage, Vec3::new(0.8, 1.4, 2.6), Vec3::new(-0.4, 1.3, -2.0));
        set::radiance(&mut stage);
        let mut room = Self { stage, swinging, origin: Vec3::ZERO, frame: 0 };
        (0..40).for_each(|_| drop(room.next()));
        room
    }

    /// The next frame. The box swings by 2 cm.
    fn next(&mut self) -> Radiance {
        self.frame += 1;
        let x = 0.4 + 0.02 * (0.2 * self.frame as f32).sin() + self.origin.x;
        let swinging = self.stage.world_mut().get_mut::<Transform>(self.swinging);
        swinging.expect("a box").translation.x = x;
        self.stage.frame();
        self.stage.radiance().expect("radiance")
    }

    /// Shifts all roots, the camera among them.
    fn shift(&mut self, by: Vec3) {
        self.origin += by;
        let world = self.stage.world_mut();
        let mut roots = world.query_filtered::<&mut Transform, Without<ChildOf>>();
        roots.iter_mut(world).for_each(|mut place| place.translation += by);
    }
}

/// Mean absolute difference relative to the mean of `expected`.
fn difference(found: &Radiance, expected: &Radiance) -> f64 {
    let pairs = found.rgb.iter().flatten().zip(expected.rgb.iter().flatten());
    let sum = pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
    sum / expected.rgb.len() as f64 / 3.0 / expected.mean()
}

fn a_shifted_world_keeps_its_light() {
    let mut room = Room::new(vec![]);
    let before = room.next();
    for by in [
        Vec3::new(4096.0, 0.0, -2048.0),
        Vec3::new(-4096.0, 0.0, 2048.0),
        Vec3::new(60_000.0, 128.0, 0.0),
        Vec3::new(-60_000.0, -128.0, 0.0),
        Vec3::new(-731.3, 17.7, 3.1),
    ] {
        room.shift(by);
        let after: Vec<Radiance> = (0..12).map(|_| room.next()).collect();
        let off: Vec<f64> = after.iter().map(|image| difference(image, &before)).collect();
        let shares = after.iter().map(|image| image.mean() / before.mean());
        let (worst, darkest) =
            (off.iter().copied().fold(0.0, f64::max), shares.fold(f64::MAX, f64::min));
        println!("    by {by}: off by {:.4} at first, {worst:.4} at most, {darkest:.4}", off[0]);
        assert!(worst < 0.04 && darkest > 0.97, "by {by}: {off:?}, {darkest}");
        assert!(off[11] < 0.03, "by {by}: {}", off[11]);
    }
}

fn a_shift_renders_every_map_at_once() {
    // With the room's own, five point lights have 30 maps, more than are rendered in a frame.
    let lights = (0..4).map(|index| Light::Point {
        position: Vec3::new(-1.6 + 0.9 * index as f32, 0.4 + 0.6 * index as f32, -2.0),
        luminous_power: 16_000.0,
        color: [1.0; 3],
        range: 10.0,
    });
    let mut room = Room::new(lights.collect());
    set::switch(&mut room.stage, &format!("{SETTINGS},gi_refresh_period=8"));
    (0..24).for_each(|_| drop(room.next()));
    let before = room.next();
    room.shift(Vec3::new(2000.0, 0.0, 500.0));
    let after = room.next();
    let maps = set::gathered(&room.stage).maps;
    let (off, share) = (difference(&after, &before), after.mean() / before.mean());
    println!("    {maps} maps at once: off by {off:.4}, {share:.4} of the light");
    assert!(maps > 30 && off < 0.04 && share > 0.97, "{maps} {off} {share}");
}

fn a_teleport_is_no_shift() {
    let mut room = Room::new(vec![]);
    let before = room.next();
    // The camera alone goes into a room next door, as dark as the night.
    let (eye, target) = (Vec3::new(500.8, 1.4, 2.6), Vec3::new(499.6, 1.3, -2.0));
    set::look(&mut room.stage, eye, target);
    let away = room.next().mean();
    assert!(away < 0.05 * before.mean(), "{away}");
    set::look(&mut room.stage, eye - Vec3::X * 500.0, target - Vec3::X * 500.0);
    let share = room.next().mean() / before.mean();
    println!("    back from a teleport: {share:.4} of the light");
    assert!((share - 1.0).abs() < 0.1, "{share}");
}

/// A yard with a shed that is open to −Z only, under the air of the earth. The sun stands `height`
/// above the horizon, where 1 is 45°.
fn yard(height: f32) -> (Stage, Entity) {
    let mut stage = set::bare(vec![], set::radiance_options(64, 24, Component::Full));
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    for (center, size) in [
        (Vec3::new(0.0, -0.1, 0.0), Vec3::new(40.0, 0.2, 40.0)),
        (Vec3::new(0.0, 2.6, 0.0), Vec3::new(6.0, 0.2, 6.0)),
        (Vec3::new(0.0, 1.25, 2.9), Vec3::new(6.0, 2.5, 0.2)),
        (Vec3::new(-2.9, 1.25, 0.0), Vec3::new(0.2, 2.5, 6.0)),
        (Vec3::new(2.9, 1.25, 0.0), Vec3::new(0.2, 2.5, 6.0)),
    ] {
        meshes::spawn_box(&mut stage, center, size, white(0.6));
    }
    let world = stage.world_mut();
    let light = DirectionalLight {
        illuminance: 100_000.0,
        shadow_maps_enabled: true,
        ..Default::default()
    };
    let sun = world.spawn((light, above_horizon(height))).id();
    let medium =
        world.resource_mut::<Assets<ScatteringMedium>>().add(ScatteringMedium::earth(64, 64));
    world.spawn(Atmosphere::earth(medium));
    set::apply(&mut stage, SETTINGS);
    (stage, sun)
}

fn above_horizon(height: f32) -> Transform {
    Transform::default().looking_to(Vec3::new(0.5, -height, -0.85), Vec3::Y)
}

/// Small textures, which a software adapter fills in time.
fn small_air() -> AtmosphereSettings {
    AtmosphereSettings {
        transmittance_lut_size: UVec2::new(64, 32),
        multiscattering_lut_size: UVec2::splat(16),
        sky_view_lut_size: UVec2::new(64, 32),
        aerial_view_lut_size: UVec3::splat(8),
        ..Default::default()
    }
}

/// Gives both cameras settings: `set::apply` knows the first.
fn apply_to_both(stage: &mut Stage, [first, second]: [Entity; 2], settings: &str) {
    set::apply(stage, settings);
    let knobs = stage.world_mut().get::<KnobSettings>(first).cloned().expect("settings");
    stage.world_mut().entity_mut(second).insert(knobs);
}

fn give_sky(stage: &mut Stage, camera: Entity) {
    let sky = AtmosphereEnvironmentMapLight { size: UVec2::splat(32), ..Default::default() };
    let parts = (small_air(), sky, Exposure { ev100: 13.0 });
    stage.world_mut().entity_mut(camera).insert(parts);
}

/// Mean of a part of the image.
fn mean(image: &Radiance, columns: std::ops::Range<u32>) -> f64 {
    let part: Vec<f64> = (0..image.height)
        .flat_map(|y| columns.clone().map(move |x| (y * image.width + x) as usize))
        .map(|index| image.rgb[index].iter().map(|value| f64::from(*value)).sum::<f64>())
        .collect();
    part.iter().sum::<f64>() / part.len() as f64
}

fn frames(stage: &mut Stage, count: u32) -> Radiance {
    (0..count).for_each(|_| stage.frame());
    stage.radiance().expect("radiance")
}

fn cameras_share_an_atmosphere_whose_sky_follows_the_sun() {
    let (mut stage, sun) = yard(1.0);
    let first = set::camera(&mut stage);
    set::look(&mut stage, Vec3::new(12.0, 2.0, 12.0), Vec3::new(14.0, 0.0, 6.0));
    let second = set::add_camera(&mut stage, Vec3::new(0.0, 1.5, -1.5), Vec3::new(0.0, 0.4, 2.8));
    set::set_viewport(&mut stage, first, UVec2::ZERO, UVec2::new(32, 24));
    set::set_viewport(&mut stage, second, UVec2::new(32, 0), UVec2::new(32, 24));
    [first, second].into_iter().for_each(|camera| give_sky(&mut stage, camera));
    stage.get_ready().expect("ready");
    let halves = |image: Radiance| [mean(&image, 0..32), mean(&image, 32..64)];
    let cameras = [first, second];
    let day = halves(frames(&mut stage, 24));
    apply_to_both(&mut stage, cameras, &format!("{SETTINGS},gi_environment_samples=0"));
    let untraced = halves(frames(&mut stage, 12));
    println!("    open and closed, nits: {day:.0?}; by Bevy {untraced:.0?}");
    let [open, closed] = [0, 1].map(|half| day[half] / untraced[half]);
    assert!((0.9..1.1).contains(&open) && closed < 0.8, "{open} {closed}");
    // Without GI, too.
    apply_to_both(&mut stage, cameras, &format!("{SETTINGS},gi_vpl_count=0"));
    let without = halves(frames(&mut stage, 4));
    assert!(without[0] > 0.5 * day[0], "{without:?}");
    apply_to_both(&mut stage, cameras, SETTINGS);
    frames(&mut stage, 12);
    *stage.world_mut().get_mut::<Transform>(sun).expect("a sun") = above_horizon(-0.5);
    let night = halves(frames(&mut stage, 40));
    println!("    at night {night:.1?}");
    assert!(night[0] < 0.1 * day[0] && night[1] < 0.1 * day[1], "{night:?}");
    // One of them leaves, and comes back.
    stage.world_mut().get_mut::<Camera>(second).expect("a camera").is_active = false;
    *stage.world_mut().get_mut::<Transform>(sun).expect("a sun") = above_horizon(1.0);
    frames(&mut stage, 4);
    stage.world_mut().get_mut::<Camera>(second).expect("a camera").is_active = true;
    let again = halves(frames(&mut stage, 40));
    assert!((again[0] / day[0] - 1.0).abs() < 0.1, "{again:?} {day:?}");
    assert!((again[1] / day[1] - 1.0).abs() < 0.1, "{again:?} {day:?}");
}

fn bounced_sunlight_is_that_of_the_atmosphere() {
    // Ground of one side: the sun shines up through it, and the planet alone stops that.
    let bounced = |height: f32, has_air: bool| {
        let (mut stage, _) = yard(height);
        let world = stage.world_mut();
        let mut all = world.query_filtered::<Entity, bevy::ecs::query::With<bevy::mesh::Mesh3d>>();
        let ground = all.iter(world).next().expect("ground");
        world.despawn(ground);
        let plane = Plane3d::default().mesh().size(40.0, 40.0).build();
        meshes::spawn(&mut stage, plane, white(0.6), Transform::default());
        let camera = set::camera(&mut stage);
        set::apply(&mut stage, &format!("{SETTINGS},gi_environment_samples=0"));
        set::look(&mut stage, Vec3::new(0.0, 1.5, -1.5), Vec3::new(0.0, 0.4, 2.8));
        set::gi(&mut stage).output = bevy_frugal_gi::gi::GiOutput::IndirectOnly;
        if has_air {
            stage.world_mut().entity_mut(camera).insert(small_air());
        }
        stage.get_ready().expect("ready");
        mean(&frames(&mut stage, 20), 0..64)
    };
    let [noon, noon_without] = [true, false].map(|has_air| bounced(2.0, has_air));
    let [dusk, dusk_without] = [true, false].map(|has_air| bounced(0.04, has_air));
    let night = bounced(-1.0, true);
    println!(
        "    noon {noon:.0} of {noon_without:.0} nits, dusk {dusk:.1} of {dusk_without:.1}, night {night:.2}"
    );
    assert!((0.6..0.97).contains(&(noon / noon_without)), "{noon} {noon_without}");
    assert!(dusk < 0.5 * dusk_without, "{dusk} {dusk_without}");
    assert!(night < 1e-3 * noon, "{night}");
}

fn a_generated_sky_can_be_shared_go_and_come_back() {
    let (mut stage, sun) = yard(1.0);
    let first = set::camera(&mut stage);
    set::look(&mut stage, Vec3::new(12.0, 2.0, 12.0), Vec3::new(14.0, 0.0, 6.0));
    give_sky(&mut stage, first);
    stage.get_ready().expect("ready");
    let day = frames(&mut stage, 24).mean();
    // A camera that shows the sky of another one follows it, too.
    let light = stage.world_mut().get::<EnvironmentMapLight>(first).cloned().expect("a sky");
    let second = set::add_camera(&mut stage, Vec3::new(12.0, 2.0, 12.0), Vec3::new(14.0, 0.0, 6.0));
    let parts = (small_air(), light, Exposure { ev100: 13.0 });
    stage.world_mut().entity_mut(second).insert(parts);
    let both = frames(&mut stage, 24).mean();
    assert!((both / day - 1.0).abs() < 0.1, "{both} {day}");
    *stage.world_mut().get_mut::<Transform>(sun).expect("a sun") = above_horizon(-0.5);
    let night = frames(&mut stage, 40).mean();
    assert!(night < 0.1 * day, "{night} {day}");
    stage.world_mut().despawn(second);
    // The sky's light goes, and Bevy makes another one.
    *stage.world_mut().get_mut::<Transform>(sun).expect("a sun") = above_horizon(1.0);
    stage.world_mut().entity_mut(first).remove::<EnvironmentMapLight>();
    let again = frames(&mut stage, 40).mean();
    assert!((again / day - 1.0).abs() < 0.1, "{again} {day}");
    stage
        .world_mut()
        .entity_mut(first)
        .remove::<(GeneratedEnvironmentMapLight, EnvironmentMapLight)>();
    let without = frames(&mut stage, 12).mean();
    println!("    {day:.0} nits, {night:.1} at night, {without:.0} without a sky");
    assert!(without < 0.99 * day, "{without} {day}");
}
