//! Tests of the selection of points.

use super::*;

/// `count` points of 1 m² on a line, 1 m apart.
fn line(count: usize, seed: u32) -> Vec<Candidate<usize>> {
    let density = |index: usize| density(Vec3::X * index as f32, Vec3::ZERO, 30.0);
    (0..count)
        .map(|point| Candidate {
            area: 1.0,
            density: density(point),
            rank: rank(point, seed),
            point,
        })
        .collect()
}

/// At most `count` of `candidates`, and their areas.
fn chosen(candidates: Vec<Candidate<usize>>, count: usize) -> Vec<(usize, f32)> {
    choose(&candidates, threshold(&candidates, count)).collect()
}

#[test]
fn the_selection_represents_all_points() {
    for (points, count) in [(100, 10), (1000, 64), (1000, 999), (5000, 512)] {
        let mut ratios = Vec::new();
        for seed in 0..256u32 {
            let chosen = chosen(line(points, seed.wrapping_mul(2_654_435_769)), count);
            assert_eq!(chosen.len(), count);
            ratios
                .push(chosen.iter().map(|(_, area)| f64::from(*area)).sum::<f64>() / points as f64);
        }
        let mean = ratios.iter().sum::<f64>() / 256.0;
        // Exact for independent ranks; stratified ones err by up to half a point.
        assert!((mean - 1.0).abs() < 0.5 / count as f64 + 0.005, "{mean} of {points} by {count}");
    }
}

#[test]
fn with_room_for_all_each_point_represents_itself() {
    for (points, count) in [(0, 0), (0, 8), (1, 1), (8, 8), (8, 100)] {
        let chosen = chosen(line(points, 0), count);
        assert_eq!(chosen, (0..points).map(|point| (point, 1.0)).collect::<Vec<_>>());
    }
    assert_eq!(chosen(line(5, 0), 0), []);
}

#[test]
fn near_surfaces_have_more_patches() {
    let candidates = (0..4096).map(|point| {
        let density = density(Vec3::X * point as f32, Vec3::ZERO, 300.0);
        Candidate { area: 1.0, density, rank: rank(point, 0), point }
    });
    let chosen = chosen(candidates.collect(), 128);
    let near = chosen.iter().filter(|(point, _)| *point < 600).count();
    // ∫ 1/(1 + (x/300)²) from 0 to 600, as a share of that to 4096.
    let share = 2f64.atan() / (4096.0f64 / 300.0).atan();
    assert!((near as f64 / 128.0 / share - 1.0).abs() < 0.1, "{near}");
}

#[test]
fn other_points_keep_their_patches_when_a_surface_appears() {
    let before = chosen(line(4000, 0), 512);
    let mut more = line(4000, 0);
    more.extend((0..40).map(|point| Candidate {
        area: 1.0,
        density: 1.0,
        rank: rank(point, 77),
        point: 10_000 + point,
    }));
    let after = chosen(more, 512);
    let kept =
        before.iter().filter(|(point, _)| after.iter().any(|(other, _)| other == point)).count();
    let came = after.iter().filter(|(point, _)| *point >= 10_000).count();
    assert!(came > 0 && kept == 512 - came, "{kept} of 512, {came} came");
}

#[test]
fn zero_and_non_finite_weights_are_left_out() {
    let odd = |area: f32, density: f32| Candidate { area, density, rank: 0.5, point: 0 };
    let candidates = vec![
        odd(f32::NAN, 1.0),
        odd(f32::INFINITY, 1.0),
        odd(0.0, 1.0),
        odd(-1.0, -1.0),
        odd(1.0, 0.0),
        odd(1.0, f32::NAN),
    ];
    assert_eq!(chosen(candidates, 8), []);
    assert_eq!(chosen(vec![odd(1e-30, 1.0), odd(1e30, 1.0)], 8).len(), 2);
    assert_eq!(density(Vec3::splat(f32::INFINITY), Vec3::ZERO, 1.0), 0.0);
}

#[test]
fn ranks_of_any_run_are_evenly_distributed() {
    for (first, seed) in [(0, 0), (64, 12345), (640, u32::MAX)] {
        let mut ranks: Vec<f32> = (first..first + 64).map(|index| rank(index, seed)).collect();
        ranks.sort_by(f32::total_cmp);
        assert!(
            ranks
                .iter()
                .enumerate()
                .all(|(i, rank)| (rank - (i as f32 + 0.5) / 64.0).abs() < 1.0 / 64.0),
            "{ranks:?}"
        );
        assert!(ranks[0] > 0.0 && ranks[63] <= 1.0);
    }
}

#[test]
fn points_are_found_by_their_ranks() {
    for count in [1, 2, 3, 64, 100, 1024] {
        for seed in [0, 1, 12_345, 1 << 31, u32::MAX - 255, u32::MAX] {
            for most in [0.0, 1e-7, 0.001, 0.3, 0.999, 1.0, f32::NAN, f32::INFINITY] {
                let mut found: Vec<usize> = ranked_up_to(most, count, seed).collect();
                found.sort_unstable();
                let unique = found.windows(2).all(|pair| pair[0] < pair[1]);
                let expected: Vec<usize> = (0..count)
                    .filter(|index| most.is_nan() || rank(*index, seed) <= most)
                    .collect();
                let are_there = expected.iter().all(|index| found.binary_search(index).is_ok());
                assert!(unique && are_there, "{count}, {seed}, {most}: {found:?}, {expected:?}");
                assert!(found.len() <= expected.len() + 2, "{count}, {seed}, {most}: {found:?}");
            }
        }
    }
}

#[test]
fn no_density_in_a_sphere_is_greater_than_its_bound() {
    let focus = PatchFocus::new(Entity::PLACEHOLDER, Vec3::ZERO, 40.0, None);
    for (x, radius) in [(0.0, 1.0), (3.0, 1.0), (3.0, 5.0), (100.0, 0.0), (100.0, 12.0)] {
        let center = Vec3::new(x, 0.3, -0.2);
        let most = focus.most_density(center, radius);
        let densities = [-1.0, -0.5, 0.0, 0.5, 1.0]
            .map(|along| focus.density(center + Vec3::new(along * radius, 0.0, 0.0)));
        assert!(densities.into_iter().all(|density| density <= most * 1.0001), "{x}, {radius}");
        let [least, greatest] = [f32::min, f32::max].map(|of| densities.into_iter().reduce(of));
        let is_even = least.zip(greatest).is_some_and(|(least, most)| least > 0.5 * most);
        assert!(is_even || !focus.is_even((center, radius)), "{x}, {radius}: {densities:?}");
    }
}

#[test]
fn the_first_value_lies_in_the_lowest_byte() {
    let material = MaterialSample {
        color: Vec3::new(1.0, 0.0, 0.5),
        roughness: 0.2,
        metallic: 1.0,
        reflectance: 0.5,
    };
    let patch = Patch::new(Vec3::ZERO, 1.0, Vec3::Y, &material);
    assert_eq!(patch.color.to_le_bytes(), [255, 0, 186, 51]);
    assert_eq!(patch.properties.to_le_bytes(), [128, 255, 0, 0]);
}

#[test]
fn patches_stay_while_a_camera_moves_within_a_step() {
    let from = |x: f32, range: f32, before: Option<&PatchFocus>| {
        PatchFocus::new(Entity::PLACEHOLDER, Vec3::new(x, 2.0, -3.0), range, before)
    };
    let at = |x: f32, range: f32| from(x, range, None);
    assert_eq!(at(0.1, 40.0), at(0.4, 40.0));
    assert_ne!(at(0.1, 40.0), at(1.4, 40.0));
    // Steps are of 1 m: over the border and back, and then beyond.
    let before = at(0.45, 40.0);
    assert_ne!(at(0.55, 40.0), before);
    assert_eq!(from(0.55, 40.0, Some(&before)), before);
    assert_ne!(from(0.8, 40.0, Some(&before)), before);
    assert_ne!(from(0.45, 80.0, Some(&before)), before, "another range");
    for (position, range) in [
        (f32::NAN, 40.0),
        (1e30, 40.0),
        (f32::INFINITY, 0.0),
        (1.0, f32::NAN),
        (1.0, f32::INFINITY),
        (1.0, -1.0),
    ] {
        let around = at(position, range);
        assert!(
            around.center.is_finite() && around.near.is_finite() && around.near > 0.0,
            "{around:?}"
        );
    }
}
