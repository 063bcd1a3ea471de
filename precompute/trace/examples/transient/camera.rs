//! A time-of-flight camera before a corner, and the same corner in slow motion.

use std::path::Path;

use frugal_trace::integrator::{Pixels, ReferenceScene, Settings, View, Watch};
use frugal_trace::light::{Light, Sky};
use frugal_trace::metrics::Picture;
use frugal_trace::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial, SceneMesh};
use frugal_trace::time::{SPEED_OF_LIGHT, Spread, Window, capture, frames, without_bounce};
use glam::{DVec2, UVec2, Vec3};

const SIZE: UVec2 = UVec2::new(64, 48);

/// Two walls and a floor that meet 3 m before the eye, and a box; a lamp at the eye, 1 candela.
pub(crate) fn corner(albedo: f32) -> ReferenceScene {
    let mut mesh = SceneMesh::default();
    let mut quad = |corners: [[f32; 3]; 4]| {
        let corners = corners.map(Vec3::from);
        let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]).normalize();
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.normals.extend([normal; 4]);
        mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    };
    // The walls' edge is at (0, −3); they run 45° to both sides.
    quad([[-3.0, -1.0, 0.0], [0.0, -1.0, -3.0], [0.0, 2.0, -3.0], [-3.0, 2.0, 0.0]]);
    quad([[0.0, -1.0, -3.0], [3.0, -1.0, 0.0], [3.0, 2.0, 0.0], [0.0, 2.0, -3.0]]);
    quad([[-3.0, -1.0, 0.0], [3.0, -1.0, 0.0], [3.0, -1.0, -3.0], [-3.0, -1.0, -3.0]]);
    quad([[-0.2, -1.0, -1.8], [0.4, -1.0, -1.8], [0.4, -0.4, -1.8], [-0.2, -0.4, -1.8]]);
    quad([[-0.2, -0.4, -1.8], [0.4, -0.4, -1.8], [0.4, -0.4, -2.2], [-0.2, -0.4, -2.2]]);
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

/// Absolute errors of depth, metres, sorted: of all light, corrected, and of direct light.
fn sorted_errors(albedo: f32, seed: u64) -> [Vec<f64>; 3] {
    let capture = capture(&corner(albedo), &view(), &settings(seed, 128), 20e6, Watch::default())
        .expect("a frequency");
    let corrected = without_bounce(&capture, 1.0, 3).expect("an intensity");
    let errors = |phasors: &[DVec2]| {
        let depths = capture.depths(phasors).into_iter().zip(capture.distances());
        let mut errors: Vec<f64> = depths.filter_map(|(a, b)| Some((a? - (*b)?).abs())).collect();
        errors.sort_by(f64::total_cmp);
        errors
    };
    [errors(capture.all()), errors(&corrected), errors(capture.direct())]
}

pub(crate) fn errors(seed: u64) -> Vec<(&'static str, f64)> {
    let mut rows = Vec::new();
    for (albedo, names) in [
        (
            0.3,
            [
                "albedo 0.3, all light, median",
                "  90th percentile",
                "  corrected, median",
                "  90th percentile",
                "  direct light only, greatest",
            ],
        ),
        (
            0.6,
            [
                "albedo 0.6, all light, median",
                "  90th percentile",
                "  corrected, median",
                "  90th percentile",
                "  direct light only, greatest",
            ],
        ),
        (
            0.8,
            [
                "albedo 0.8, all light, median",
                "  90th percentile",
                "  corrected, median",
                "  90th percentile",
                "  direct light only, greatest",
            ],
        ),
    ] {
        let [all, corrected, direct] = sorted_errors(albedo, seed);
        let at = |errors: &[f64], share: f64| {
            100.0 * errors[((errors.len() - 1) as f64 * share) as usize]
        };
        let values = [
            at(&all, 0.5),
            at(&all, 0.9),
            at(&corrected, 0.5),
            at(&corrected, 0.9),
            at(&direct, 1.0),
        ];
        rows.extend(names.into_iter().zip(values));
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
