//! Scenes with closed-form light, and invariants of any scene, on the shipped path tracer.

mod energy;
mod extended;
mod guiding;
mod robustness;
mod sampling;
mod textures;
mod visibility;

use glam::{DVec3, Quat, UVec2, Vec3};

use super::path::{self, Estimate};
use super::*;
use crate::bsdf::Shading;
use crate::guide::Field;
use crate::light::{Light, Sky};
use crate::sampler::Sampler;
use crate::scene::testing::MeshBuilder;
use crate::scene::{
    CameraPose, Filter, GeometryError, RayScene, SceneGeometry, SceneMaterial, SceneTexture,
    Texels, Wrap,
};

/// A path that nothing listens to.
pub(super) fn trace(
    scene: &ReferenceScene,
    settings: &Settings,
    field: Option<&Field>,
    origin: Vec3,
    direction: DVec3,
    sampler: &mut Sampler,
) -> Estimate {
    path::trace(scene, settings, field, origin, direction, sampler, &mut ())
}

/// Geometry of one material, built by `build`.
fn geometry(material: SceneMaterial, build: impl FnOnce(&mut MeshBuilder)) -> SceneGeometry {
    let mut builder = MeshBuilder::new();
    build(&mut builder);
    SceneGeometry {
        meshes: vec![builder.finish(0)],
        materials: vec![material],
        ..SceneGeometry::default()
    }
}

/// Both geometries in one; neither may have textures.
fn joined(mut first: SceneGeometry, second: SceneGeometry) -> SceneGeometry {
    for mut mesh in second.meshes {
        mesh.material += first.materials.len();
        first.meshes.push(mesh);
    }
    first.materials.extend(second.materials);
    first
}

pub(super) fn scene(geometry: SceneGeometry, lights: &[Light], sky: Sky) -> ReferenceScene {
    try_scene(geometry, lights, sky).expect("valid geometry")
}

fn try_scene(
    geometry: SceneGeometry,
    lights: &[Light],
    sky: Sky,
) -> Result<ReferenceScene, GeometryError> {
    let rays = RayScene::from_geometry(&geometry);
    ReferenceScene::new(geometry.into(), rays.into(), lights, sky)
}

fn diffuse() -> SceneMaterial {
    SceneMaterial { reflectance: 0.0, ..SceneMaterial::default() }
}

fn emissive(nits: f32) -> SceneMaterial {
    SceneMaterial { base_color: [0.0, 0.0, 0.0, 1.0], emissive: [nits; 3], ..diffuse() }
}

/// An 8-bit texture of one row, which repeats; hard edges.
fn row_texture(texels: &[[u8; 4]]) -> SceneTexture {
    SceneTexture {
        width: texels.len() as u32,
        height: 1,
        texels: Texels::Linear(texels.to_vec()),
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Nearest,
    }
}

fn lambertian(bounces: Option<u32>) -> Settings {
    Settings { samples: 1, bounces, shading: Shading::Lambertian, ..Settings::default() }
}

fn sun(direction: Vec3, illuminance: f32) -> Light {
    Light::Directional { direction, illuminance, color: [1.0; 3] }
}

pub(super) fn point_light(position: Vec3, luminous_power: f32) -> Light {
    Light::Point { position, luminous_power, range: 1e6, color: [1.0; 3] }
}

/// A square of side 2 × `half` in the plane y = `height` around the axis; faces up or down.
fn square(builder: &mut MeshBuilder, half: f32, height: f32, faces_up: bool) {
    let corner = |x: f32, z: f32| Vec3::new(x * half, height, z * half);
    let [a, b, c, d] = [corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)];
    builder.quad(if faces_up { [a, b, c, d] } else { [d, c, b, a] });
}

/// A mean of independent estimates, and its standard error.
#[derive(Clone, Copy, Debug)]
struct Measured {
    mean: f64,
    error: f64,
}

impl Measured {
    fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        let count = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / count;
        let variance = values.map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        Self { mean, error: (variance / count).sqrt() }
    }

    /// Within four standard errors of `exact`, and of `bias`, the share by which the scene differs
    /// from the one with the closed form.
    #[track_caller]
    fn assert(&self, exact: f64, bias: f64) {
        let tolerance = 4.0 * self.error + (bias + 1e-6) * exact.abs();
        assert!((self.mean - exact).abs() <= tolerance, "{self:?} is not {exact} ± {tolerance}");
    }

    /// The same mean within four standard errors of the difference.
    #[track_caller]
    fn assert_agrees(&self, other: &Self) {
        let tolerance = 4.0 * self.error.hypot(other.error);
        assert!((self.mean - other.mean).abs() <= tolerance, "{self:?} against {other:?}");
    }
}

/// Estimates along `count` camera rays, which `ray` makes from two random numbers, each with its
/// own sampler.
fn estimates(
    scene: &ReferenceScene,
    settings: &Settings,
    count: u64,
    ray: impl Fn([f64; 2]) -> (DVec3, DVec3),
) -> Vec<Estimate> {
    let one = |i| {
        // Sample 0 of a pixel of its own: independent of all others.
        let mut sampler = Sampler::new(settings.seed, i, 0);
        let (origin, direction) = ray(sampler.pair());
        trace(scene, settings, None, origin.as_vec3(), direction.normalize(), &mut sampler)
    };
    (0..count).map(one).collect()
}

/// Direct and indirect light of the red channel.
fn measure(
    scene: &ReferenceScene,
    settings: &Settings,
    count: u64,
    ray: impl Fn([f64; 2]) -> (DVec3, DVec3),
) -> (Measured, Measured) {
    let found = estimates(scene, settings, count, ray);
    (
        Measured::of(found.iter().map(|one| one.direct.x)),
        Measured::of(found.iter().map(|one| one.indirect.x)),
    )
}

/// A ray straight down on the point (x, z) from `height`.
fn down(x: f64, height: f64, z: f64) -> impl Fn([f64; 2]) -> (DVec3, DVec3) {
    move |_| (DVec3::new(x, height, z), DVec3::NEG_Y)
}

fn view(position: Vec3, target: Vec3, width: u32, height: u32) -> View {
    View {
        pose: CameraPose::looking_at(position, target),
        vertical_fov_degrees: 60.0,
        near: 0.01,
        size: UVec2::new(width, height),
    }
}

fn picture(scene: &ReferenceScene, view: &View, settings: &Settings) -> Rendering {
    render(scene, view, settings, Watch::default()).expect("nothing interrupts")
}

#[test]
fn the_image_is_upright_and_the_pixel_filter_is_a_box() {
    // The upper left quarter of the image is emissive; the camera looks along −Z.
    let quarter = geometry(emissive(8.0), |builder| {
        builder.quad([
            Vec3::new(-9.0, 0.0, -1.0),
            Vec3::new(0.0, 0.0, -1.0),
            Vec3::new(0.0, 9.0, -1.0),
            Vec3::new(-9.0, 9.0, -1.0),
        ]);
    });
    let scene = scene(quarter, &[], Sky::Black);
    let settings = Settings { samples: 256, ..lambertian(Some(0)) };
    let view = View {
        pose: CameraPose { position: Vec3::ZERO, rotation: Quat::IDENTITY },
        ..view(Vec3::ZERO, Vec3::NEG_Z, 5, 3)
    };
    let rendering = picture(&scene, &view, &settings);
    let expected = [8, 8, 4, 0, 0, 4, 4, 2, 0, 0, 0, 0, 0, 0, 0].map(|value| [value as f32; 3]);
    assert_eq!(
        rendering.direct.rgb, expected,
        "256 stratified samples give a half and a quarter exactly"
    );
    assert_eq!((rendering.direct.width, rendering.direct.height, rendering.dropped), (5, 3, 0));
    assert_eq!(rendering.full(), rendering.direct);
    // Moved a little up and to the right, no pixel's middle lies on an edge: each is lit or not.
    let moved =
        View { pose: CameraPose { position: Vec3::new(0.1, 0.1, 0.0), ..view.pose }, ..view };
    let rendering =
        picture(&scene, &moved, &Settings { pixels: Pixels::Middle, samples: 4, ..settings });
    let expected = [8, 8, 0, 0, 0, 8, 8, 0, 0, 0, 0, 0, 0, 0, 0].map(|value| [value as f32; 3]);
    assert_eq!(rendering.direct.rgb, expected);
}
