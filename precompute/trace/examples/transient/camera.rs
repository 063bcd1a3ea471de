//! A time-of-flight camera before a corner, and the same corner in slow motion.

use std::path::Path;

use frugal_trace::integrator::{Pixels, ReferenceScene, Settings, View, Watch};
use frugal_trace::light::{Light, Sky};
use frugal_trace::metrics::Picture;
use frugal_trace::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial, SceneMesh};
use frugal_trace::time::{
    Capture, SPEED_OF_LIGHT, Spread, Window, capture, frames, without_bounce,
};
use glam::{DVec2, UVec2, Vec3};

const SIZE: UVec2 = UVec2::new(64, 48);

/// Two walls and a floor that meet 3 m before the eye, and a box; a lamp at the eye, 1 candela.
pub(crate) fn corner(albedo: f32) -> ReferenceScene {
    // The walls' edge is at (0, −3); they run 45° to both sides.
    let quads = [
        [[-3.0, -1.0, 0.0], [0.0, -1.0, -3.0], [0.0, 2.0, -3.0], [-3.0, 2.0, 0.0]],
        [[0.0, -1.0, -3.0], [3.0, -1.0, 0.0], [3.0, 2.0, 0.0], [0.0, 2.0, -3.0]],
        [[-3.0, -1.0, 0.0], [3.0, -1.0, 0.0], [3.0, -1.0, -3.0], [-3.0, -1.0, -3.0]],
        [[-0.2, -1.0, -1.8], [0.4, -1.0, -1.8], [0.4, -0.4, -1.8], [-0.2, -0.4, -1.8]],
        [[-0.2, -0.4, -1.8], [0.4, -0.4, -1.8], [0.4, -0.4, -2.2], [-0.2, -0.4, -2.2]],
    ];
    lit(&quads, albedo)
}

/// The same in a closed room: light also comes from behind the eye.
fn room(albedo: f32) -> ReferenceScene {
    let wall = |x: f32, z: f32, to_x: f32, to_z: f32| {
        [[x, -1.0, z], [to_x, -1.0, to_z], [to_x, 2.0, to_z], [x, 2.0, z]]
    };
    let level = |y: f32| [[-3.0, y, 2.0], [3.0, y, 2.0], [3.0, y, -3.0], [-3.0, y, -3.0]];
    let quads = [
        wall(-3.0, 2.0, -3.0, -3.0),
        wall(-3.0, -3.0, 3.0, -3.0),
        wall(3.0, -3.0, 3.0, 2.0),
        wall(3.0, 2.0, -3.0, 2.0),
        level(-1.0),
        level(2.0),
        wall(-0.2, -1.8, 0.4, -1.8),
    ];
    lit(&quads, albedo)
}

/// Quads of one albedo, and a point light at the eye, 1 candela.
fn lit(quads: &[[[f32; 3]; 4]], albedo: f32) -> ReferenceScene {
    let mut mesh = SceneMesh::default();
    for quad in quads {
        let corners = quad.map(Vec3::from);
        let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]).normalize();
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.normals.extend([normal; 4]);
        mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }
    let material = SceneMaterial {
        base_color: [albedo, albedo, albedo, 1.0],
        reflectance: 0.0,
        double_sided: true,
        ..SceneMaterial::default()
    };
    let geometry =
        SceneGeometry { meshes: vec![mesh], materials: vec![material], ..SceneGeometry::default() };
    let luminous_power = 4.0 * std::f32::consts::PI;
    let (position, color, range) = (Vec3::ZERO, [1.0; 3], 1e6);
    let lamp = Light::Point { position, luminous_power, range, color };
    let rays = RayScene::from_geometry(&geometry);
    ReferenceScene::new(geometry.into(), rays.into(), &[lamp], Sky::Black).expect("valid geometry")
}

pub(crate) fn view() -> View {
    View {
        pose: CameraPose::looking_at(Vec3::ZERO, Vec3::new(0.0, -0.25, -1.0)),
        vertical_fov_degrees: 60.0,
        near: 0.01,
        size: SIZE,
    }
}

fn settings(seed: u64, samples: u32) -> Settings {
    Settings { samples, bounces: Some(8), seed, pixels: Pixels::Middle, ..Settings::default() }
}

/// Modulations, hertz: depths of each unwrap those of the next.
const FREQUENCIES: [f64; 3] = [20e6, 60e6, 100e6];

/// Absolute errors of depth, metres, sorted: at the first frequency as measured and corrected, and the
/// same at the last one.
fn sorted_errors(scene: &ReferenceScene, seed: u64) -> [Vec<f64>; 4] {
    let mut coarse = None;
    let captures = FREQUENCIES.map(|frequency| {
        let settings = settings(seed, 128);
        let mut one =
            capture(scene, &view(), &settings, frequency, Watch::default()).expect("a frequency");
        if let Some(coarse) = coarse.take() {
            one = one.unwrapped(coarse).expect("a depth for each pixel");
        }
        coarse = Some(one.depths(one.all()));
        one
    });
    let errors = |capture: &Capture, phasors: &[DVec2]| {
        let depths = capture.depths(phasors).into_iter().zip(capture.distances());
        let mut errors: Vec<f64> = depths.filter_map(|(a, b)| Some((a? - (*b)?).abs())).collect();
        errors.sort_by(f64::total_cmp);
        errors
    };
    let [first, _, last] = &captures;
    let corrected = |one: &Capture| without_bounce(one, 1.0, 3).expect("an intensity");
    [
        errors(first, first.all()),
        errors(first, &corrected(first)),
        errors(last, last.all()),
        errors(last, &corrected(last)),
    ]
}

pub(crate) fn errors(seed: u64) -> Vec<(&'static str, f64)> {
    let cases = [
        ("corner, albedo 0.3: 20 MHz, median", corner(0.3)),
        ("corner, albedo 0.6: 20 MHz, median", corner(0.6)),
        ("corner, albedo 0.8: 20 MHz, median", corner(0.8)),
        ("closed room, albedo 0.3: 20 MHz, median", room(0.3)),
        ("closed room, albedo 0.6: 20 MHz, median", room(0.6)),
    ];
    let mut rows = Vec::new();
    for (name, scene) in cases {
        let names = [name, "  corrected", "  20, 60 and 100 MHz", "  corrected"];
        for (name, errors) in names.into_iter().zip(sorted_errors(&scene, seed)) {
            let at = |share: f64| 100.0 * errors[((errors.len() - 1) as f64 * share) as usize];
            rows.extend([(name, at(0.5)), ("    90th percentile", at(0.9))]);
        }
    }
    rows
}

/// Frames of the corner as layers, as an animation and side by side; and its errors of depth.
pub(crate) fn pictures(folder: &Path) {
    let (start, end) = (3.0 / SPEED_OF_LIGHT, 9.0 / SPEED_OF_LIGHT);
    let window = Window { start, end, frames: 24, at_surfaces: false };
    let settings = Settings { pixels: Pixels::Area, ..settings(0, 512) };
    let spread = Spread::Kernel(0.3 / SPEED_OF_LIGHT);
    let (_, film) = frames(&corner(0.6), &view(), &settings, window, spread, Watch::default())
        .expect("a window");
    let mut values: Vec<f32> = film.values.iter().map(|rgb| rgb[1]).collect();
    values.sort_by(f32::total_cmp);
    let white = values[values.len() * 98 / 100];
    let write = |name: &str, bytes: Vec<u8>| {
        std::fs::write(folder.join(name), bytes).expect("a folder that can be written to");
    };
    write("transient.exr", film.to_exr().expect("layers"));
    write("transient.png", film.to_animation(white, 8).expect("frames"));
    let pictures = film.to_pictures(white);
    let sheet = Picture::from_fn(6 * SIZE.x, 4 * SIZE.y, |x, y| {
        let frame = (y / SIZE.y) * 6 + x / SIZE.x;
        pictures[frame as usize].rgb[((y % SIZE.y) * SIZE.x + x % SIZE.x) as usize]
    });
    write("frames.png", sheet.to_png().expect("a picture"));
    let capture = capture(&corner(0.6), &view(), &self::settings(0, 256), 20e6, Watch::default())
        .expect("a frequency");
    let corrected = without_bounce(&capture, 1.0, 3).expect("an intensity");
    // Red is too far, blue too near; full colour is 30 cm.
    let errors = [capture.all(), &corrected].map(|phasors| capture.depths(phasors));
    let picture = Picture::from_fn(2 * SIZE.x, SIZE.y, |x, y| {
        let pixel = (y * SIZE.x + x % SIZE.x) as usize;
        let found = errors[(x / SIZE.x) as usize][pixel].zip(capture.distances()[pixel]);
        let error = found.map_or(0.0, |(own, exact)| (own - exact) / 0.3).clamp(-1.0, 1.0);
        let other = (255.0 * (1.0 - error.abs())) as u8;
        if error > 0.0 { [255, other, other] } else { [other, other, 255] }
    });
    write("depth_errors.png", picture.to_png().expect("a picture"));
}
