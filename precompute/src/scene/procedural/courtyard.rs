//! An arcade around an open court: hard sun, a shaded gallery behind coloured drapes that bleed
//! into it, a dim room behind a doorway with one latticed window. Thin bars, stairs, woven and
//! cut-out cloth and finely cut stone exercise antialiasing, shadow resolution and texture
//! filtering.

use super::pattern;
use crate::scene::builder::{ArchShape, Faces, MeshBuilder};
use crate::scene::{AlphaMode, SceneGeometry, SceneMaterial};
use glam::{Quat, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

const LIMESTONE: [f32; 3] = [0.83, 0.73, 0.58];
const PALE: [f32; 3] = [0.9, 0.86, 0.78];
const SLATE: [f32; 3] = [0.34, 0.38, 0.43];
const TERRACOTTA: [f32; 3] = [0.72, 0.36, 0.22];
const PLASTER: [f32; 3] = [0.88, 0.84, 0.76];
const IRON: [f32; 3] = [0.05, 0.05, 0.055];
const WOOD: [f32; 3] = [0.3, 0.16, 0.08];
const LEAF: [f32; 3] = [0.1, 0.24, 0.06];
const WATER: [f32; 3] = [0.04, 0.12, 0.14];
const CRIMSON: [f32; 3] = [0.8, 0.06, 0.07];
const SAFFRON: [f32; 3] = [0.95, 0.5, 0.06];
const TEAL: [f32; 3] = [0.04, 0.42, 0.42];
const INDIGO: [f32; 3] = [0.11, 0.12, 0.55];

/// Half the width of the arcade's square of columns, metres.
const ARCADE: f32 = 6.0;
/// Bays on each side of the arcade.
const BAYS: u32 = 5;
const BAY_WIDTH: f32 = 2.0 * ARCADE / BAYS as f32;
/// Position of the gallery's outer wall, and its thickness.
const WALL: f32 = 9.0;
const WALL_THICKNESS: f32 = 0.3;
/// Height of the gallery's ceiling, of its roof, and of the court below its floor.
const CEILING: f32 = 4.4;
const ROOF: f32 = 4.7;
const COURT: f32 = -0.32;
/// Height at which arches spring, on the columns' capitals.
const SPRING: f32 = 2.6;
const CUTOFF: f32 = 0.5;

pub(super) fn build() -> SceneGeometry {
    let (mut stone, mut cloth, mut plain) =
        (MeshBuilder::new(), MeshBuilder::new(), MeshBuilder::new());
    stone.texture_scale(2.0);
    floors(&mut stone);
    for side in 0..4 {
        arcade_side(&mut stone, &mut plain, quarter(side));
    }
    shell(&mut stone);
    room(&mut stone, &mut plain);
    fountain(&mut stone, &mut plain);
    for (x, z) in [(-3.7, -3.7), (3.7, -3.7), (-3.7, 3.7), (3.7, 3.7)] {
        tree(&mut stone, &mut plain, Vec3::new(x, COURT, z));
    }
    drapes(&mut cloth, &mut plain);
    let textures: Vec<_> =
        [pattern::stone(), pattern::cloth(CUTOFF)].into_iter().flatten().collect();
    let textured = |index: usize| Some(index).filter(|index| *index < textures.len());
    let materials = vec![
        SceneMaterial {
            perceptual_roughness: 0.85,
            reflectance: 0.35,
            base_color_texture: textured(0),
            ..SceneMaterial::default()
        },
        SceneMaterial {
            reflectance: 0.1,
            alpha: AlphaMode::Mask(CUTOFF),
            double_sided: true,
            base_color_texture: textured(1),
            ..SceneMaterial::default()
        },
        SceneMaterial { perceptual_roughness: 0.45, ..SceneMaterial::default() },
    ];
    SceneGeometry {
        meshes: vec![stone.finish(0), cloth.finish(1), plain.finish(2)],
        materials,
        textures,
        ..SceneGeometry::default()
    }
}

/// Rotation from the south side (+Z) to another.
fn quarter(side: u32) -> Quat {
    Quat::from_rotation_y(side as f32 * FRAC_PI_2)
}

fn floors(stone: &mut MeshBuilder) {
    // Chequered court.
    const TILES: i32 = 8;
    let half = ARCADE - 0.6;
    let size = 2.0 * half / TILES as f32;
    for row in 0..TILES {
        for column in 0..TILES {
            let (x, z) = (column as f32 * size - half, row as f32 * size - half);
            let rim = row == 0 || column == 0 || row == TILES - 1 || column == TILES - 1;
            let even = (row + column) % 2 == 0;
            stone.tint(if rim {
                PALE
            } else if even {
                TERRACOTTA
            } else {
                LIMESTONE
            });
            stone.texture_turn(if even { 0.0 } else { FRAC_PI_4 });
            flat(stone, Vec2::new(x, z), Vec2::splat(size), COURT);
        }
    }
    stone.texture_turn(0.0);
    for side in 0..4 {
        let turn = quarter(side);
        let at = |x: f32, y: f32, z: f32| turn * Vec3::new(x, y, z);
        stone.tint(PALE);
        // Two steps up to the gallery, mitred at the corners.
        for (inner, outer, low) in
            [(half, half + 0.3, COURT), (half + 0.3, half + 0.6, COURT * 0.5)]
        {
            let high = low - COURT * 0.5;
            stone.quad([
                at(inner, low, inner),
                at(-inner, low, inner),
                at(-inner, high, inner),
                at(inner, high, inner),
            ]);
            if high < 0.0 {
                stone.quad([
                    at(-inner, high, inner),
                    at(-outer, high, outer),
                    at(outer, high, outer),
                    at(inner, high, inner),
                ]);
            }
        }
        let edge = half + 0.3;
        stone.tint(TERRACOTTA).texture_turn(FRAC_PI_4);
        stone.quad([
            at(-edge, 0.0, edge),
            at(-WALL, 0.0, WALL),
            at(WALL, 0.0, WALL),
            at(edge, 0.0, edge),
        ]);
        stone.texture_turn(0.0);
        // The ground around, so that the view beyond the walls is not a hole.
        let far = 30.0;
        let outside = WALL + WALL_THICKNESS;
        stone.tint(LIMESTONE);
        stone.quad([
            at(-outside, -0.2, outside),
            at(-far, -0.2, far),
            at(far, -0.2, far),
            at(outside, -0.2, outside),
        ]);
    }
}

fn flat(builder: &mut MeshBuilder, corner: Vec2, size: Vec2, y: f32) {
    let at = |u: f32, v: f32| Vec3::new(corner.x + u * size.x, y, corner.y + v * size.y);
    builder.quad([at(0.0, 1.0), at(1.0, 1.0), at(1.0, 0.0), at(0.0, 0.0)]);
}

/// One side of the arcade, with its roof and rail: built on the south side (+Z) and rotated.
fn arcade_side(stone: &mut MeshBuilder, plain: &mut MeshBuilder, turn: Quat) {
    let shape = ArchShape {
        top: CEILING,
        spring: SPRING,
        radius: 0.94,
        jamb_foot: SPRING,
        thickness: 0.44,
        segments: 7,
        with_top: false,
    };
    let upright = Faces::ALL.without(Faces::BOTTOM);
    for bay in 0..BAYS {
        let x = bay as f32 * BAY_WIDTH - ARCADE;
        let foot = |x: f32| turn * Vec3::new(x, 0.0, ARCADE);
        stone.tint(if bay % 2 == 0 { LIMESTONE } else { PALE });
        stone.arch(foot(x), foot(x + BAY_WIDTH), shape);
        if bay == 0 {
            // Corner pier, up to the ceiling: it closes the ends of two walls. The other corner is
            // the next side's.
            stone.tint(LIMESTONE).turned_cuboid(
                foot(x) + Vec3::Y * (CEILING * 0.5),
                Vec3::new(0.3, CEILING * 0.5, 0.3),
                turn,
                upright,
            );
        } else {
            let base = foot(x);
            stone.tint(PALE).turned_cuboid(
                base + Vec3::Y * 0.09,
                Vec3::new(0.27, 0.09, 0.27),
                turn,
                upright,
            );
            stone.tint(LIMESTONE).lathe(base, &[(0.18, 0.2), (2.2, 0.165), (2.42, 0.27)], 8);
            stone.tint(PALE).turned_cuboid(
                base + Vec3::Y * 2.51,
                Vec3::new(0.28, 0.09, 0.28),
                turn,
                Faces::ALL,
            );
        }
    }
    // Roof slab, one end over the corner, with a narrow eave.
    let (inner, outer) = (ARCADE - 0.36, WALL + WALL_THICKNESS);
    let (center, half) = ((outer - inner) * 0.5 + inner, (outer - inner) * 0.5);
    let along = (outer + inner) * 0.5;
    let middle = Vec3::new((inner - outer) * 0.5, (CEILING + ROOF) * 0.5, center);
    stone.tint(PLASTER).turned_cuboid(
        turn * middle,
        Vec3::new(along, (ROOF - CEILING) * 0.5, half),
        turn,
        Faces::ALL,
    );
    // Rail.
    let open = Faces::ALL.without(Faces::BOTTOM).without(Faces::TOP);
    let rail = ARCADE - 0.2;
    plain.tint(IRON);
    const BARS: u32 = 18;
    for bar in 0..BARS {
        let x = (bar as f32 / BARS as f32 * 2.0 - 1.0) * rail;
        plain.turned_cuboid(
            turn * Vec3::new(x, ROOF + 0.4, rail),
            Vec3::new(0.018, 0.4, 0.018),
            turn,
            open,
        );
    }
    for (height, size) in [(0.82, 0.035), (0.12, 0.02)] {
        plain.turned_cuboid(
            turn * Vec3::new(0.0, ROOF + height, rail),
            Vec3::new(rail, size, size),
            turn,
            Faces::ALL,
        );
    }
}

/// The gallery's outer walls; the one to the north (−Z) has the doorway.
fn shell(stone: &mut MeshBuilder) {
    let outer = WALL + WALL_THICKNESS;
    let foot = -0.2;
    let mut wall = |min: Vec3, max: Vec3| stone.tint(PLASTER).cuboid(min, max, Faces::ALL);
    wall(Vec3::new(-outer, foot, WALL), Vec3::new(outer, CEILING, outer));
    wall(Vec3::new(WALL, foot, -WALL), Vec3::new(outer, CEILING, WALL));
    wall(Vec3::new(-outer, foot, -WALL), Vec3::new(-WALL, CEILING, WALL));
    wall(Vec3::new(-outer, foot, -outer), Vec3::new(-1.2, CEILING, -WALL));
    wall(Vec3::new(1.2, foot, -outer), Vec3::new(outer, CEILING, -WALL));
    let door = ArchShape {
        top: CEILING,
        spring: 1.7,
        radius: 0.85,
        jamb_foot: 0.0,
        thickness: WALL_THICKNESS,
        segments: 8,
        with_top: false,
    };
    let z = -WALL - WALL_THICKNESS * 0.5;
    stone.tint(PALE).arch(Vec3::new(-1.2, 0.0, z), Vec3::new(1.2, 0.0, z), door);
    // Threshold.
    flat(stone.tint(SLATE), Vec2::new(-1.2, -outer), Vec2::new(2.4, WALL_THICKNESS), 0.0);
}

/// The room behind the doorway, with a latticed window to the east (+X), where the sun comes in.
fn room(stone: &mut MeshBuilder, plain: &mut MeshBuilder) {
    let (half, near, far, height, t) = (3.0, -WALL - WALL_THICKNESS, -14.0, 3.2, WALL_THICKNESS);
    let foot = -0.2;
    flat(stone.tint(LIMESTONE), Vec2::new(-half, far), Vec2::new(2.0 * half, near - far), 0.0);
    let mut wall = |min: Vec3, max: Vec3| stone.tint(PLASTER).cuboid(min, max, Faces::ALL);
    wall(Vec3::new(-half - t, foot, far - t), Vec3::new(half + t, height, far));
    wall(Vec3::new(-half - t, foot, far), Vec3::new(-half, height, near));
    wall(Vec3::new(-half - t, height, far - t), Vec3::new(half + t, height + t, near));
    let (sill, head, left, right) = (0.7, 2.7, -13.2, -10.2);
    wall(Vec3::new(half, foot, far), Vec3::new(half + t, height, left));
    wall(Vec3::new(half, foot, right), Vec3::new(half + t, height, near));
    wall(Vec3::new(half, foot, left), Vec3::new(half + t, sill, right));
    wall(Vec3::new(half, head, left), Vec3::new(half + t, height, right));
    plain.tint(WOOD);
    let open = Faces::ALL.without(Faces::BOTTOM).without(Faces::TOP);
    const BARS: i32 = 8;
    let center = Vec3::new(half + t * 0.5, (sill + head) * 0.5, (left + right) * 0.5);
    for bar in 0..BARS {
        let offset = (bar as f32 + 0.5) / BARS as f32 - 0.5;
        // Diagonal bars in both directions: a lattice of diamonds.
        for lean in [-FRAC_PI_4, FRAC_PI_4] {
            let bar_center = center + Vec3::Z * (offset * (right - left + 1.6));
            plain.turned_cuboid(
                bar_center,
                Vec3::new(0.02, 1.38, 0.022),
                Quat::from_rotation_x(lean),
                open,
            );
        }
    }
    // A bench, a chest and a jar.
    plain.cuboid(Vec3::new(-2.8, 0.42, -13.4), Vec3::new(-2.2, 0.5, -10.6), Faces::ALL);
    for z in [-13.2, -10.9] {
        plain.cuboid(Vec3::new(-2.75, 0.0, z), Vec3::new(-2.25, 0.42, z + 0.1), open);
    }
    plain.tint(INDIGO).cuboid(
        Vec3::new(-0.9, 0.0, -13.8),
        Vec3::new(0.5, 0.65, -13.1),
        Faces::ALL.without(Faces::BOTTOM),
    );
    plain.tint(CRIMSON).lathe(
        Vec3::new(2.0, 0.0, -13.2),
        &[(0.0, 0.16), (0.45, 0.33), (0.75, 0.14), (0.85, 0.2), (0.8, 0.0)],
        8,
    );
}

fn fountain(stone: &mut MeshBuilder, plain: &mut MeshBuilder) {
    let base = Vec3::new(0.0, COURT, 0.0);
    let basin = [(0.0, 1.45), (0.42, 1.4), (0.42, 1.52), (0.55, 1.52), (0.55, 1.22), (0.2, 1.22)];
    stone.tint(PALE).lathe(base, &basin, 12);
    stone.tint(PALE).lathe(
        base,
        &[(0.2, 0.22), (0.95, 0.13), (1.12, 0.5), (1.2, 0.5), (1.14, 0.0)],
        10,
    );
    plain.tint(WATER).lathe(base, &[(0.43, 1.23), (0.43, 0.0)], 12);
}

fn tree(stone: &mut MeshBuilder, plain: &mut MeshBuilder, base: Vec3) {
    stone.tint(TERRACOTTA).lathe(base, &[(0.0, 0.3), (0.5, 0.42), (0.55, 0.42), (0.5, 0.0)], 8);
    plain.tint(WOOD).lathe(base, &[(0.5, 0.06), (1.5, 0.045)], 5);
    plain.tint(LEAF).icosphere(base + Vec3::Y * 1.95, 0.62, 1, false);
}

/// Drapes in the bays to the west and north, where the sun falls on them and their colour bleeds
/// into the gallery, one at the doorway and two sails over the court.
fn drapes(cloth: &mut MeshBuilder, plain: &mut MeshBuilder) {
    let (west, north) = (quarter(3), quarter(2));
    let hung = [
        (west, 0, CRIMSON, 0.35),
        (west, 1, SAFFRON, 0.9),
        (west, 3, TEAL, 0.3),
        (west, 4, INDIGO, 0.8),
        (north, 0, SAFFRON, 0.5),
        (north, 1, CRIMSON, 0.25),
        (north, 4, TEAL, 0.6),
    ];
    for (i, (turn, bay, tint, foot)) in hung.into_iter().enumerate() {
        let (center, phase) = ((bay as f32 + 0.5) * BAY_WIDTH - ARCADE, i as f32 * 1.7);
        let (top, half) = (2.52, 0.84);
        cloth.tint(tint).sheet(11, 4, Vec2::ONE, |s, t| {
            // Folds deepen towards the foot, where the cloth also gathers a little and swings in
            // the wind.
            let loose = 1.0 - t;
            let depth = (0.035 + 0.06 * loose) * (s * TAU * 2.5 + phase).sin()
                + 0.12 * loose * loose * (phase * 2.0).sin();
            turn * Vec3::new(
                center + (2.0 * s - 1.0) * half * (1.0 - 0.08 * loose),
                foot + (top - foot) * t,
                ARCADE + depth,
            )
        });
        plain.tint(WOOD).turned_cuboid(
            turn * Vec3::new(center, top + 0.02, ARCADE),
            Vec3::new(0.95, 0.02, 0.02),
            turn,
            Faces::ALL,
        );
    }
    for (z, tint, phase) in [(-3.4, SAFFRON, 0.0_f32), (-0.4, CRIMSON, 1.3)] {
        cloth.tint(tint).sheet(4, 14, Vec2::ONE, |s, t| {
            let (across, along) = (2.0 * s - 1.0, 2.0 * t - 1.0);
            let sag = 0.75 * (1.0 - along * along) + 0.08 * (along * 7.0 + phase).sin();
            Vec3::new(
                along * 5.7,
                ROOF + 0.6 - sag - 0.06 * (1.0 - across * across),
                z - across * 0.9,
            )
        });
    }
}
