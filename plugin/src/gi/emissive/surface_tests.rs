use bevy::math::{Quat, Vec3A};

use super::*;
use crate::gi::surfaces::TrianglePoint;

/// A rectangle of 2 m × 1 m in the plane z = 0 that faces +Z, in two triangles.
const PANEL: [[Vec3; 3]; 2] = [
    [Vec3::new(0.0, 0.0, 0.0), Vec3::new(2.0, 0.0, 0.0), Vec3::new(2.0, 1.0, 0.0)],
    [Vec3::new(0.0, 0.0, 0.0), Vec3::new(2.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)],
];

fn white(_: TrianglePoint) -> Vec3 {
    Vec3::ONE
}

fn emissive(
    triangles: &[[Vec3; 3]],
    count: usize,
    color: impl Fn(TrianglePoint) -> Vec3,
) -> Option<EmissiveSurface> {
    SurfacePoints::new(triangles, count, color).map(EmissiveSurface)
}

fn texels(
    surface: &EmissiveSurface,
    affine: Affine3A,
    emission: DVec3,
    sides: Sides,
    count: usize,
) -> Vec<Texel> {
    let mut texels = Vec::new();
    surface.add_texels(&affine, emission, sides, count, &mut texels);
    texels
}

fn flux(texels: &[Texel]) -> [f64; 3] {
    [0, 1, 2].map(|channel| texels.iter().map(|texel| f64::from(texel.flux[channel])).sum())
}

#[test]
fn texels_carry_all_flux_under_any_transform() {
    let emission = DVec3::new(100.0, 50.0, 10.0);
    let surface = emissive(&PANEL, 1024, white).unwrap();
    let transforms = [
        (Affine3A::IDENTITY, 2.0),
        (
            Affine3A::from_scale_rotation_translation(
                Vec3::splat(3.0),
                Quat::from_rotation_x(1.0),
                Vec3::new(5.0, -2.0, 1e4),
            ),
            18.0,
        ),
        // Uneven scales change triangles' areas by how they are turned.
        (Affine3A::from_scale(Vec3::new(1.0, 4.0, 0.01)), 8.0),
        (Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)), 2.0),
    ];
    for (affine, area) in transforms {
        for count in [1, 7, 64, 1024] {
            let texels = texels(&surface, affine, emission, Sides::Front, count);
            let (found, expected) =
                (flux(&texels), (emission * area * std::f64::consts::PI).to_array());
            assert_eq!(texels.len(), count);
            assert!(
                (0..3).all(|channel| (found[channel] / expected[channel] - 1.0).abs() < 1e-5),
                "{found:?} {expected:?}"
            );
            let covered: f64 = texels.iter().map(|texel| f64::from(texel.area)).sum();
            assert!((covered / area - 1.0).abs() < 1e-5, "{covered} m² of {area}");
        }
        assert!(
            (surface.power(&affine, DVec3::ONE) / (area * std::f64::consts::PI) - 1.0).abs() < 1e-5
        );
    }
    assert_eq!(texels(&surface, Affine3A::IDENTITY, emission, Sides::Both, 8).len(), 16);
}

#[test]
fn texels_are_evenly_spread_and_consecutive_ones_are_neighbours() {
    let surface = emissive(&PANEL, 1024, white).unwrap();
    for count in [64usize, 256, 1024] {
        let texels = texels(&surface, Affine3A::IDENTITY, DVec3::ONE, Sides::Front, count);
        // Each of 8 × 4 equal parts of the panel has its share, to within half of it.
        let share = count / 32;
        for part in 0..32usize {
            let (x, y) = (part % 8, part / 8);
            let inside = texels.iter().filter(|texel| {
                (texel.position[0] * 4.0) as usize == x && (texel.position[1] * 4.0) as usize == y
            });
            let inside = inside.count();
            assert!(
                (share / 2..=share * 2).contains(&inside),
                "{inside} of {count} in part {part}"
            );
        }
        let step = |pair: &[Texel]| {
            (Vec3A::from(pair[0].position) - Vec3A::from(pair[1].position)).length()
        };
        let mean = texels.windows(2).map(step).sum::<f32>() / (count - 1) as f32;
        // Evenly spread points have about √(2 m² ÷ count) between neighbours.
        assert!(
            mean < 2.5 * (2.0 / count as f32).sqrt(),
            "{mean} m from one to the next of {count}"
        );
    }
}

#[test]
fn texels_stay_in_place_on_a_moving_surface() {
    let surface = emissive(&PANEL, 1024, white).unwrap();
    let before = texels(&surface, Affine3A::IDENTITY, DVec3::ONE, Sides::Front, 512);
    for (turn, offset) in [(0.3, Vec3::X), (2.0, Vec3::splat(17.0))] {
        let affine = Affine3A::from_rotation_translation(
            Quat::from_axis_angle(Vec3::ONE.normalize(), turn),
            offset,
        );
        for (old, new) in
            before.iter().zip(texels(&surface, affine, DVec3::splat(3.0), Sides::Front, 512))
        {
            let expected = affine.transform_point3(old.position.into());
            assert!((expected - Vec3::from(new.position)).length() < 1e-4);
        }
    }
}

#[test]
fn texels_lie_where_the_texture_is_bright() {
    // The second triangle is dark but for one part in a hundred of its light.
    let surface =
        emissive(
            &PANEL,
            4096,
            |point| if point.triangle == 0 { Vec3::ONE } else { Vec3::splat(0.01) },
        )
        .unwrap();
    let texels = texels(&surface, Affine3A::IDENTITY, DVec3::ONE, Sides::Front, 202);
    let bright = texels.iter().filter(|texel| texel.position[1] < 0.5 * texel.position[0]).count();
    assert!((199..=201).contains(&bright), "{bright}");
    let expected = 1.01 * std::f64::consts::PI;
    assert!((flux(&texels)[1] / expected - 1.0).abs() < 1e-3, "{:?}", flux(&texels));
}

#[test]
fn only_visible_sides_emit() {
    let surface = emissive(&PANEL, 16, white).unwrap();
    let mut normals = Vec::new();
    for (sides, affine) in [
        (Sides::Front, Affine3A::IDENTITY),
        (Sides::Back, Affine3A::IDENTITY),
        // Mirrored in x, its triangles run the other way round.
        (Sides::Front, Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0))),
    ] {
        let texels = texels(&surface, affine, DVec3::ONE, sides, 1);
        let expected = if normals.is_empty() { Vec3::Z } else { Vec3::NEG_Z };
        assert_eq!(
            texels[0],
            Texel::new(texels[0].position.into(), texels[0].area, texels[0].flux.into(), expected)
        );
        normals.push(expected);
    }
}

#[test]
fn degenerate_surfaces_give_no_texels_or_finite_ones() {
    let point = [[Vec3::ONE; 3]];
    let line = [[Vec3::ZERO, Vec3::X, Vec3::X * 2.0]];
    let broken = [
        [Vec3::NAN, Vec3::X, Vec3::Y],
        [Vec3::INFINITY, Vec3::X, Vec3::Y],
        [Vec3::splat(1e30), Vec3::X, Vec3::Y],
    ];
    assert!(
        [&point[..], &line, &broken, &[]]
            .iter()
            .all(|triangles| emissive(triangles, 16, white).is_none())
    );
    let mixed = [broken[0], PANEL[0]];
    let surface = emissive(&mixed, 16, white).unwrap();
    for emission in [1e-30, 1e20, 1e38, 1e300] {
        for affine in [
            Affine3A::IDENTITY,
            Affine3A::from_scale(Vec3::splat(1e15)),
            Affine3A::from_scale(Vec3::splat(1e-15)),
        ] {
            let texels = texels(&surface, affine, DVec3::splat(emission), Sides::Both, 8);
            assert!(
                texels.iter().all(|texel| texel
                    .flux
                    .iter()
                    .chain([&texel.area])
                    .all(|value| value.is_finite())),
                "{emission}"
            );
        }
    }
    assert!(
        texels(&surface, Affine3A::from_scale(Vec3::ZERO), DVec3::ONE, Sides::Front, 8).is_empty()
    );
    assert!(texels(&surface, Affine3A::IDENTITY, DVec3::ZERO, Sides::Front, 8).is_empty());
}
