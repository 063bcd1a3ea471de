//! Three lights in a cube of fog of 2 m, before darkness: all that the camera sees is scattered by
//! fog.

use frugal_trace::integrator::{ReferenceScene, View};
use frugal_trace::light::Light;
use frugal_trace::media::Fog;
use frugal_trace::scene::{Bounds, CameraPose, SceneMaterial, SceneMesh};
use glam::{UVec2, Vec3};

use crate::sheet::{scene, sheet, spot};

/// A scene and a camera in it.
pub(crate) struct Place {
    /// Its light.
    pub(crate) name: &'static str,
    /// What is there.
    pub(crate) scene: ReferenceScene,
    /// The camera.
    pub(crate) view: View,
    /// As in the settings.
    pub(crate) bounces: Option<u32>,
    /// Whether many paths are the better truth.
    pub(crate) is_found_by_paths: bool,
}

/// All scenes.
pub(crate) fn all() -> Vec<Place> {
    vec![
        place("a spot, once scattered", beside(), vec![], Some(0), true),
        place("a spot", beside(), vec![], None, false),
        place("a slit", None, slit(), None, false),
        place(
            "a mirror",
            Some(spot([-1.1, 1.5, 0.0], [0.3, -0.8, 0.0], 14.0)),
            vec![(metal(), mirror())],
            None,
            false,
        ),
    ]
}

fn beside() -> Option<Light> {
    Some(spot([0.9, 1.5, 0.0], [-0.5, -1.0, 0.0], 14.0))
}

fn place(
    name: &'static str,
    light: Option<Light>,
    mut parts: Vec<(SceneMaterial, SceneMesh)>,
    bounces: Option<u32>,
    is_found_by_paths: bool,
) -> Place {
    // A dark floor, of which the camera sees nothing but black.
    let floor = sheet([1, 1], |s, t| Vec3::new(2.0 * s - 1.0, -1.0, 1.0 - 2.0 * t));
    parts.push((material([0.0; 3], 0.0), floor));
    let lights: Vec<Light> = light.into_iter().collect();
    let fog = Fog {
        absorption: [0.05; 3],
        scattering: [0.3; 3],
        asymmetry: 0.3,
        bounds: Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) },
    };
    let scene = scene(parts, &lights).with_fog(fog).expect("valid fog");
    let view = View {
        pose: CameraPose::looking_at(Vec3::new(0.0, 0.1, 3.2), Vec3::new(0.0, 0.0, 0.0)),
        vertical_fov_degrees: 40.0,
        near: 0.01,
        size: UVec2::new(48, 36),
    };
    Place { name, scene, view, bounces, is_found_by_paths }
}

/// A panel in a dark shade, which is open at a slit of 2 cm.
fn slit() -> Vec<(SceneMaterial, SceneMesh)> {
    let flat = |least: f32, most: f32, y: f32| {
        sheet([1, 1], move |s, t| Vec3::new(least + (most - least) * s, y, 0.3 - 0.6 * t))
    };
    let side = |x: f32| sheet([1, 1], move |s, t| Vec3::new(x, 0.7 + 0.3 * t, 0.3 - 0.6 * s));
    let end = |z: f32| sheet([1, 1], move |s, t| Vec3::new(0.6 * s - 0.3, 0.7 + 0.3 * t, z));
    let dark = material([0.0; 3], 0.0);
    let panel = sheet([1, 1], |s, t| Vec3::new(0.2 * s - 0.1, 0.95, 0.1 - 0.2 * t));
    let shade = [
        flat(-0.3, -0.01, 0.7),
        flat(0.01, 0.3, 0.7),
        flat(-0.3, 0.3, 1.0),
        side(-0.3),
        side(0.3),
        end(-0.3),
        end(0.3),
    ];
    let mut parts: Vec<_> = shade.map(|mesh| (dark.clone(), mesh)).into();
    parts.push((material([0.0; 3], 1e4), panel));
    parts
}

/// A trough that is bent towards its focus.
fn mirror() -> SceneMesh {
    sheet([32, 2], |s, t| {
        let x = 1.2 * (s - 0.5);
        Vec3::new(0.2 + x, -0.95 + 0.6 * x * x, 0.6 - 1.2 * t)
    })
}

fn metal() -> SceneMaterial {
    SceneMaterial {
        metallic: 1.0,
        perceptual_roughness: 0.1,
        base_color: [0.9, 0.9, 0.9, 1.0],
        ..material([0.0; 3], 0.0)
    }
}

fn material([red, green, blue]: [f32; 3], nits: f32) -> SceneMaterial {
    SceneMaterial {
        base_color: [red, green, blue, 1.0],
        emissive: [nits; 3],
        reflectance: 0.0,
        double_sided: true,
        ..SceneMaterial::default()
    }
}
