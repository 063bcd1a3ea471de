//! What materials do to global illumination: as a source of indirect light, as a receiver, and as
//! an occluder of rays between others.
//!
//! All samples are looked at on one bench: a white floor under a vertical sun, and a grey wall
//! behind it. ARCHITECTURE.md has the table of what is found here ("What materials do to global
//! illumination").

pub mod custom;
pub mod shaped;
pub mod standard;

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
pub const GREY: f32 = 0.5;

/// Low settings: every pixel gathers 64 VPLs, and a filter joins 2 × 2 of them.
const SETTINGS: &str = "min,gi_refresh_period=1,gi_vpl_count=256,gi_interleave=2x2,gi_pixel_fraction=1/1,resolution_scale=100%";

/// Height of a sample on the floor, metres.
const HEIGHT: f32 = 0.05;

/// Where a sample is put.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Over the whole floor, its upper side to the sun.
    Floor,
    /// The same with its lower side to the sun.
    FloorUpsideDown,
    /// Close before the wall, which it covers, its upper side to the floor and the eye.
    Wall,
    /// Inside the floor.
    Away,
}

impl Placement {
    /// Of a plate of 1 m.
    pub fn transform(self) -> Transform {
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

/// What the sun finds over the middle of the floor.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Share of its rays that end on the sample, the others going on to the floor.
    pub covered: f64,
    /// Mean flux of the sample's texels by what they take of the light across it, lm/m².
    pub flux: [f64; 3],
    /// Mean normal of the sample's texels.
    pub normal: Vec3,
    /// Indirect radiance of the wall, nits.
    pub wall: [f64; 3],
}

/// A sample's measurements.
#[derive(Clone, Copy, Debug)]
pub struct Effect {
    pub source: Source,
    /// Indirect radiance of the sample in the wall's place, nits.
    pub received: [f64; 3],
    /// Share of the floor's light that rays find it to keep from the wall.
    pub hidden: f64,
}

/// A stage, and what its samples are held against.
pub struct Bench {
    pub stage: Stage,
}

thread_local! {
    /// One stage serves all tests of a thread, since most of a test's time would go into opening
    /// it. Where a test fails, the next opens another.
    static BENCH: RefCell<Option<Bench>> = const { RefCell::new(None) };
}

/// What a diffuse grey plate does.
static REFERENCE: OnceLock<Effect> = OnceLock::new();
/// Radiance of the wall from close by when there is no sample, nits.
static OPEN_WALL: OnceLock<f64> = OnceLock::new();
/// Indirect radiance of the wall when there is nothing on the floor, nits.
static OPEN_FLOOR: OnceLock<f64> = OnceLock::new();
/// Radiance of the wall when there is no GI, nits: the G-buffer's normals are a little off, and let
/// the sun graze it.
static DARK_WALL: OnceLock<[f64; 3]> = OnceLock::new();

/// Runs a test that leaves nothing on the bench.
pub fn on_bench(test: impl FnOnce(&mut Bench)) {
    let mut bench = BENCH.take().unwrap_or_else(Bench::new);
    bench.reference();
    test(&mut bench);
    BENCH.set(Some(bench));
}

impl Bench {
    fn new() -> Self {
        let options = set::radiance_options(32, 18, Component::Full);
        let mut stage = set::bare_with(vec![sun(Vec3::NEG_Y)], options, materials::add);
        // What else surfaces scatter is another test's.
        set::make_lambertian(&mut stage);
        // Custom materials keep the scene from ever resting, and light from being what was gathered
        // last.
        set::disable_history(&mut stage);
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, -0.1, 0.0),
            Vec3::new(4.0, 0.2, 4.0),
            meshes::diffuse(0.8, 0.8, 0.8),
        );
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, 1.0, -2.0),
            Vec3::new(4.0, 2.0, 0.2),
            meshes::diffuse(GREY, GREY, GREY),
        );
        // The sun's map covers what meshes say that they cover, and should be the same for all
        // samples, skins and morphs included.
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, -0.15, 0.0),
            Vec3::new(5.0, 0.01, 5.0),
            meshes::diffuse(0.0, 0.0, 0.0),
        );
        // The wall's top would draw virtual point lights that light nothing.
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.0, 2.01, -2.0),
            Vec3::new(4.0, 0.02, 0.2),
            meshes::diffuse(0.0, 0.0, 0.0),
        );
        Self { stage }
    }

    /// Puts a plate of a material on the bench.
    pub fn plate<M: Material>(&mut self, material: M) -> Entity {
        self.sample(meshes::plate(false), material)
    }

    /// Puts a mesh on the bench.
    pub fn sample<M: Material>(&mut self, mesh: Mesh, material: M) -> Entity {
        meshes::spawn(&mut self.stage, mesh, material, Placement::Away.transform())
    }

    /// Takes a sample away.
    pub fn clear(&mut self, entity: Entity) {
        assert!(self.stage.world_mut().despawn(entity), "the sample was there");
    }

    /// Moves a sample, or the joint that moves it.
    pub fn put(&mut self, entity: Entity, placement: Placement) {
        *self.stage.world_mut().get_mut::<Transform>(entity).expect("a sample") =
            placement.transform();
    }

    /// Looks at the wall, or at what stands in its place, across the floor.
    fn look_at_wall(&mut self, settings: &str) -> [f64; 3] {
        set::look(&mut self.stage, Vec3::new(0.0, 1.0, -0.5), Vec3::new(0.0, 1.0, -2.0));
        set::apply(&mut self.stage, settings);
        set::channel_means(&set::radiance(&mut self.stage))
    }

    /// What the sun finds of a sample, and what the wall gets of it.
    pub fn as_source(&mut self, entity: Entity, placement: Placement) -> Source {
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

    /// The sun's texels over the middle of the floor that lie on a sample, and how many there are
    /// with those that do not.
    pub fn middle(&self) -> (Vec<Point>, usize) {
        let texels = gpu::rsm_texels(&self.stage);
        // Where the sun meets nothing, a texel lies at the origin.
        let in_middle = |texel: &&Point| {
            texel.position != [0.0; 3]
                && texel.position[0].abs() < 1.0
                && texel.position[2].abs() < 1.0
        };
        let middle: Vec<Point> = texels.iter().filter(in_middle).copied().collect();
        // The floor lies at 0. A texel that reflects nothing keeps its place.
        let all = middle.len();
        (middle.into_iter().filter(|texel| texel.position[1] > 0.5 * HEIGHT).collect(), all)
    }

    /// Indirect radiance of a sample that receives the floor's light: all that it shows, without
    /// what it shows when there is no GI.
    pub fn as_receiver(&mut self, entity: Entity) -> [f64; 3] {
        self.put(entity, Placement::Wall);
        let with = self.look_at_wall(SETTINGS);
        let without = self.look_at_wall(&format!("{SETTINGS},gi_vpl_count=0"));
        std::array::from_fn(|channel| with[channel] - without[channel])
    }

    /// Radiance of the wall's middle from close by, with rays.
    fn behind(&mut self) -> f64 {
        set::look(&mut self.stage, Vec3::new(0.0, 1.1, -1.87), Vec3::new(0.0, 1.1, -2.0));
        set::apply(&mut self.stage, &format!("{SETTINGS},gi_visibility=fine"));
        set::radiance(&mut self.stage).mean()
    }

    /// Share of the floor's light that rays find a sample close before the wall to keep from it.
    pub fn as_occluder(&mut self, entity: Entity) -> f64 {
        self.put(entity, Placement::Away);
        let open = *OPEN_WALL.get_or_init(|| self.behind());
        self.put(entity, Placement::Wall);
        1.0 - self.behind() / open
    }

    /// All of it.
    pub fn measure(&mut self, entity: Entity) -> Effect {
        let source = self.as_source(entity, Placement::Floor);
        let received = self.as_receiver(entity);
        Effect { source, received, hidden: self.as_occluder(entity) }
    }

    /// All of it for a plate, which is taken away again.
    pub fn measure_plate<M: Material>(&mut self, label: &str, material: M) -> Relative {
        let plate = self.plate(material);
        let effect = self.measure(plate);
        self.clear(plate);
        self.relative(label, effect)
    }

    /// What a diffuse grey plate does.
    pub fn reference(&mut self) -> Effect {
        *REFERENCE.get_or_init(|| {
            let plate = self.plate(meshes::diffuse(GREY, GREY, GREY));
            OPEN_FLOOR.get_or_init(|| self.as_source(plate, Placement::Away).wall[1]);
            let effect = self.measure(plate);
            self.clear(plate);
            effect
        })
    }

    /// Share of the open floor's light that the wall gets, past a sample on the floor.
    pub fn share_of_open_floor(&self, source: &Source) -> f64 {
        source.wall[1] / OPEN_FLOOR.get().expect("the reference was measured")
    }

    /// `effect` in units of what a diffuse grey plate does, printed.
    pub fn relative(&mut self, label: &str, effect: Effect) -> Relative {
        let reference = self.reference();
        let over =
            |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|channel| a[channel] / b[channel]);
        let relative = Relative {
            covered: effect.source.covered,
            sent: over(effect.source.flux, reference.source.flux),
            wall: over(effect.source.wall, reference.source.wall),
            received: over(effect.received, reference.received),
            hidden: effect.hidden,
        };
        let [r, g, b] = relative.sent;
        let [x, y, z] = relative.received;
        println!(
            "    {label}: covers {:.3}, sends {r:.3} {g:.3} {b:.3}, wall {:.3}, receives {x:.3} {y:.3} {z:.3}, hides {:.3}",
            relative.covered, relative.wall[1], relative.hidden
        );
        relative
    }
}

/// A sample's measurements; what is sent, seen on the wall and received is in units of what a
/// diffuse grey plate does.
#[derive(Clone, Copy, Debug)]
pub struct Relative {
    pub covered: f64,
    pub sent: [f64; 3],
    pub wall: [f64; 3],
    pub received: [f64; 3],
    pub hidden: f64,
}

impl Relative {
    /// Whether it does what a diffuse plate of these albedos does: it stands in the light, sends
    /// its share on, receives, and hides.
    #[track_caller]
    pub fn assert_diffuse(&self, label: &str, albedo: [f64; 3]) {
        self.assert_covers(label, 1.0);
        self.assert_sends(label, albedo);
        self.assert_receives(label, albedo);
        self.assert_hides(label, true);
    }

    #[track_caller]
    pub fn assert_covers(&self, label: &str, share: f64) {
        assert!((self.covered - share).abs() < 1e-9, "{label}: covers {}", self.covered);
    }

    /// Flux of its texels, exact but for the G-buffer's eight bits, which are known; the wall is
    /// lit by them and by nothing else.
    #[track_caller]
    pub fn assert_sends(&self, label: &str, albedo: [f64; 3]) {
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
    pub fn assert_receives(&self, label: &str, albedo: [f64; 3]) {
        for (channel, albedo) in albedo.into_iter().enumerate() {
            let expected = relative_albedo(albedo);
            assert!(
                (self.received[channel] - expected).abs() < 4e-3 * expected.max(0.1),
                "{label}: {:?}, {expected}",
                self.received
            );
        }
    }

    /// The strip of floor between sample and wall, 5 cm wide, is not hidden by it.
    #[track_caller]
    pub fn assert_hides(&self, label: &str, hides: bool) {
        assert!(
            if hides { self.hidden > 0.95 } else { self.hidden.abs() < 0.02 },
            "{label}: hides {}",
            self.hidden
        );
    }
}

/// What texels take of the light across it, m²: of those that lean, the area is known by the
/// cosine, down to a tenth.
pub fn across(texels: &[Point]) -> f64 {
    texels
        .iter()
        .map(|texel| f64::from(texel.extent * texel.normal[1].max(0.1)))
        .sum::<f64>()
        .max(1e-9)
}

/// What the G-buffer keeps of an albedo, over what it keeps of the reference's.
pub fn relative_albedo(albedo: f64) -> f64 {
    meshes::stored_albedo(albedo) / meshes::stored_albedo(f64::from(GREY))
}
