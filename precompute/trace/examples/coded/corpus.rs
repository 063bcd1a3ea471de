//! Small pictures to hide codes in and to raise false alarms on: noise, patterns, and rooms with
//! textured walls.

use std::f64::consts::TAU;

use frugal_trace::integrator::{ReferenceScene, Settings, View, Watch, render};
use frugal_trace::light::{Light, Sky};
use frugal_trace::metrics::Radiance;
use frugal_trace::scene::{
    CameraPose, Filter, RayScene, SceneGeometry, SceneMaterial, SceneMesh, SceneTexture, Texels,
    TextureUse, Wrap,
};
use glam::{Quat, UVec2, Vec2, Vec3};

/// Pixels: every 40th column or so of an image, since its rows are what matters.
pub(crate) const SIZE: UVec2 = UVec2::new(32, 1024);
const STRIPS: u16 = 4;
/// Pictures of each of the three kinds.
pub(crate) const KINDS: [(&str, u64); 3] = [("noise", 50), ("pattern", 50), ("room", 100)];

/// A picture: its light by a modulated light, and by all that is not modulated.
pub(crate) struct Case {
    pub(crate) kind: &'static str,
    pub(crate) modulated: Radiance,
    pub(crate) ambient: Radiance,
    /// Random numbers for what follows.
    pub(crate) random: Random,
}

/// Numbers in [0, 1): `SplitMix64`.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xd129_0d3a_5f3b_2e45))
    }

    pub(crate) fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let value = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((value ^ (value >> 31)) >> 11) as f64 * 2.0_f64.powi(-53)
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.number()
    }

    /// With an evenly spread logarithm.
    pub(crate) fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }
}

/// All pictures of a seed.
pub(crate) fn all(seed: u64) -> impl Iterator<Item = Case> {
    KINDS.into_iter().flat_map(move |(kind, count)| (0..count).map(move |i| one(kind, seed, i)))
}

fn one(kind: &'static str, seed: u64, i: u64) -> Case {
    let mut random = Random::new(seed * 1000 + i + u64::from(kind.as_bytes()[0]) * 1_000_000);
    let unlit = random.between(0.0, 0.5);
    let (modulated, ambient) = if kind == "room" {
        room(&mut random)
    } else {
        let flat = if kind == "noise" { noise(&mut random) } else { pattern(&mut random) };
        let grain = random.scale(0.003, 0.1);
        let mut light = |x: u32, y: u32| {
            let own = flat(f64::from(x) / f64::from(SIZE.x), f64::from(y) / f64::from(SIZE.y));
            own * (1.0 + grain * (random.number() + random.number() - 1.0))
        };
        let values: Vec<f64> = (0..SIZE.y)
            .flat_map(|y| (0..SIZE.x).map(move |x| (x, y)))
            .map(|(x, y)| light(x, y))
            .collect();
        let of = |share: f64| Radiance {
            width: SIZE.x,
            height: SIZE.y,
            rgb: values.iter().map(|value| [(value * share) as f32; 3]).collect(),
        };
        (of(1.0 - unlit), of(unlit))
    };
    Case { kind, modulated, ambient, random }
}

/// Reflectance in [0.02, 1] at a point; both coordinates run to 1 over the image's height.
type Flat = Box<dyn Fn(f64, f64) -> f64>;

/// Waves in all directions whose amplitude falls with a power of their frequency.
fn noise(random: &mut Random) -> Flat {
    let (slope, contrast) = (random.between(0.5, 1.5), random.scale(0.05, 0.5));
    let waves: Vec<[f64; 4]> = (0..32)
        .map(|_| {
            let (frequency, angle) = (random.scale(0.5, 400.0), random.between(0.0, TAU));
            let amplitude = frequency.powf(0.5 - slope);
            [frequency * angle.cos(), frequency * angle.sin(), random.between(0.0, TAU), amplitude]
        })
        .collect();
    let scale = contrast / waves.iter().map(|wave| wave[3].powi(2) * 0.5).sum::<f64>().sqrt();
    Box::new(move |x, y| {
        let sum: f64 =
            waves.iter().map(|[u, v, at, size]| size * (TAU * (u * x + v * y) + at).sin()).sum();
        (0.5 + 0.25 * scale * sum).clamp(0.02, 1.0)
    })
}

/// Planks, checks, gratings, steps or discs.
fn pattern(random: &mut Random) -> Flat {
    let which = (random.number() * 5.0) as u32;
    let (period, tilt) = (random.scale(0.01, 0.3), random.between(-0.6, 0.6));
    let (dark, light) = (random.between(0.05, 0.5), random.between(0.5, 0.95));
    let share = random.between(0.2, 0.8);
    let seed = (random.number() * 1e6) as u64;
    let mix = move |is_light: bool| if is_light { light } else { dark };
    let hash = move |a: f64, b: f64| {
        Random::new(seed + (a + 1e4) as u64 * 7919 + (b + 1e4) as u64 * 104_729).number()
    };
    Box::new(move |x, y| {
        let along = (y + tilt * x) / period;
        match which {
            0 => dark + (light - dark) * hash(along.floor(), 0.0),
            1 => mix((along.floor() + (x / period).floor()).rem_euclid(2.0) < 1.0),
            2 => mix(along.rem_euclid(1.0) < share),
            3 => dark + (light - dark) * (0.5 + 0.5 * (TAU * along).sin()),
            _ => {
                let (u, v) = (x / period, y / period);
                let center = hash(u.floor(), v.floor());
                mix((u - u.floor() - center).hypot(v - v.floor() - 0.5) < share * 0.5)
            }
        }
    })
}

/// A room whose walls, floor and box have textures, by a light and by a sky through its open front.
fn room(random: &mut Random) -> (Radiance, Radiance) {
    let mut geometry = SceneGeometry::default();
    for material in 0..4 {
        let flat = if random.number() < 0.5 { noise(random) } else { pattern(random) };
        let side = 64;
        let texel = |i: u32| {
            let at = |i: u32| f64::from(i) / f64::from(side);
            let value = (flat(at(i % side), at(i / side)) * 255.0) as u8;
            [value, value, value, 255]
        };
        geometry.textures.push(SceneTexture {
            width: side,
            height: side,
            texels: Texels::Linear((0..side * side).map(texel).collect()),
            wrap: [Wrap::Mirror; 2],
            filter: Filter::Linear,
        });
        geometry.materials.push(SceneMaterial {
            base_color_texture: Some(TextureUse::plain(material)),
            double_sided: true,
            ..SceneMaterial::default()
        });
        geometry.meshes.push(SceneMesh { material, ..SceneMesh::default() });
    }
    let (o, x, y, z) = (Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 2.5, Vec3::Z * 5.0);
    quad(&mut geometry.meshes[0], o, z, x);
    quad(&mut geometry.meshes[0], y, x, z);
    quad(&mut geometry.meshes[1], o, x, y);
    quad(&mut geometry.meshes[2], o, y, z);
    quad(&mut geometry.meshes[2], x, z, y);
    let at = Vec3::new(random.between(0.5, 2.5) as f32, 0.0, random.between(0.5, 2.0) as f32);
    let side = random.between(0.4, 1.2) as f32;
    quad(&mut geometry.meshes[3], at + Vec3::Y * side, Vec3::Z, Vec3::X);
    quad(&mut geometry.meshes[3], at + Vec3::Z, Vec3::X, Vec3::Y * side);
    let rays = RayScene::from_geometry(&geometry).into();
    let geometry = std::sync::Arc::new(geometry);
    let mut place = |low: f32, high: f32| {
        Vec3::new(
            random.between(0.4, 3.6) as f32,
            random.between(f64::from(low), f64::from(high)) as f32,
            random.between(0.5, 4.0) as f32,
        )
    };
    let (position, target) = (place(1.8, 2.4), place(0.0, 2.0).with_z(0.0));
    let light = Light::Point { position, luminous_power: 3000.0, range: 30.0, color: [1.0; 3] };
    let toward = CameraPose::looking_at(Vec3::new(2.0, 1.4, 4.8), target);
    // Strips from left to right, as many as the detector has blocks beside each other.
    let views: Vec<View> = (0..STRIPS)
        .map(|strip| {
            let turn = 0.2 * (f32::from(STRIPS - 1) * 0.5 - f32::from(strip));
            View {
                pose: CameraPose {
                    rotation: Quat::from_rotation_y(turn) * toward.rotation,
                    ..toward
                },
                vertical_fov_degrees: 50.0,
                near: 0.01,
                size: SIZE / UVec2::new(u32::from(STRIPS), 1),
            }
        })
        .collect();
    let sky = random.between(0.0, 40.0) as f32;
    let settings = Settings { samples: 1, bounces: Some(0), ..Settings::default() };
    let image = |lights: &[Light], sky: Sky, rays: &std::sync::Arc<RayScene>| {
        let scene = ReferenceScene::new(geometry.clone(), rays.clone(), lights, sky);
        let scene = scene.expect("valid geometry");
        let strip =
            |view| render(&scene, view, &settings, Watch::default()).expect("no interruption");
        let strips: Vec<Radiance> = views.iter().map(|view| strip(view).full()).collect();
        let width = strips[0].width as usize;
        let row = |y| strips.iter().flat_map(move |strip| &strip.rgb[y * width..(y + 1) * width]);
        let rgb = (0..SIZE.y as usize).flat_map(row).copied().collect();
        Radiance { width: SIZE.x, height: SIZE.y, rgb }
    };
    let rays: std::sync::Arc<RayScene> = rays;
    (image(&[light], Sky::Black, &rays), image(&[], Sky::constant([sky; 3]), &rays))
}

/// A parallelogram with a metre of texture to a metre, its front towards `right` × `up`.
fn quad(mesh: &mut SceneMesh, corner: Vec3, right: Vec3, up: Vec3) {
    let first = mesh.positions.len() as u32;
    for (r, u) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        mesh.positions.push(corner + right * r + up * u);
        mesh.normals.push(right.cross(up).normalize());
        mesh.uvs.push(Vec2::new(r * right.length(), u * up.length()));
    }
    mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
}

/// Detections among pictures.
#[derive(Clone, Copy, Default)]
pub(crate) struct Rate {
    pub(crate) hits: u32,
    pub(crate) of: u32,
}

impl Rate {
    pub(crate) fn add(&mut self, is_hit: bool) {
        self.hits += u32::from(is_hit);
        self.of += 1;
    }

    pub(crate) fn share(self) -> f64 {
        f64::from(self.hits) / f64::from(self.of.max(1))
    }

    /// Wilson's interval of 95 % confidence.
    pub(crate) fn interval(self) -> [f64; 2] {
        let (n, p, z) = (f64::from(self.of.max(1)), self.share(), 1.96);
        let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
        let middle = p + z * z / (2.0 * n);
        let scale = 1.0 / (1.0 + z * z / n);
        [(middle - half) * scale, (middle + half) * scale]
    }
}
