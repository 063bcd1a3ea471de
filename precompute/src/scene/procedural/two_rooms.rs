//! Two closed rooms with a wall 0.2 m thick between them and no opening: any light in the dark one
//! has leaked.

use crate::scene::builder::{Faces, MeshBuilder};
use crate::scene::{SceneGeometry, SceneMaterial};
use glam::Vec3;

pub(super) fn build() -> SceneGeometry {
    let mut builder = MeshBuilder::new();
    builder.tint([0.7, 0.7, 0.68]);
    // The shell has outer faces too, so that the walls are solids as in real levels.
    builder.cuboid(Vec3::new(-4.3, -0.2, -2.7), Vec3::new(4.3, 3.2, 2.7), Faces::ALL);
    builder.room(Vec3::new(-4.1, 0.0, -2.5), Vec3::new(-0.1, 3.0, 2.5));
    builder.room(Vec3::new(0.1, 0.0, -2.5), Vec3::new(4.1, 3.0, 2.5));
    let furniture = Faces::ALL.without(Faces::BOTTOM);
    // The same objects in both, mirrored: the rooms differ only in light.
    for side in [-1.0, 1.0] {
        let mut between = |tint, from: Vec3, to: Vec3| {
            let (a, b) = (from * Vec3::new(side, 1.0, 1.0), to * Vec3::new(side, 1.0, 1.0));
            builder.tint(tint).cuboid(a.min(b), a.max(b), furniture);
        };
        between([0.65, 0.12, 0.08], Vec3::new(3.2, 0.0, -2.2), Vec3::new(3.9, 1.8, -0.8));
        between([0.1, 0.25, 0.6], Vec3::new(0.5, 0.0, -2.3), Vec3::new(1.5, 0.7, -1.6));
        between([0.75, 0.6, 0.2], Vec3::new(1.6, 0.0, 1.2), Vec3::new(2.3, 0.5, 1.9));
    }
    SceneGeometry {
        meshes: vec![builder.finish(0)],
        materials: vec![SceneMaterial { reflectance: 0.2, ..SceneMaterial::default() }],
        ..SceneGeometry::default()
    }
}
