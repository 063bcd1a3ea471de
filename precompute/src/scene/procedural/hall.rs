//! Sixteen rooms in a hall, with doorways between them, for dozens of lights: each illuminates its own
//! room, and only what comes through the doorways illuminates others.

use crate::scene::builder::{Faces, MeshBuilder};
use crate::scene::{SceneGeometry, SceneMaterial};
use glam::{Vec2, Vec3};

/// Half the side of the square hall; the side of a room; its height. Metres.
const HALF: f32 = 16.0;
const ROOM: f32 = 8.0;
const HEIGHT: f32 = 3.2;
/// Half the thickness of the walls between rooms, half the width of a doorway, and its height.
const HALF_WALL: f32 = 0.1;
const HALF_DOOR: f32 = 1.0;
const DOOR_HEIGHT: f32 = 2.4;

pub(super) fn build() -> SceneGeometry {
    let mut builder = MeshBuilder::new();
    builder.tint([0.7, 0.69, 0.66]);
    let (low, high) = (Vec3::new(-HALF, 0.0, -HALF), Vec3::new(HALF, HEIGHT, HALF));
    builder.cuboid(low - 0.2, high + 0.2, Faces::ALL);
    builder.room(low, high);
    for line in [-ROOM, 0.0, ROOM] {
        for room in 0..4 {
            let middle = (room as f32 - 1.5) * ROOM;
            for turned in [false, true] {
                doorway(&mut builder, line, middle, turned);
            }
        }
    }
    for room in 0..16 {
        let corner = Vec2::new((room % 4) as f32 - 2.0, (room / 4) as f32 - 2.0) * ROOM;
        furnish(&mut builder, room, Vec3::new(corner.x, 0.0, corner.y));
    }
    SceneGeometry {
        meshes: vec![builder.finish(0)],
        materials: vec![SceneMaterial { reflectance: 0.2, ..SceneMaterial::default() }],
        ..SceneGeometry::default()
    }
}

/// A room's wall with a doorway in its middle, at x = `line`; at z = `line` if turned.
fn doorway(builder: &mut MeshBuilder, line: f32, middle: f32, turned: bool) {
    let at = |along: f32, y: f32, across: f32| match turned {
        false => Vec3::new(line + across, y, middle + along),
        true => Vec3::new(middle + along, y, line + across),
    };
    // Walls end short of those that cross them: faces must not coincide.
    let end = 0.5 * ROOM - HALF_WALL;
    for (from, to, low) in
        [(-end, -HALF_DOOR, 0.0), (-HALF_DOOR, HALF_DOOR, DOOR_HEIGHT), (HALF_DOOR, end, 0.0)]
    {
        let (a, b) = (at(from, low, -HALF_WALL), at(to, HEIGHT, HALF_WALL));
        builder.cuboid(a.min(b), a.max(b), Faces::ALL);
    }
}

/// A column, a chest and a carpet, of the room's own colours.
fn furnish(builder: &mut MeshBuilder, room: usize, corner: Vec3) {
    const COLORS: [[f32; 3]; 5] =
        [[0.65, 0.12, 0.08], [0.1, 0.25, 0.6], [0.75, 0.6, 0.2], [0.15, 0.5, 0.2], [0.6, 0.6, 0.6]];
    let furniture = Faces::ALL.without(Faces::BOTTOM);
    let mut put = |color: usize, from: [f32; 3], to: [f32; 3]| {
        builder.tint(COLORS[color % COLORS.len()]);
        builder.cuboid(corner + Vec3::from(from), corner + Vec3::from(to), furniture);
    };
    put(4, [1.2, 0.0, 1.2], [1.7, HEIGHT - 0.01, 1.7]);
    put(room, [5.8, 0.0, 1.0], [7.2, 0.9, 1.8]);
    put(room + 2, [2.4, 0.0, 5.2], [5.6, 0.02, 7.4]);
}
