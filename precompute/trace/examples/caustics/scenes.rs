//! Six small scenes, in metres, with a light at metal that throws a caustic on matte surfaces.

use std::f32::consts::{PI, TAU};

use frugal_trace::integrator::{ReferenceScene, View};
use frugal_trace::scene::{CameraPose, SceneMaterial, SceneMesh};
use glam::{UVec2, Vec3};

use crate::sheet::{scene, sheet, spot};

/// A scene and a camera in it.
pub(crate) struct Place {
    /// Its name.
    pub(crate) name: &'static str,
    /// What is there.
    pub(crate) scene: ReferenceScene,
    /// The camera.
    pub(crate) view: View,
}

/// All scenes.
pub(crate) fn all(size: UVec2) -> Vec<Place> {
    let looking = |from: [f32; 3], to: [f32; 3]| View {
        pose: CameraPose::looking_at(from.into(), to.into()),
        vertical_fov_degrees: 50.0,
        near: 0.01,
        size,
    };
    let place = |name, scene, view| Place { name, scene, view };
    vec![
        place("polished ring", ring(), looking([0.0, 1.3, 0.8], [0.0, 0.0, 0.0])),
        place("bent mirror", mirror(), looking([0.0, 1.4, 1.6], [0.0, 0.0, 0.1])),
        place("bowl", bowl(), looking([-1.2, 1.3, 1.2], [0.0, 0.1, 0.0])),
        place("mirrored strips", strips(), looking([0.0, 1.9, 2.6], [0.0, 0.3, 0.2])),
        place("pool", pool(), looking([0.0, 1.0, 2.8], [0.0, 0.9, -1.0])),
        place("many spheres", spheres(), looking([0.0, 1.7, 1.3], [0.0, 0.0, 0.0])),
    ]
}

fn ring() -> ReferenceScene {
    let mut model = Model::table();
    model.sheet(metal([0.95, 0.8, 0.5]), [96, 2], |s, t| {
        let (sine, cosine) = (s * TAU).sin_cos();
        Vec3::new(0.35 * sine, 0.2 * t, 0.35 * cosine)
    });
    model.lit([-1.2, 1.1, 0.2], [0.0, 0.1, 0.0], 22.0)
}

fn mirror() -> ReferenceScene {
    let mut model = Model::table();
    model.sheet(metal([0.9; 3]), [64, 2], |s, t| {
        let x = 1.2 * (s - 0.5);
        Vec3::new(x, 0.4 * t, -0.6 + 0.8 * x * x + 0.15 * (3.0 * x).sin())
    });
    model.lit([0.6, 1.6, 1.8], [0.0, 0.2, -0.5], 20.0)
}

fn bowl() -> ReferenceScene {
    let mut model = Model::table();
    model.sheet(metal([0.9, 0.9, 0.95]), [64, 32], |s, t| {
        // A cap of a sphere above the table, which faces −X and downwards.
        let ((sine, cosine), (r, along)) = ((s * TAU).sin_cos(), (0.2 * PI * t).sin_cos());
        let (x, y, z) = (0.7 * along - 0.35, 0.7 * r * cosine, 0.7 * r * sine);
        Vec3::new(0.9 * x + 0.44 * y + 0.3, 0.6 + 0.44 * x - 0.9 * y, z)
    });
    model.lit([-1.6, 0.5, 0.4], [0.5, 0.7, 0.0], 16.0)
}

fn strips() -> ReferenceScene {
    let mut model = Model::table();
    for i in 0..12_i16 {
        let (x, tilt) = (0.16 * (f32::from(i) - 5.5), 0.25 * (f32::from(i) * 2.4).sin());
        model.sheet(metal([0.9; 3]), [1, 1], |s, t| {
            let across = 0.14 * (s - 0.5);
            Vec3::new(x + across * tilt.cos(), 0.2 + 0.8 * t, -0.9 + across * tilt.sin() + 0.1 * t)
        });
    }
    model.lit([0.3, 2.4, 1.4], [0.0, 0.6, -0.9], 25.0)
}

fn pool() -> ReferenceScene {
    let mut model = Model::default();
    // A wall behind the water.
    model.sheet(matte(), [1, 1], |s, t| Vec3::new(3.0 * (s - 0.5), 2.4 * t, -1.2));
    model.sheet(metal([0.8, 0.9, 1.0]), [128, 96], |s, t| {
        let (x, z) = (2.4 * (s - 0.5), 0.8 - 2.0 * t);
        let wave = |a: f32, b: f32, c: f32| (a * x + b * z + c).sin();
        Vec3::new(x, 0.012 * (wave(5.0, 9.0, 0.0) + wave(-8.0, 6.0, 1.0) + wave(11.0, 3.0, 2.0)), z)
    });
    model.lit([0.0, 2.6, 1.8], [0.0, 0.0, -0.2], 24.0)
}

fn spheres() -> ReferenceScene {
    let mut model = Model::table();
    for i in 0..16_u16 {
        let at =
            |n: u16, step: f32| f32::from(n % 4) * 0.3 - 0.45 + 0.06 * (step * f32::from(i)).sin();
        let (x, z, radius) = (at(i, 1.7), at(i / 4, 2.9), 0.06 + 0.02 * f32::from(i).sin());
        model.sheet(metal([0.95, 0.9, 0.85]), [24, 16], |s, t| {
            let ((sine, cosine), (r, y)) = ((s * TAU).sin_cos(), (PI * (1.0 - t)).sin_cos());
            Vec3::new(x + radius * r * sine, radius * (1.0 + y), z + radius * r * cosine)
        });
    }
    model.lit([-1.4, 0.9, 0.5], [0.0, 0.05, 0.0], 24.0)
}

fn matte() -> SceneMaterial {
    SceneMaterial {
        base_color: [0.7, 0.68, 0.65, 1.0],
        reflectance: 0.0,
        double_sided: true,
        ..SceneMaterial::default()
    }
}

fn metal([red, green, blue]: [f32; 3]) -> SceneMaterial {
    SceneMaterial {
        base_color: [red, green, blue, 1.0],
        metallic: 1.0,
        perceptual_roughness: 0.1,
        double_sided: true,
        ..SceneMaterial::default()
    }
}

/// Meshes as they are made.
#[derive(Default)]
struct Model {
    parts: Vec<(SceneMaterial, SceneMesh)>,
}

impl Model {
    fn table() -> Self {
        let mut model = Self::default();
        model.sheet(matte(), [1, 1], |s, t| Vec3::new(4.0 * (s - 0.5), 0.0, 2.0 - 4.0 * t));
        model
    }

    /// A curved sheet of `columns` × `rows` cells.
    fn sheet(&mut self, material: SceneMaterial, cells: [u32; 2], at: impl Fn(f32, f32) -> Vec3) {
        self.parts.push((material, sheet(cells, at)));
    }

    /// A scene with one spot light from `from` at `to`, half of whose angle is `degrees`.
    fn lit(self, from: [f32; 3], to: [f32; 3], degrees: f32) -> ReferenceScene {
        scene(self.parts, &[spot(from, to, degrees)])
    }
}
