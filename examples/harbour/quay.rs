//! Water, quay, pier, boats, crane and sheds.

use std::f32::consts::{FRAC_PI_2, TAU};

use bevy::light::FogVolume;
use bevy::prelude::*;

use crate::builder::Builder;
use crate::surfaces::{in_metres, scramble, water_plane};

/// Height of the water; the quay's is 0.
const WATER: f32 = -1.1;

pub(crate) fn build(builder: &mut Builder<'_, '_, '_>) {
    surroundings(builder);
    quay(builder);
    pier(builder);
    crane(builder, vec3(16.0, 0.0, 3.6));
    for (number, (at, turn)) in [
        (vec3(-19.4, WATER, -9.0), 0.06),
        (vec3(-12.6, WATER, -18.0), 3.2),
        (vec3(-2.0, WATER, -3.2), 1.62),
    ]
    .into_iter()
    .enumerate()
    {
        boat(builder, at, turn, if number == 2 { 1.25 } else { 0.85 });
    }
    sheds(builder);
    goods(builder);
    // A haze over water and quay, in which the sun draws shafts between roofs and masts.
    let haze = FogVolume {
        fog_color: Color::srgb(1.0, 0.86, 0.74),
        density_factor: 0.035,
        absorption: 0.12,
        scattering: 0.5,
        scattering_asymmetry: 0.55,
        ..default()
    };
    let place = Transform::from_xyz(0.0, 3.4, -13.0).with_scale(vec3(92.0, 9.0, 52.0));
    builder.commands.spawn((haze, place));
}

/// Water, land, far hills, and a lighthouse on its mole.
fn surroundings(builder: &mut Builder<'_, '_, '_>) {
    let water = builder.meshes.add(water_plane(vec2(300.0, 150.0)));
    let surface = MeshMaterial3d(builder.surfaces.water.clone());
    builder.commands.spawn((Mesh3d(water), surface, Transform::from_xyz(0.0, WATER, -146.0)));
    let (stone, grass) = (builder.surfaces.stone.clone(), builder.surfaces.grass.clone());
    let (hills, plaster) = (builder.surfaces.hills.clone(), builder.surfaces.plaster.clone());
    builder.stand([-46.0, 46.0], [0.0, 60.0], [-3.0, 0.0], &stone);
    builder.stand([-260.0, 260.0], [3.0, 250.0], [-3.0, -0.05], &grass);
    for (radii, centre) in [
        (vec3(150.0, 26.0, 40.0), vec3(-170.0, WATER, -270.0)),
        (vec3(110.0, 38.0, 40.0), vec3(60.0, WATER, -290.0)),
        (vec3(120.0, 22.0, 40.0), vec3(190.0, WATER, -250.0)),
        (vec3(160.0, 30.0, 50.0), vec3(-60.0, -4.0, 240.0)),
        (vec3(120.0, 44.0, 50.0), vec3(130.0, -4.0, 260.0)),
    ] {
        builder.ball(radii, centre, &hills);
    }
    builder.stand([18.0, 110.0], [-84.0, -79.0], [-3.0, 0.6], &stone);
    builder.drum(2.4, 12.0, vec3(21.0, 6.6, -81.5), &plaster);
    builder.drum(2.8, 0.5, vec3(21.0, 12.8, -81.5), &stone);
    builder.drum(1.5, 1.6, vec3(21.0, 15.2, -81.5), &stone);
    builder.bulb(vec3(21.0, 13.8, -81.5), 0.7);
}

fn quay(builder: &mut Builder<'_, '_, '_>) {
    let (stone, iron) = (builder.surfaces.stone.clone(), builder.surfaces.iron.clone());
    builder.stand([-46.0, 46.0], [0.0, 0.7], [-2.5, 0.12], &stone);
    for number in 0..14 {
        let x = -42.0 + 6.5 * number as f32;
        builder.drum(0.16, 0.6, vec3(x, 0.4, 0.4), &iron);
        builder.drum(0.22, 0.1, vec3(x, 0.72, 0.4), &iron);
    }
    for x in [-38.0, -10.0, 7.5, 36.0] {
        builder.post(vec3(x, 0.0, 10.6));
    }
    // Steps down to the water.
    for step in 0..4 {
        let y = 0.0 - 0.28 * step as f32;
        let x = 27.0 + 0.5 * step as f32;
        builder.stand([x, x + 0.5], [-1.4, 0.0], [-2.0, y], &stone);
    }
}

fn pier(builder: &mut Builder<'_, '_, '_>) {
    let (planks, wood) = (builder.surfaces.planks.clone(), builder.surfaces.dark_wood.clone());
    builder.stand([-17.6, -14.4], [-27.0, 0.0], [-0.25, 0.0], &planks);
    for number in 0..7 {
        let z = -26.0 + 4.2 * number as f32;
        for x in [-17.4, -14.6] {
            builder.drum(0.17, 3.4, vec3(x, -0.9, z), &wood);
        }
        if number % 2 == 0 {
            builder.block(vec3(0.1, 0.1, 4.2), vec3(-14.6, 0.75, z + 2.1), &wood);
        }
    }
    for z in [-25.5, -11.0] {
        builder.post(vec3(-17.2, 0.0, z));
    }
}

/// A crane with a tread wheel, its jib over the water.
fn crane(builder: &mut Builder<'_, '_, '_>, at: Vec3) {
    let (wood, planks) = (builder.surfaces.dark_wood.clone(), builder.surfaces.planks.clone());
    let (iron, stone) = (builder.surfaces.iron.clone(), builder.surfaces.stone.clone());
    builder.block(vec3(3.4, 0.8, 3.4), at + Vec3::Y * 0.4, &stone);
    for (x, z) in [(-1.2, -1.2), (1.2, -1.2), (-1.2, 1.2), (1.2, 1.2)] {
        let lean = Quat::from_rotation_z(0.09 * x) * Quat::from_rotation_x(-0.09 * z);
        let foot =
            Transform::from_translation(at + vec3(0.6 * x, 3.9, 0.6 * z)).with_rotation(lean);
        builder.turned(vec3(0.32, 6.6, 0.32), foot, &wood);
    }
    builder.block(vec3(2.2, 0.4, 2.2), at + Vec3::Y * 7.0, &wood);
    builder.block(vec3(0.6, 3.2, 0.6), at + Vec3::Y * 8.6, &wood);
    let jib = Transform::from_translation(at + vec3(-1.4, 9.2, -3.6))
        .looking_to(vec3(-0.35, 0.42, -0.84), Vec3::Y);
    builder.turned(vec3(0.4, 0.5, 9.6), jib, &wood);
    let tip = at + vec3(-3.0, 11.3, -7.5);
    builder.drum(0.04, 8.0, tip - Vec3::Y * 4.0, &iron);
    builder.block(vec3(1.5, 1.1, 1.5), tip - Vec3::Y * 8.4, &planks);
    // The wheel, of spokes and a rim.
    for spoke in 0..12 {
        let turn = Quat::from_rotation_x(TAU * spoke as f32 / 12.0);
        let centre = at + vec3(1.9, 3.4, 0.0);
        let place = Transform::from_translation(centre + turn * Vec3::Y * 1.9).with_rotation(turn);
        builder.turned(vec3(1.0, 0.12, 1.05), place, &planks);
        let place = Transform::from_translation(centre + turn * Vec3::Y * 0.95).with_rotation(turn);
        builder.turned(vec3(0.12, 1.9, 0.12), place, &wood);
    }
    builder.lantern(at + vec3(-1.5, 5.6, -1.5), vec3(-0.25, -1.0, -0.2));
}

/// A boat of a length of about 7 m times `size`, whose bow points along its own −z.
fn boat(builder: &mut Builder<'_, '_, '_>, at: Vec3, turn: f32, size: f32) {
    let (hull, wood) = (builder.surfaces.hull.clone(), builder.surfaces.dark_wood.clone());
    let (planks, canvas) = (builder.surfaces.planks.clone(), builder.surfaces.canvas.clone());
    let place = |offset: Vec3, own: Quat| {
        let turn = Quat::from_rotation_y(turn);
        Transform { translation: at + turn * (offset * size), rotation: turn * own, ..default() }
    };
    let level = Quat::IDENTITY;
    builder.turned(vec3(2.5, 1.5, 5.4) * size, place(vec3(0.0, 0.35, 0.8), level), &hull);
    // The bow is a wedge that lies.
    let lying = Quat::from_rotation_x(-FRAC_PI_2);
    builder.wedge(vec3(2.5, 2.6, 1.5) * size, place(vec3(0.0, 0.35, -1.9), lying), &hull);
    builder.turned(vec3(2.2, 0.08, 5.0) * size, place(vec3(0.0, 1.12, 0.8), level), &planks);
    for x in [-1.2, 1.2] {
        builder.turned(vec3(0.12, 0.35, 5.4) * size, place(vec3(x, 1.25, 0.8), level), &wood);
    }
    builder.turned(vec3(1.5, 1.2, 1.6) * size, place(vec3(0.0, 1.75, 2.2), level), &planks);
    builder.turned(vec3(1.8, 0.12, 1.9) * size, place(vec3(0.0, 2.4, 2.2), level), &wood);
    builder.turned(vec3(0.18, 8.0, 0.18) * size, place(vec3(0.0, 4.8, -0.3), level), &wood);
    let boom = Quat::from_rotation_x(0.1);
    builder.turned(vec3(0.14, 0.14, 4.2) * size, place(vec3(0.0, 2.9, 1.7), boom), &wood);
    builder.turned(vec3(0.34, 0.34, 3.8) * size, place(vec3(0.0, 3.15, 1.7), boom), &canvas);
    let stay = Quat::from_rotation_x(0.42);
    builder.turned(vec3(0.03, 8.2, 0.03) * size, place(vec3(0.0, 4.9, -2.2), stay), &canvas);
}

/// Two sheds beside the tavern.
fn sheds(builder: &mut Builder<'_, '_, '_>) {
    let surfaces = [builder.surfaces.brick.clone(), builder.surfaces.ochre.clone()];
    let (tiles, wood) = (builder.surfaces.tiles.clone(), builder.surfaces.dark_wood.clone());
    for (number, x) in [[-34.0, -14.0], [10.0, 32.0]].into_iter().enumerate() {
        builder.stand(x, [12.0, 22.0], [0.0, 5.0], &surfaces[number]);
        builder.roof(x, [12.0, 22.0], 5.0, &tiles);
        for gate in 0..3 {
            let middle = x[0] + (gate as f32 + 0.5) * (x[1] - x[0]) / 3.0;
            builder.stand([middle - 1.5, middle + 1.5], [11.85, 12.1], [0.0, 3.4], &wood);
            builder.stand([middle - 1.9, middle + 1.9], [11.6, 12.1], [3.5, 3.75], &wood);
            builder.window(vec3(middle + 2.6, 3.2, 22.0), Vec3::Z, gate == 1);
        }
    }
    builder.stand([-46.0, -37.5], [12.0, 20.0], [0.0, 3.6], &surfaces[1]);
    builder.roof([-46.0, -37.5], [12.0, 20.0], 3.6, &tiles);
    builder.window(vec3(-40.0, 1.9, 12.0), Vec3::NEG_Z, true);
}

/// Crates, barrels and sacks along the quay.
fn goods(builder: &mut Builder<'_, '_, '_>) {
    let (planks, wood) = (builder.surfaces.planks.clone(), builder.surfaces.dark_wood.clone());
    let (iron, canvas) = (builder.surfaces.iron.clone(), builder.surfaces.canvas.clone());
    for (pile, x) in [-31.0f32, -22.5, -6.0, 5.5, 23.0, 29.5].into_iter().enumerate() {
        for number in 0..5 {
            let pick = |which: u32| scramble(pile as u32 * 8 + which, number);
            let edge = 0.8 + 0.5 * pick(0);
            let layer = if number == 4 { 1.15 } else { 0.0 };
            let across = if number == 4 { 0.8 } else { 1.3 * (number % 2) as f32 };
            let along = if number == 4 { 0.7 } else { 1.35 * (number / 2) as f32 };
            let centre = vec3(x + across, layer + edge / 2.0, 6.2 + along);
            let turn = Quat::from_rotation_y(0.5 * pick(1) - 0.25);
            let place = Transform::from_translation(centre).with_rotation(turn);
            builder.turned(Vec3::splat(edge), place, if pick(2) > 0.3 { &planks } else { &wood });
        }
        for number in 0..3 {
            let at = vec3(x - 1.1, 0.5, 5.6 + 0.85 * number as f32);
            builder.drum(0.36, 1.0, at, &wood);
            builder.drum(0.37, 0.06, at + Vec3::Y * 0.25, &iron);
        }
        builder.ball(vec3(0.55, 0.3, 0.4), vec3(x + 2.7, 0.25, 6.4), &canvas);
        builder.ball(vec3(0.5, 0.28, 0.45), vec3(x + 2.9, 0.25, 7.2), &canvas);
    }
    // Coiled ropes.
    let rope = builder.meshes.add(in_metres(Torus::new(0.25, 0.45).into()));
    for x in [-20.0, -3.5, 11.5, 33.0] {
        let surface = MeshMaterial3d(canvas.clone());
        builder.commands.spawn((Mesh3d(rope.clone()), surface, Transform::from_xyz(x, 0.1, 2.2)));
    }
}
