//! The Cornell box at ten times its size: 5.528 m wide. Dimensions: Cornell University Program of
//! Computer Graphics, "Cornell Box Data" (graphics.cornell.edu/online/box/data.html). The light is
//! a spot light under the ceiling in place of the original's emissive square, so that the ceiling
//! receives indirect light alone; reflectances are RGB averages of its measured spectra.

use crate::scene::builder::MeshBuilder;
use crate::scene::{SceneGeometry, SceneMaterial};
use glam::Vec3;

const WHITE: [f32; 3] = [0.73, 0.71, 0.68];
const RED: [f32; 3] = [0.61, 0.06, 0.06];
const GREEN: [f32; 3] = [0.12, 0.46, 0.11];

/// From the published axes (centimetres here; x to the left of a viewer who looks along +z) to the
/// scene's: the centre of the floor is the origin, the open front faces +Z.
fn to_scene(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(2.764 - x / 100.0, y / 100.0, 2.796 - z / 100.0)
}

/// A block on the floor; the four corners of its top are counter-clockwise seen from above.
fn block(builder: &mut MeshBuilder, height: f32, top: [(f32, f32); 4]) {
    let at = |(x, z): (f32, f32), y: f32| to_scene(x, y, z);
    builder.quad(top.map(|corner| at(corner, height)));
    for i in 0..4 {
        let (a, b) = (top[i], top[(i + 1) % 4]);
        builder.quad([at(a, 0.0), at(b, 0.0), at(b, height), at(a, height)]);
    }
}

pub(super) fn build() -> SceneGeometry {
    let mut builder = MeshBuilder::new();
    let (width, height, depth) = (552.8, 548.8, 559.2);
    builder.tint(WHITE);
    builder.quad([
        to_scene(width, 0.0, 0.0),
        to_scene(0.0, 0.0, 0.0),
        to_scene(0.0, 0.0, depth),
        to_scene(width, 0.0, depth),
    ]);
    builder.quad([
        to_scene(width, height, depth),
        to_scene(0.0, height, depth),
        to_scene(0.0, height, 0.0),
        to_scene(width, height, 0.0),
    ]);
    builder.quad([
        to_scene(width, 0.0, depth),
        to_scene(0.0, 0.0, depth),
        to_scene(0.0, height, depth),
        to_scene(width, height, depth),
    ]);
    builder.tint(RED);
    builder.quad([
        to_scene(width, 0.0, 0.0),
        to_scene(width, 0.0, depth),
        to_scene(width, height, depth),
        to_scene(width, height, 0.0),
    ]);
    builder.tint(GREEN);
    builder.quad([
        to_scene(0.0, 0.0, depth),
        to_scene(0.0, 0.0, 0.0),
        to_scene(0.0, height, 0.0),
        to_scene(0.0, height, depth),
    ]);
    builder.tint(WHITE);
    block(&mut builder, 165.0, [(290.0, 114.0), (130.0, 65.0), (82.0, 225.0), (240.0, 272.0)]);
    block(&mut builder, 330.0, [(423.0, 247.0), (265.0, 296.0), (314.0, 456.0), (472.0, 406.0)]);
    SceneGeometry {
        meshes: vec![builder.finish(0)],
        materials: vec![SceneMaterial { reflectance: 0.0, ..SceneMaterial::default() }],
        ..SceneGeometry::default()
    }
}
