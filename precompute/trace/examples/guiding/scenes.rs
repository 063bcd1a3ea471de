//! Small scenes, in metres: in some all light is indirect, others are open. Nothing was tuned on the
//! last two.

use frugal_trace::integrator::{ReferenceScene, View};
use frugal_trace::light::{Light, Sky};
use frugal_trace::scene::{CameraPose, SceneMaterial};
use glam::{UVec2, Vec3};

use crate::model::{Model, lamp_of, matte};

/// A scene and a camera in it.
pub(crate) struct Place {
    /// Its name.
    pub(crate) name: &'static str,
    /// Whether the camera sees hardly any light but indirect light.
    pub(crate) is_indirect: bool,
    /// What is there.
    pub(crate) scene: ReferenceScene,
    /// The camera.
    pub(crate) view: View,
}

/// All scenes.
pub(crate) fn all(size: UVec2) -> Vec<Place> {
    let looking = |from: [f32; 3], to: [f32; 3]| View {
        pose: CameraPose::looking_at(from.into(), to.into()),
        vertical_fov_degrees: 60.0,
        near: 0.01,
        size,
    };
    let place = |name, is_indirect, scene, view| Place { name, is_indirect, scene, view };
    vec![
        place("ajar door", true, ajar_door(), looking([0.6, 1.6, 3.4], [2.6, 0.9, 0.0])),
        place("spot on a ceiling", true, spot(), looking([0.6, 1.6, 3.4], [2.6, 0.9, 0.0])),
        place("pinhole roof", true, pinhole(), looking([0.6, 1.6, 3.4], [2.6, 0.9, 0.0])),
        place("lamp in a shade", true, lamp(), looking([0.6, 1.6, 3.4], [2.6, 0.9, 0.0])),
        place("long corridor", true, corridor(), looking([1.0, 1.6, 11.5], [1.0, 1.3, 0.0])),
        place("polished ring", false, ring(), looking([0.0, 0.9, 1.1], [0.0, 0.0, 0.0])),
        place("open field", false, field(), looking([0.0, 1.7, 9.0], [0.0, 1.0, 0.0])),
        place("courtyard", false, courtyard(), looking([-4.5, 1.7, 4.5], [2.0, 1.0, -2.0])),
        place("uplight", true, uplight(), looking([5.4, 1.5, 0.5], [1.0, 1.0, 3.0])),
        place("street", false, street(), looking([1.0, 1.7, 18.0], [0.0, 2.5, 0.0])),
    ]
}

/// A room of 4 × 2.5 × 5 m, and behind a door that is open by a hand's width, a lit room.
fn ajar_door() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.7)).inside([0.0, 0.0, -4.0], [4.0, 2.5, 5.0]);
    model.furniture();
    // The wall between the rooms, with a gap of 12 cm by 2 m.
    model.solid([0.0, 0.0, -0.1], [1.2, 2.5, 0.0]);
    model.solid([1.32, 0.0, -0.1], [4.0, 2.5, 0.0]);
    model.solid([1.2, 2.0, -0.1], [1.32, 2.5, 0.0]);
    model.material(lamp_of(400.0)).solid([2.6, 2.3, -0.9], [3.4, 2.4, -0.3]);
    model.scene(&[], Sky::Black)
}

/// A spot of one degree up at the ceiling lights a whole room.
fn spot() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.7)).inside([0.0, 0.0, 0.0], [4.0, 2.5, 5.0]);
    model.furniture();
    let spot = Light::Spot {
        position: Vec3::new(2.0, 0.4, 4.4),
        direction: Vec3::Y,
        luminous_power: 1e6,
        range: 30.0,
        inner_angle: 0.9,
        outer_angle: 1.0,
        color: [1.0; 3],
    };
    model.scene(&[spot], Sky::Black)
}

/// The sun through a hole of 6 cm in the roof.
fn pinhole() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.7));
    let ([x, z], half) = ([2.5, 3.9], 0.03);
    model.solid([-0.1, -0.1, -0.1], [4.1, 0.0, 5.1]);
    for (min, max) in [([-0.1, -0.1], [4.1, 0.0]), ([-0.1, 5.0], [4.1, 5.1])] {
        model.solid([min[0], 0.0, min[1]], [max[0], 2.5, max[1]]);
    }
    for (min, max) in [([-0.1, 0.0], [0.0, 5.0]), ([4.0, 0.0], [4.1, 5.0])] {
        model.solid([min[0], 0.0, min[1]], [max[0], 2.5, max[1]]);
    }
    for (min, max) in [
        ([-0.1, -0.1], [4.1, z - half]),
        ([-0.1, z + half], [4.1, 5.1]),
        ([-0.1, z - half], [x - half, z + half]),
        ([x + half, z - half], [4.1, z + half]),
    ] {
        model.solid([min[0], 2.5, min[1]], [max[0], 2.52, max[1]]);
    }
    model.furniture();
    let sun = Light::Directional {
        direction: Vec3::new(-0.3, -1.0, 0.2),
        illuminance: 1e5,
        color: [1.0; 3],
    };
    model.scene(&[sun], Sky::Black)
}

/// A bulb in a shade that is open above and below.
fn lamp() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.7)).inside([0.0, 0.0, 0.0], [4.0, 2.5, 5.0]);
    model.furniture();
    let shade = SceneMaterial { double_sided: true, ..matte(0.5) };
    let center = Vec3::new(2.2, 1.5, 4.2);
    model.material(shade).wall(center, 0.16, 0.11, 0.35, 24);
    model.material(lamp_of(20_000.0)).solid(
        (center - Vec3::new(0.03, 0.04, 0.03)).into(),
        (center + Vec3::new(0.03, 0.04, 0.03)).into(),
    );
    model.scene(&[], Sky::Black)
}

/// A corridor of 2 × 2.5 × 12 m; light comes from round the corner at its end.
fn corridor() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.6)).inside([0.0, 0.0, -3.0], [6.0, 2.5, 12.0]);
    // What is not corridor: beside it, from its mouth on.
    model.solid([2.0, 0.0, -1.0], [6.0, 2.5, 12.0]);
    let light = Light::Point {
        position: Vec3::new(5.0, 2.0, -2.0),
        luminous_power: 4000.0,
        range: 40.0,
        color: [1.0; 3],
    };
    model.scene(&[light], Sky::Black)
}

/// The sun in a ring of polished metal draws a caustic on a table.
fn ring() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.7)).solid([-1.0, -0.1, -1.0], [1.0, 0.0, 1.0]);
    let metal = SceneMaterial {
        base_color: [0.9, 0.8, 0.5, 1.0],
        metallic: 1.0,
        perceptual_roughness: 0.1,
        double_sided: true,
        ..SceneMaterial::default()
    };
    model.material(metal).wall(Vec3::Y * 0.1, 0.3, 0.3, 0.2, 64);
    let sun = Light::Directional {
        direction: Vec3::new(-0.8, -0.7, 0.1),
        illuminance: 1e5,
        color: [1.0; 3],
    };
    model.scene(&[sun], Sky::constant([500.0; 3]))
}

/// Blocks on a plain under sun and sky.
fn field() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.4)).solid([-50.0, -1.0, -50.0], [50.0, 0.0, 50.0]);
    for (x, z, height) in [(-3.0, 0.0, 1.0), (0.0, -2.0, 3.0), (2.5, 1.0, 0.6), (5.0, -4.0, 2.0)] {
        model.solid([x, 0.0, z], [x + 1.0, height, z + 1.0]);
    }
    let sun = Light::Directional {
        direction: Vec3::new(-0.5, -1.0, -0.3),
        illuminance: 8e4,
        color: [1.0; 3],
    };
    model.scene(&[sun], Sky::constant([4000.0; 3]))
}

/// Four walls of 12 m around a court with an arcade, under sun and sky.
fn courtyard() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.55)).solid([-6.0, -0.2, -6.0], [6.0, 0.0, 6.0]);
    for (min, max) in [
        ([-6.2, -6.2], [6.2, -6.0]),
        ([-6.2, 6.0], [6.2, 6.2]),
        ([-6.2, -6.0], [-6.0, 6.0]),
        ([6.0, -6.0], [6.2, 6.0]),
    ] {
        model.solid([min[0], 0.0, min[1]], [max[0], 5.0, max[1]]);
    }
    // The arcade: a roof along one wall, on pillars.
    model.solid([-6.0, 2.8, -6.0], [6.0, 3.0, -3.5]);
    for i in 0..6 {
        let x = -5.0 + 2.0 * i as f32;
        model.solid([x - 0.15, 0.0, -3.8], [x + 0.15, 2.8, -3.5]);
    }
    let sun = Light::Directional {
        direction: Vec3::new(-0.6, -1.0, -0.4),
        illuminance: 8e4,
        color: [1.0; 3],
    };
    model.scene(&[sun], Sky::constant([4000.0; 3]))
}

/// A light deep in a tub beside a wall lights a patch of the ceiling of a room of 6 × 3 × 4 m.
fn uplight() -> ReferenceScene {
    let mut model = Model::default();
    model.material(matte(0.6)).inside([0.0, 0.0, 0.0], [6.0, 3.0, 4.0]);
    model.solid([2.5, 0.0, 1.5], [3.5, 1.1, 2.0]);
    let tub = SceneMaterial { double_sided: true, ..matte(0.3) };
    model.material(tub).wall(Vec3::new(0.6, 0.5, 0.7), 0.1, 0.2, 1.0, 16);
    let light = Light::Point {
        position: Vec3::new(0.6, 0.2, 0.7),
        luminous_power: 8000.0,
        range: 20.0,
        color: [1.0; 3],
    };
    model.scene(&[light], Sky::Black)
}

/// A street between two rows of houses, under a low sun and a sky; the ground is wet.
fn street() -> ReferenceScene {
    let mut model = Model::default();
    let wet = SceneMaterial { perceptual_roughness: 0.3, ..matte(0.2) };
    model.material(wet).solid([-30.0, -0.2, -30.0], [30.0, 0.0, 30.0]);
    model.material(matte(0.5));
    for i in 0..5 {
        let (z, height) = (-20.0 + 8.0 * i as f32, 6.0 + (i % 3) as f32);
        model.solid([-9.0, 0.0, z], [-3.5, height, z + 7.5]);
        model.solid([3.5, 0.0, z], [9.0, height + 1.0, z + 7.5]);
    }
    let sun = Light::Directional {
        direction: Vec3::new(-0.9, -0.7, -0.3),
        illuminance: 6e4,
        color: [1.0; 3],
    };
    model.scene(&[sun], Sky::constant([3000.0; 3]))
}
