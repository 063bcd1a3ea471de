//! Materials in global illumination: as sources of indirect light, as receivers and as occluders.
//!
//! All samples are measured on one test bench: a white floor under a vertical sun, and a grey wall
//! behind it. `docs/architecture/frame.md` has the table of the results.

pub(crate) mod custom;
pub(crate) mod shaped;
pub(crate) mod standard;

use std::cell::RefCell;
use std::f32::consts::FRAC_PI_2;
use std::sync::OnceLock;

use bevy::ecs::entity::Entity;
use bevy::math::{Quat, Vec3};
use bevy::pbr::Material;
use bevy::prelude::Mesh;
use bevy::transform::components::Transform;
use frugal::stage::{Component, Stage};
use frugal_tests::gpu::{self, Point};
use frugal_tests::{materials, meshes, set};

use super::gi::sun;

/// Albedo of the reference, linear.
pub(crate) const GREY: f32 = 0.5;

/// Low settings: every pixel gathers 64 VPLs, and a filter averages 2 × 2 pixels.
const SETTINGS: &str = "min,gi_refresh_period=1,gi_vpl_count=256,gi_interleave=2x2,gi_pixel_fraction=1/1,resolution_scale=100%";

/// Height of a sample on the floor, metres.
const HEIGHT: f32 = 0.05;

/// Placement of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Placement {
    /// Above the whole floor, with its upper side towards the sun.
    Floor,
    /// Above the whole floor, with its lower side towards the sun.
    FloorUpsideDown,
    /// Directly in front of the wall, which it covers, with its upper side towards the floor and
    /// the eye.
    Wall,
    /// Inside the floor, without any effect.
    Away,
}

impl Placement {
    /// Transform of a plate of 1 m.
    pub(crate) fn transform(self) -> Transform {
        let flat = Transform::from_xyz(0.0, HEIGHT, 0.0).with_scale(Vec3::new(5.0, 1.0, 5.0));
        match self {
            Self::Floor => flat,
            Self::FloorUpsideDown => flat.with_rotation(Quat::from_rotation_x(2.0 * FRAC_PI_2)),
            Self::Wall => {
                let upright = Transform::from_xyz(0.0, 1.0, -1.85)
                    .with_rotation(Quat::from_rotation_x(FRAC_PI_2));
                upright.with_scale(Vec3::new(4.5, 1.0, 2.1))
            }
            Self::Away => Transform::from_xyz(0.0, -0.1, 0.0),
        }
    }
}

/// Measurements of a sample above the middle of the floor as a source of indirect light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source {
    /// Share of the sun's texels that lie on the sample; the others lie on the floor.
    pub covered: f64,
    /// Flux of the sample's texels per projected area, perpendicular to the light, lm/m².
    pub flux: [f64; 3],
    /// Mean normal of the sample's texels.
    pub normal: Vec3,
    /// Indirect radiance of the wall, nits.
    pub wall: [f64; 3],
}

/// A sample's measurements.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effect {
    pub source: Source,
    /// Indirect radiance of the sample in front of the wall, nits.
    pub received: [f64; 3],
    /// Share of the floor's light that the sample keeps from the wall, by rays.
    pub occluded: f64,
}

/// The test bench.
pub(crate) struct Bench {
    pub stage: Stage,
}

thread_local! {
    /// All tests of a thread share one stage, because opening it would take most of a test's time.
    /// After a failed test, the next one opens another.
    static BENCH: RefCell<Option<Bench>> = const { RefCell::new(None) };
}

/// Measurements of a diffuse grey plate.
static REFERENCE: OnceLock<Effect> = OnceLock::new();
/// Radiance of the wall from nearby without a sample, nits.
static OPEN_WALL: OnceLock<f64> = OnceLock::new();
/// Indirect radiance of the wall without a sample on the floor, nits.
static OPEN_FLOOR: OnceLock<f64> = OnceLock::new();
/// Radiance of the wall without GI, nits: the G-buffer's normals are slightly inexact, so that the
/// sun grazes the wall.
static DARK_WALL: OnceLock<[f64; 3]> = OnceLock::new();

/// Runs a test, which must remove its samples.
pub(crate) fn on_bench(test: impl FnOnce(&mut Bench)) {
    let mut bench = BENCH.take().unwrap_or_else(Bench::new);
    bench.reference();
    test(&mut bench);
    BENCH.set(Some(bench));
}

impl Bench {
    fn new() -> Self {
        let options = set::radiance_options(32, 18, Component::Full);
        let mut stage = set::bare_with(vec![sun(Vec3::NEG_Y)], options, materials::add);
        // Other tests cover the standard shading.
        set::make_lambertian(&mut stage);
        // With custom materials every frame counts as a change, so that temporal accumulation would
        // never converge.
        set::disable_history(&mut stage);
        meshes::spawn_corner(&mut stage, GREY);
        // The sun's map covers the bounds of all meshes. This slab makes them the same for all
        // samples, including skins and morphs.
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, -0.15, 0.0),
            Vec3::new(5.0, 0.01, 5.0),
            meshes::diffuse(0.0, 0.0, 0.0),
        );
        // VPLs sampled on the wall's top would light nothing.
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, 2.01, -2.0),
            Vec3::new(4.0, 0.02, 0.2),
            meshes::diffuse(0.0, 0.0, 0.0),
        );
        Self { stage }
    }

    /// Spawns a plate of a material.
    pub(crate) fn plate<M: Material>(&mut self, material: M) -> Entity {
        self.sample(meshes::plate(false), material)
    }

    /// Spawns a sample inside the floor.
    pub(crate) fn sample<M: Material>(&mut self, mesh: Mesh, material: M) -> Entity {
        meshes::spawn(&mut self.stage, mesh, material, Placement::Away.transform())
    }

    /// Removes a sample.
    pub(crate) fn clear(&mut self, entity: Entity) {
        assert!(self.stage.world_mut().despawn(entity), "the sample was there");
    }

    /// Moves a sample or its joint.
    pub(crate) fn put(&mut self, entity: Entity, placement: Placement) {
        *self.stage.world_mut().get_mut::<Transform>(entity).expect("a sample") =
            placement.transform();
    }

    /// Mean radiance of the wall, or of a sample in front of it, seen across the floor, nits.
    fn look_at_wall(&mut self, settings: &str) -> [f64; 3] {
        set::look(&mut self.stage, Vec3::new(0.0, 1.0, -0.5), Vec3::new(0.0, 1.0, -2.0));
        set::apply(&mut self.stage, settings);
        set::channel_means(&set::radiance(&mut self.stage))
    }

    /// Measures a sample as a source of indirect light.
    pub(crate) fn as_source(&mut self, entity: Entity, placement: Placement) -> Source {
        self.put(entity, placement);
        let dark =
            *DARK_WALL.get_or_init(|| self.look_at_wall(&format!("{SETTINGS},gi_vpl_count=0")));
        let lit = self.look_at_wall(SETTINGS);
        let wall = std::array::from_fn(|channel| lit[channel] - dark[channel]);
        let (sample, all) = self.middle();
        let count = sample.len().max(1) as f64;
        Source {
            covered: sample.len() as f64 / all as f64,
            flux: gpu::total_flux(&sample).map(|flux| flux / across(&sample)),
            normal: sample.iter().map(|texel| Vec3::from_array(texel.normal)).sum::<Vec3>()
                / count as f32,
            wall,
        }
    }

    /// The sun's texels above the middle of the floor that lie on a sample, and the number of all
    /// texels there.
    pub(crate) fn middle(&self) -> (Vec<Point>, usize) {
        let texels = gpu::rsm_texels(&self.stage);
        // A texel without a surface lies at the origin.
        let in_middle = |texel: &&Point| {
            texel.position != [0.0; 3]
                && texel.position[0].abs() < 1.0
                && texel.position[2].abs() < 1.0
        };
        let middle: Vec<Point> = texels.iter().filter(in_middle).copied().collect();
        // The floor lies at 0. A texel that reflects nothing keeps its position.
        let all = middle.len();
        (middle.into_iter().filter(|texel| texel.position[1] > 0.5 * HEIGHT).collect(), all)
    }

    /// Indirect radiance of a sample in front of the wall, nits: its radiance minus that without
    /// GI.
    pub(crate) fn as_receiver(&mut self, entity: Entity) -> [f64; 3] {
        self.put(entity, Placement::Wall);
        let with = self.look_at_wall(SETTINGS);
        let without = self.look_at_wall(&format!("{SETTINGS},gi_vpl_count=0"));
        std::array::from_fn(|channel| with[channel] - without[channel])
    }

    /// Radiance of the wall's middle from nearby, with rays, nits.
    fn behind(&mut self) -> f64 {
        set::look(&mut self.stage, Vec3::new(0.0, 1.1, -1.87), Vec3::new(0.0, 1.1, -2.0));
        set::apply(&mut self.stage, &format!("{SETTINGS},gi_visibility=fine"));
        set::radiance(&mut self.stage).mean()
    }

    /// Share of the floor's light that a sample in front of the wall keeps from it, by rays.
    pub(crate) fn as_occluder(&mut self, entity: Entity) -> f64 {
        self.put(entity, Placement::Away);
        let open = *OPEN_WALL.get_or_init(|| self.behind());
        self.put(entity, Placement::Wall);
        1.0 - self.behind() / open
    }

    /// Measures a sample in all three roles.
    pub(crate) fn measure(&mut self, entity: Entity) -> Effect {
        let source = self.as_source(entity, Placement::Floor);
        let received = self.as_receiver(entity);
        Effect { source, received, occluded: self.as_occluder(entity) }
    }

    /// Measures a plate in all three roles, and removes it.
    pub(crate) fn measure_plate<M: Material>(&mut self, label: &str, material: M) -> Relative {
        let plate = self.plate(material);
        let effect = self.measure(plate);
        self.clear(plate);
        self.relative(label, effect)
    }

    /// Measurements of a diffuse grey plate.
    pub(crate) fn reference(&mut self) -> Effect {
        *REFERENCE.get_or_init(|| {
            let plate = self.plate(meshes::diffuse(GREY, GREY, GREY));
            OPEN_FLOOR.get_or_init(|| self.as_source(plate, Placement::Away).wall[1]);
            let effect = self.measure(plate);
            self.clear(plate);
            effect
        })
    }

    /// Share of the open floor's light that reaches the wall with a sample above the floor.
    pub(crate) fn share_of_open_floor(&self, source: &Source) -> f64 {
        source.wall[1] / OPEN_FLOOR.get().expect("the reference was measured")
    }

    /// Prints and returns `effect` relative to that of a diffuse grey plate.
    pub(crate) fn relative(&mut self, label: &str, effect: Effect) -> Relative {
        let reference = self.reference();
        let over =
            |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|channel| a[channel] / b[channel]);
        let relative = Relative {
            covered: effect.source.covered,
            sent: over(effect.source.flux, reference.source.flux),
            wall: over(effect.source.wall, reference.source.wall),
            received: over(effect.received, reference.received),
            occluded: effect.occluded,
        };
        let [r, g, b] = relative.sent;
        let [x, y, z] = relative.received;
        println!(
            "    {label}: covers {:.3}, sends {r:.3} {g:.3} {b:.3}, wall {:.3}, receives {x:.3} {y:.3} {z:.3}, occludes {:.3}",
            relative.covered, relative.wall[1], relative.occluded
        );
        relative
    }
}

/// A sample's measurements; `sent`, `wall` and `received` are relative to those of a diffuse grey
/// plate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Relative {
    pub covered: f64,
    pub sent: [f64; 3],
    pub wall: [f64; 3],
    pub received: [f64; 3],
    pub occluded: f64,
}

impl Relative {
    /// Asserts that the sample behaves like a diffuse plate of these albedos: it covers the floor,
    /// sends and receives light, and occludes.
    #[track_caller]
    pub(crate) fn assert_diffuse(&self, label: &str, albedo: [f64; 3]) {
        self.assert_covers(label, 1.0);
        self.assert_sends(label, albedo);
        self.assert_receives(label, albedo);
        self.assert_occludes(label, true);
    }

    #[track_caller]
    pub(crate) fn assert_covers(&self, label: &str, share: f64) {
        assert!((self.covered - share).abs() < 1e-9, "{label}: covers {}", self.covered);
    }

    /// The flux of its texels is exact up to the known quantisation of the G-buffer; only these
    /// texels light the wall.
    #[track_caller]
    pub(crate) fn assert_sends(&self, label: &str, albedo: [f64; 3]) {
        for (channel, albedo) in albedo.into_iter().enumerate() {
            let expected = relative_albedo(albedo);
            assert!(
                (self.sent[channel] - expected).abs() < 1e-4 * expected.max(1e-3),
                "{label}: {:?}, {expected}",
                self.sent
            );
            // Half floats.
            assert!(
                (self.wall[channel] - expected).abs() < 2e-3 * expected.max(0.1),
                "{label}: wall {:?}, {expected}",
                self.wall
            );
        }
    }

    #[track_caller]
    pub(crate) fn assert_receives(&self, label: &str, albedo: [f64; 3]) {
        for (channel, albedo) in albedo.into_iter().enumerate() {
            let expected = relative_albedo(albedo);
            assert!(
                (self.received[channel] - expected).abs() < 4e-3 * expected.max(0.1),
                "{label}: {:?}, {expected}",
                self.received
            );
        }
    }

    /// The sample does not occlude the strip of floor between it and the wall, 5 cm wide.
    #[track_caller]
    pub(crate) fn assert_occludes(&self, label: &str, occludes: bool) {
        assert!(
            if occludes { self.occluded > 0.95 } else { self.occluded.abs() < 0.02 },
            "{label}: occludes {}",
            self.occluded
        );
    }
}

/// Projected area of texels perpendicular to the light, m². The store divides areas by the cosine,
/// clamped to at least 0.1.
pub(crate) fn across(texels: &[Point]) -> f64 {
    texels
        .iter()
        .map(|texel| f64::from(texel.extent * texel.normal[1].max(0.1)))
        .sum::<f64>()
        .max(1e-9)
}

/// An albedo relative to the reference's, both after quantisation in the G-buffer.
pub(crate) fn relative_albedo(albedo: f64) -> f64 {
    meshes::stored_albedo(albedo) / meshes::stored_albedo(f64::from(GREY))
}
