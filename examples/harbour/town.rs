//! Lanes of houses with lamps, the square with its tower, and the tavern.

use bevy::prelude::*;

use crate::builder::Builder;
use crate::surfaces::scramble;

/// Lanes run between these rows of houses, and across between these columns.
const ROWS: [[f32; 2]; 3] = [[26.0, 34.0], [37.0, 45.0], [48.0, 56.0]];
const COLUMNS: [[f32; 2]; 4] = [[-44.0, -25.0], [-22.0, -3.0], [0.0, 20.0], [23.0, 44.0]];
/// Houses side by side in a row and column.
const HOUSES: u32 = 3;
/// Middle of the tower.
pub(crate) const TOWER: Vec3 = Vec3::new(36.0, 0.0, 30.0);
/// Height of its platform.
pub(crate) const PLATFORM: f32 = 19.0;

pub(crate) fn build(builder: &mut Builder<'_, '_, '_>) {
    for (row, z) in ROWS.into_iter().enumerate() {
        for (column, x) in COLUMNS.into_iter().enumerate() {
            // The first row's last place is the square.
            if (row, column) == (0, 3) {
                continue;
            }
            for number in 0..HOUSES {
                let width = (x[1] - x[0]) / HOUSES as f32;
                let left = x[0] + width * number as f32;
                let seed = (row as u32 * 4 + column as u32) * HOUSES + number;
                house(builder, [left, left + width], z, seed);
            }
        }
    }
    let stone = builder.surfaces.stone.clone();
    builder.stand([-46.0, 46.0], [59.0, 60.0], [0.0, 5.0], &stone);
    for x in [-45.6, 45.6] {
        builder.stand([x - 0.4, x + 0.4], [24.0, 60.0], [0.0, 5.0], &stone);
    }
    for x in [-38.0, -28.0, -17.0, -7.0, 6.0, 16.0] {
        builder.lamp(vec3(x, 3.1, 25.6));
    }
    for x in [-40.0, -30.0, -18.0, -8.0, 5.0, 15.0, 29.0, 40.0] {
        builder.lamp(vec3(x, 3.1, 36.6));
    }
    for x in [-36.0, -19.0, -8.0, 9.0, 18.0, 34.0] {
        builder.lamp(vec3(x, 3.1, 47.6));
    }
    square(builder);
    tavern(builder);
}

/// A house with a door and windows on the lanes before and behind it; its upper floor juts out.
fn house(builder: &mut Builder<'_, '_, '_>, x: [f32; 2], z: [f32; 2], seed: u32) {
    let pick = |which: u32| scramble(seed, which);
    let walls = [
        builder.surfaces.plaster.clone(),
        builder.surfaces.ochre.clone(),
        builder.surfaces.brick.clone(),
    ];
    let wall = walls[(pick(0) * 2.99) as usize].clone();
    let (wood, tiles) = (builder.surfaces.dark_wood.clone(), builder.surfaces.tiles.clone());
    let height = 5.4 + 3.0 * pick(1);
    builder.stand(x, z, [0.0, 3.6], &wall);
    let upper = [z[0] - 0.3, z[1] + 0.3];
    builder.stand(x, upper, [3.6, height], &wall);
    builder.roof([x[0] + 0.4, x[1] - 0.4], upper, height, &tiles);
    builder.stand(x, [z[0] - 0.36, z[1] + 0.36], [3.5, 3.68], &wood);
    for beam in [x[0] + 0.12, x[1] - 0.12] {
        builder.stand(
            [beam - 0.12, beam + 0.12],
            [upper[0] - 0.05, upper[1] + 0.05],
            [3.6, height],
            &wood,
        );
    }
    for (side, out) in [(0, Vec3::NEG_Z), (1, Vec3::Z)] {
        let face = z[side];
        let middle = (x[0] + x[1]) / 2.0;
        builder.block(vec3(1.1, 2.2, 0.16), vec3(middle - 1.2, 1.1, face), &wood);
        let lit = |which: u32| pick(which + 2 * side as u32) > 0.55;
        builder.window(vec3(middle + 1.1, 1.8, face), out, lit(2));
        builder.window(vec3(middle, 4.75, upper[side]), out, lit(6));
    }
    if pick(12) > 0.5 {
        builder.stand(
            [x[0] + 0.8, x[0] + 1.7],
            [z[0] + 2.0, z[0] + 2.9],
            [height, height + 3.6],
            &wall,
        );
    }
}

/// A square with a well and stalls, and the tower that sees everything.
fn square(builder: &mut Builder<'_, '_, '_>) {
    let (stone, plaster) = (builder.surfaces.stone.clone(), builder.surfaces.plaster.clone());
    let (wood, canvas) = (builder.surfaces.dark_wood.clone(), builder.surfaces.canvas.clone());
    let (planks, tiles) = (builder.surfaces.planks.clone(), builder.surfaces.tiles.clone());
    builder.drum(1.1, 0.9, vec3(27.0, 0.45, 30.5), &stone);
    for x in [26.0, 28.0] {
        builder.drum(0.09, 2.4, vec3(x, 1.2, 30.5), &wood);
    }
    builder.roof([26.0, 28.0], [29.9, 31.1], 2.4, &tiles);
    for x in [24.5, 40.5] {
        builder.stand([x, x + 2.6], [24.2, 25.4], [0.0, 0.9], &planks);
        for post in [x + 0.05, x + 2.55] {
            builder.drum(0.05, 2.4, vec3(post, 1.2, 24.3), &wood);
            builder.drum(0.05, 2.4, vec3(post, 1.2, 25.6), &wood);
        }
        let awning =
            Transform::from_xyz(x + 1.3, 2.4, 24.95).with_rotation(Quat::from_rotation_x(0.25));
        builder.turned(vec3(3.0, 0.06, 1.9), awning, &canvas);
    }
    builder.stand(
        [TOWER.x - 3.0, TOWER.x + 3.0],
        [TOWER.z - 3.0, TOWER.z + 3.0],
        [0.0, PLATFORM - 0.5],
        &plaster,
    );
    builder.block(vec3(7.4, 0.5, 7.4), TOWER.with_y(PLATFORM - 0.25), &stone);
    // Battlements, so low that one looks over them.
    for side in 0..4 {
        let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 * side as f32);
        for number in 0..4 {
            let offset = turn * vec3(-3.0 + 2.0 * number as f32, 0.0, -3.5);
            let place = Transform::from_translation(TOWER.with_y(PLATFORM + 0.4) + offset)
                .with_rotation(turn);
            builder.turned(vec3(1.0, 0.8, 0.4), place, &stone);
        }
        let face = turn * Vec3::NEG_Z;
        for y in [5.0, 10.0, 15.0] {
            builder.window(TOWER.with_y(y) + face * 3.0, face, (y as u32 + side).is_multiple_of(2));
        }
    }
    builder.lantern(vec3(32.6, 4.4, 29.0), vec3(-0.35, -1.0, 0.1));
}

/// A dark room: light falls in through its door, and a candle stands on a table.
fn tavern(builder: &mut Builder<'_, '_, '_>) {
    let (plaster, tiles) = (builder.surfaces.plaster.clone(), builder.surfaces.tiles.clone());
    let (wood, planks) = (builder.surfaces.dark_wood.clone(), builder.surfaces.planks.clone());
    let (x, z) = ([-9.0, 5.0], [12.0, 22.0]);
    builder.stand([x[0], -3.2], [12.0, 12.4], [0.0, 4.2], &plaster);
    builder.stand([-1.6, x[1]], [12.0, 12.4], [0.0, 4.2], &plaster);
    builder.stand([-3.2, -1.6], [12.0, 12.4], [2.4, 4.2], &plaster);
    builder.stand(x, [21.6, 22.0], [0.0, 4.2], &plaster);
    builder.stand([x[0], x[0] + 0.4], [12.4, 21.6], [0.0, 4.2], &plaster);
    builder.stand([x[1] - 0.4, x[1]], [12.4, 21.6], [0.0, 4.2], &plaster);
    builder.stand(x, z, [3.6, 4.2], &planks);
    builder.roof(x, z, 4.2, &tiles);
    builder.stand([x[0] + 0.4, x[1] - 0.4], [12.4, 21.6], [-0.02, 0.03], &planks);
    for z in [14.2, 16.4, 18.6, 20.4] {
        builder.stand([x[0], x[1]], [z, z + 0.25], [3.3, 3.6], &wood);
    }
    // The bar, shelves, tables and stools.
    builder.stand([-8.0, -1.0], [19.4, 20.0], [0.0, 1.1], &wood);
    builder.stand([-8.1, -0.9], [19.2, 20.1], [1.1, 1.18], &planks);
    for y in [1.2, 1.9, 2.6] {
        builder.stand([-8.0, -1.0], [21.25, 21.6], [y, y + 0.06], &planks);
        for bottle in 0..9 {
            let at = vec3(-7.6 + 0.75 * bottle as f32, y + 0.2, 21.4);
            let surface = if bottle % 3 == 0 { &tiles } else { &wood };
            builder.drum(0.07, 0.28, at, surface);
        }
    }
    for (number, (x, z)) in [(-6.5, 15.3), (1.8, 14.8), (2.0, 18.6)].into_iter().enumerate() {
        builder.block(vec3(1.6, 0.08, 1.0), vec3(x, 0.8, z), &planks);
        builder.block(vec3(0.2, 0.76, 0.6), vec3(x, 0.4, z), &wood);
        for (dx, dz) in [(-0.5, -0.8), (0.5, -0.8), (-0.5, 0.8), (0.5, 0.8)] {
            builder.drum(0.2, 0.46, vec3(x + dx, 0.23, z + dz), &wood);
        }
        if number == 2 {
            builder.candle(vec3(x, 0.84, z));
        } else {
            builder.drum(0.06, 0.15, vec3(x + 0.3, 0.92, z + 0.2), &tiles);
        }
    }
    for (x, z) in [(3.9, 20.9), (3.0, 21.0), (3.5, 20.2)] {
        builder.drum(0.38, 1.0, vec3(x, 0.5, z), &wood);
    }
    // A sign and a lantern beside the door.
    builder.block(vec3(0.9, 0.7, 0.08), vec3(-4.3, 2.9, 11.7), &wood);
    builder.lantern(vec3(-0.6, 2.9, 11.4), vec3(-0.1, -1.0, -0.25));
}
