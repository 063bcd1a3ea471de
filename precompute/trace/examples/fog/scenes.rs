//! Dark rooms with bright panels, whose light has a closed form but for an integral over panels.

use std::f64::consts::PI;

use frugal_trace::integrator::{ReferenceScene, View, surfaces};
use frugal_trace::light::Sky;
use frugal_trace::media::Fog;
use frugal_trace::scene::{Bounds, CameraPose, RayScene, SceneGeometry, SceneMaterial, SceneMesh};
use glam::{DVec3, UVec2, Vec3};
use rayon::prelude::*;

/// Points along each side of a panel, and metres of a step, of the exact image: with twice and half
/// as much it changes by 0.2 %.
const POINTS: u32 = 50;
const STEP: f64 = 0.05;

/// A rectangle along the axes: half its size is 0 across it.
#[derive(Clone, Copy)]
struct Sheet {
    middle: DVec3,
    half: DVec3,
    /// Radiance, nits.
    nits: f32,
}

/// A closed room, seen from within.
pub(crate) struct Place {
    /// What is in it.
    pub(crate) name: &'static str,
    /// Panels and occluders.
    sheets: Vec<Sheet>,
    /// What is rendered.
    pub(crate) scene: ReferenceScene,
    /// Length relative to a cube of 4 m, by volume.
    pub(crate) size: f64,
    pose: CameraPose,
    /// 1/m.
    extinction: f64,
    scattering: f64,
}

/// All rooms; no panel is in view.
pub(crate) fn all() -> Vec<Place> {
    let sheet = |nits, middle: [f64; 3], half: [f64; 3]| Sheet {
        middle: middle.into(),
        half: half.into(),
        nits,
    };
    vec![
        Place::new(
            "a panel and a plate",
            [2.0; 3],
            vec![
                sheet(100.0, [0.0, 1.9, 0.0], [0.8, 0.0, 0.8]),
                sheet(0.0, [0.3, 0.9, 0.0], [0.5, 0.0, 0.5]),
            ],
            [0.05, 0.2],
            [[0.0, -0.6, 1.9], [0.0, -0.6, -2.0]],
        ),
        Place::new(
            "a hall with a screen",
            [6.0, 2.5, 5.0],
            vec![
                sheet(400.0, [-5.9, 0.5, 0.0], [0.0, 1.0, 0.6]),
                sheet(0.0, [-1.0, -0.5, -0.3], [0.0, 2.0, 1.2]),
            ],
            [0.02, 0.06],
            [[-2.0, 0.5, 4.9], [1.0, -0.2, -3.0]],
        ),
        Place::new(
            "three panels",
            [1.5, 1.2, 1.5],
            vec![
                sheet(200.0, [0.4, 1.15, 0.9], [0.15, 0.0, 0.15]),
                sheet(60.0, [-1.45, 0.2, 0.9], [0.0, 0.4, 0.3]),
                sheet(30.0, [0.5, 0.2, 1.45], [0.6, 0.3, 0.0]),
                sheet(0.0, [0.2, 0.5, 0.3], [0.25, 0.0, 0.25]),
                sheet(0.0, [-0.6, -0.2, 0.0], [0.0, 0.5, 0.2]),
            ],
            [0.1, 0.5],
            [[0.0, -0.2, 1.3], [0.1, -0.2, -1.5]],
        ),
    ]
}

impl Place {
    /// A room from −`half` to `half`, metres; fog's absorption and scattering, 1/m; and from where to
    /// where the camera looks.
    fn new(
        name: &'static str,
        half: [f64; 3],
        sheets: Vec<Sheet>,
        [absorption, scattering]: [f32; 2],
        [from, to]: [[f32; 3]; 2],
    ) -> Self {
        let half = DVec3::from_array(half);
        let walls = DVec3::AXES.into_iter().flat_map(|axis| {
            [half * axis, -half * axis].map(|middle| Sheet {
                middle,
                half: half * (DVec3::ONE - axis),
                nits: 0.0,
            })
        });
        let mut geometry = SceneGeometry::default();
        for sheet in walls.chain(sheets.iter().copied()) {
            geometry.meshes.push(sheet.mesh(geometry.materials.len()));
            geometry.materials.push(SceneMaterial {
                base_color: [0.0, 0.0, 0.0, 1.0],
                emissive: [sheet.nits; 3],
                reflectance: 0.0,
                double_sided: true,
                ..SceneMaterial::default()
            });
        }
        let rays = RayScene::from_geometry(&geometry);
        let fog = Fog {
            absorption: [absorption; 3],
            scattering: [scattering; 3],
            asymmetry: 0.0,
            bounds: Bounds { min: -half.as_vec3(), max: half.as_vec3() },
        };
        let scene = ReferenceScene::new(geometry.into(), rays.into(), &[], Sky::Black)
            .expect("valid geometry")
            .with_fog(fog)
            .expect("valid fog");
        Self {
            name,
            sheets,
            scene,
            size: half.element_product().cbrt() / 2.0,
            pose: CameraPose::looking_at(Vec3::from(from), Vec3::from(to)),
            extinction: f64::from(absorption) + f64::from(scattering),
            scattering: f64::from(scattering),
        }
    }

    /// A view of 48 × 36 pixels times `scale`.
    pub(crate) fn view(&self, scale: u32) -> View {
        let size = UVec2::new(48, 36) * scale;
        View { pose: self.pose, vertical_fov_degrees: 60.0, near: 0.01, size }
    }

    /// The exact image of the least view, nits.
    pub(crate) fn exact(&self) -> Vec<f64> {
        let view = self.view(1);
        let (eye, ahead) =
            (view.pose.position.as_dvec3(), view.pose.rotation.as_dquat() * DVec3::NEG_Z);
        let pixels: Vec<_> = view.rays().into_iter().zip(surfaces(&self.scene, &view)).collect();
        pixels
            .into_par_iter()
            .map(|(ray, hit)| {
                let near = f64::from(view.near) / ray.dot(ahead);
                let reach = hit.expect("a closed room").position.distance(eye) - near;
                let count = (reach / STEP).ceil();
                let light = |i: u32| {
                    let distance = reach * (f64::from(i) + 0.5) / count;
                    let light = self.light(eye + ray * (near + distance));
                    light * (-self.extinction * distance).exp()
                };
                (0..count as u32).map(light).sum::<f64>() * self.scattering * reach / count
            })
            .collect()
    }

    /// Mean radiance over all directions at a point, nits.
    fn light(&self, point: DVec3) -> f64 {
        let panels = self.sheets.iter().enumerate().filter(|(_, sheet)| sheet.nits > 0.0);
        panels.map(|(index, panel)| self.panel(point, index, panel)).sum::<f64>() / (4.0 * PI)
    }

    fn panel(&self, point: DVec3, index: usize, panel: &Sheet) -> f64 {
        let [right, up] = panel.axes();
        let normal = right.cross(up).normalize();
        let place = |i: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(POINTS) - 1.0;
        let mut sum = 0.0;
        for (i, j) in (0..POINTS).flat_map(|i| (0..POINTS).map(move |j| (i, j))) {
            let ray = panel.middle + right * place(i) + up * place(j) - point;
            let others = self.sheets.iter().enumerate().filter(|(other, _)| *other != index);
            if others.into_iter().any(|(_, other)| other.is_between(point, ray)) {
                continue;
            }
            let squared = ray.length_squared();
            let distance = squared.sqrt();
            let cosine = ray.dot(normal).abs() / distance;
            sum += cosine / squared * (-self.extinction * distance).exp();
        }
        let area = 4.0 * right.length() * up.length();
        f64::from(panel.nits) * sum * area / f64::from(POINTS * POINTS)
    }
}

impl Sheet {
    /// Half its sides.
    fn axes(&self) -> [DVec3; 2] {
        let [x, y, z] = DVec3::AXES.map(|axis| self.half * axis);
        if self.half.x == 0.0 {
            [y, z]
        } else if self.half.y == 0.0 {
            [z, x]
        } else {
            [x, y]
        }
    }

    /// Whether it is between the ends of `ray`, which starts at `point`.
    fn is_between(&self, point: DVec3, ray: DVec3) -> bool {
        let [right, up] = self.axes();
        let normal = right.cross(up);
        let share = (self.middle - point).dot(normal) / ray.dot(normal);
        let offset = point + ray * share - self.middle;
        let is_inside = |side: DVec3| offset.dot(side).abs() < side.length_squared();
        share > 0.0 && share < 1.0 && is_inside(right) && is_inside(up)
    }

    fn mesh(&self, material: usize) -> SceneMesh {
        let [right, up] = self.axes();
        let corners = [-right - up, right - up, right + up, up - right];
        let positions = corners.map(|corner| (self.middle + corner).as_vec3()).to_vec();
        let normal = right.cross(up).normalize().as_vec3();
        let indices = vec![0, 1, 2, 0, 2, 3];
        SceneMesh { positions, normals: vec![normal; 4], indices, material, ..Default::default() }
    }
}
