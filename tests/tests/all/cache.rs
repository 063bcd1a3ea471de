//! Light that is kept in cells of surface: what is in them, what is not, and when nothing is done.

use std::collections::BTreeSet;

use bevy::math::Vec3;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{GiCounts, GiRefresh, GiVisibility, inspect};
use frugal::stage::{Component, Radiance, Stage};
use frugal_tests::{gpu, meshes, set};
use frugal_trace::light::Light;

use crate::furnace::{ALBEDO, deviation, direct_radiance};
use crate::gi::{PLAIN, assert_costs_nothing, corner, sun};

tests!(
    the_dark_room_stays_dark,
    a_sheet_on_one_floor_keeps_light_on_its_side,
    the_sphere_is_the_closed_form,
    it_settles_and_then_does_nothing,
    two_runs_are_alike,
    cells_lie_where_they_should,
    a_cut_begins_anew,
    light_follows_what_changes,
    nothing_to_light_is_no_light,
    rays_are_fewer_than_those_of_the_next_level,
);

const CACHED: &str = "min,gi_refresh_period=1,gi_vpl_count=1024,gi_interleave=4x4,gi_visibility=cached,gi_pixel_fraction=1/4,rsm_resolution=128,resolution_scale=100%";

fn frames(stage: &mut Stage, count: u32) -> Radiance {
    (0..count).for_each(|_| stage.frame());
    stage.radiance().expect("an image")
}

fn the_dark_room_stays_dark() {
    let mut stage =
        set::open(&set::scene("two_rooms"), set::radiance_options(192, 108, Component::Indirect));
    set::apply(&mut stage, CACHED);
    set::look(&mut stage, Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6));
    let lit = set::radiance(&mut stage).mean();
    // Through the wall, without a cut.
    let mut darkest: f64 = 0.0;
    set::look(&mut stage, Vec3::new(0.8, 1.7, 2.0), Vec3::new(3.2, 1.0, -1.6));
    for count in [1, 1, 5, 30] {
        darkest = darkest.max(frames(&mut stage, count).mean());
    }
    set::look(&mut stage, Vec3::new(1.5, 1.5, -0.4), Vec3::new(0.0, 1.0, 0.4));
    for count in [1, 1, 5, 30] {
        darkest = darkest.max(frames(&mut stage, count).mean());
    }
    println!("    lit room {lit:.2} nits, dark room at most {darkest:.6}");
    assert!(lit > 1.0 && darkest <= 0.001, "{lit} {darkest}");
}

/// A closed room of one floor and one ceiling, and a sheet without thickness across it.
fn a_sheet_on_one_floor_keeps_light_on_its_side() {
    let light = Light::Point {
        position: Vec3::new(-1.5, 1.5, 0.3),
        luminous_power: 6000.0,
        range: 30.0,
        color: [1.0; 3],
    };
    let mut stage = set::bare(vec![light], set::radiance_options(192, 108, Component::Indirect));
    let white = || meshes::diffuse(0.8, 0.8, 0.8);
    for (center, size) in [
        (Vec3::new(0.0, -0.1, 0.0), Vec3::new(6.4, 0.2, 4.4)),
        (Vec3::new(0.0, 2.6, 0.0), Vec3::new(6.4, 0.2, 4.4)),
        (Vec3::new(-3.1, 1.25, 0.0), Vec3::new(0.2, 2.7, 4.4)),
        (Vec3::new(3.1, 1.25, 0.0), Vec3::new(0.2, 2.7, 4.4)),
        (Vec3::new(0.0, 1.25, -2.1), Vec3::new(6.4, 2.7, 0.2)),
        (Vec3::new(0.0, 1.25, 2.1), Vec3::new(6.4, 2.7, 0.2)),
    ] {
        meshes::spawn_box(&mut stage, center, size, white());
    }
    // No thicker than rounding, and through floor and ceiling.
    meshes::spawn_box(&mut stage, Vec3::new(0.013, 1.25, 0.0), Vec3::new(1e-4, 2.6, 4.2), white());
    set::apply(&mut stage, CACHED);
    let lit = |stage: &mut Stage| {
        set::look(stage, Vec3::new(-2.8, 1.8, 1.5), Vec3::new(0.0, 0.2, -0.8));
        set::radiance(stage).mean()
    };
    let bright = lit(&mut stage);
    let mut darkest: f64 = 0.0;
    for eye in [Vec3::new(2.8, 1.8, 1.5), Vec3::new(0.4, 0.5, 0.3), Vec3::new(0.3, 2.0, -1.0)] {
        set::look(&mut stage, eye, Vec3::new(0.0, eye.y - 0.4, eye.z - 0.8));
        for count in [1, 5, 40] {
            darkest = darkest.max(frames(&mut stage, count).mean());
        }
        lit(&mut stage);
    }
    println!("    lit side {bright:.2} nits, dark side at most {darkest:.6}");
    assert!(bright > 1.0 && darkest <= 1e-4 * bright, "{bright} {darkest}");
}

fn the_sphere_is_the_closed_form() {
    let mut stage =
        set::open(&set::scene("furnace"), set::radiance_options(96, 54, Component::Indirect));
    let expected = ALBEDO * direct_radiance() * (meshes::stored_albedo(ALBEDO) / ALBEDO).powi(2);
    set::apply(&mut stage, CACHED);
    set::look(&mut stage, Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.0, 0.4, -2.0));
    let (most, mean) = deviation(&set::radiance(&mut stage), expected);
    println!("    off by at most {:.2} %, {:.2} % in the mean", most * 100.0, mean * 100.0);
    assert!(most <= 0.05 && mean <= 0.02, "{most} {mean}");
}

/// Rays that found cells so far, and places that were lit.
fn counters(stage: &Stage) -> Vec<u8> {
    let state = inspect::gpu_state(stage.render_world());
    let cache = state.cameras.first().and_then(|camera| camera.cache.clone());
    let [keys, _] = cache.expect("a camera with a cache");
    let bytes = gpu::read_buffer(stage.render_world(), &keys);
    bytes[bytes.len() - 16..].to_vec()
}

fn it_settles_and_then_does_nothing() {
    let mut stage = corner(vec![sun(Vec3::new(0.1, -1.0, -0.1))]);
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    set::apply(&mut stage, CACHED);
    set::radiance(&mut stage);
    set::look(&mut stage, Vec3::new(0.3, 1.2, 3.0), Vec3::new(0.0, 0.8, -2.0));
    let before = counters(&stage);
    stage.frame();
    assert!(counters(&stage) != before, "a camera that moves lights cells");
    let image = frames(&mut stage, 119);
    let settled = counters(&stage);
    stage.frame();
    let counts = set::gathered(&stage);
    assert!(counts.cameras == 0 && counts.rays == 0 && counts.pairs == 0, "{counts:?}");
    assert!(frames(&mut stage, 3) == image && counters(&stage) == settled);
}

fn two_runs_are_alike() {
    let run = || {
        let mut stage = set::open(
            &set::scene("courtyard"),
            set::radiance_options(128, 72, Component::Indirect),
        );
        set::apply(&mut stage, CACHED);
        set::look(&mut stage, Vec3::new(4.9, 2.0, 2.2), Vec3::new(-4.0, 1.8, -3.4));
        stage.get_ready().expect("a ready stage");
        set::apply(&mut stage, CACHED);
        (0..20)
            .map(|step| {
                let eye = Vec3::new(4.9 - 0.05 * step as f32, 2.0, 2.2);
                set::look(&mut stage, eye, Vec3::new(-4.0, 1.8, -3.4));
                frames(&mut stage, 1)
            })
            .collect::<Vec<_>>()
    };
    let (first, second) = (run(), run());
    let differ = first.iter().zip(&second).position(|(a, b)| a != b);
    assert_eq!(differ, None, "the first frame that differs");
    assert!(first[19].mean() > 1.0);
}

/// `grid.wgsl` on the CPU.
mod grid {
    use bevy::math::{IVec2, Vec2, Vec3, Vec3Swizzles};

    fn mixed(value: u32) -> u32 {
        let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        (word >> 22) ^ word
    }

    pub(super) fn size(level: u32) -> f32 {
        0.0437 * (level as f32).exp2()
    }

    /// The check of the cell of an axis-aligned face.
    pub(super) fn check(square: IVec2, height: f32, normal: Vec3, level: u32) -> u32 {
        let axis = normal.abs().to_array().iter().position(|part| *part > 0.5).expect("an axis");
        let faces_up = u32::from(normal.element_sum() > 0.0);
        let class = ((axis as u32 * 2 + faces_up) * 3 + 1) * 3 + 1;
        let layer = (height / size(level) + 0.37).floor() as i32;
        let words = [square.x as u32, square.y as u32, layer as u32, class * 32 + level];
        let inner = mixed(words[1].wrapping_add(mixed(words[0].wrapping_add(1))));
        let middle = mixed(words[2].wrapping_add(inner));
        mixed(words[3].wrapping_add(middle)).max(1)
    }

    /// A point along the two axes of a face's squares, and along its own.
    pub(super) fn seen(point: Vec3, normal: Vec3) -> (Vec2, f32) {
        let point = if normal.y.abs() > 0.5 {
            point.xzy()
        } else if normal.x.abs() > 0.5 {
            point.yzx()
        } else {
            point
        };
        (point.xy(), point.z)
    }
}

/// Every cell of the table lies on a face of the two boxes in view.
fn cells_lie_where_they_should() {
    let mut stage = corner(vec![sun(Vec3::new(0.1, -1.0, -0.1))]);
    set::apply(&mut stage, CACHED);
    set::radiance(&mut stage);
    let state = inspect::gpu_state(stage.render_world());
    let [keys, cells] = state.cameras[0].cache.clone().expect("a cache");
    let [keys, cells] =
        [keys, cells].map(|buffer| gpu::words(&gpu::read_buffer(stage.render_world(), &buffer)));
    let slots = cells.len() / 6;
    assert!(slots.is_power_of_two() && keys.len() == slots + 4);
    let mut expected = BTreeSet::new();
    for (center, extent) in [
        (Vec3::new(0.0, -0.1, 0.0), Vec3::new(4.0, 0.2, 4.0)),
        (Vec3::new(0.0, 1.0, -2.0), Vec3::new(4.0, 2.0, 0.2)),
    ] {
        for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            let (middle, height) = grid::seen(center + normal * extent / 2.0, normal);
            let half = grid::seen(extent, normal.abs()).0 / 2.0;
            for level in 0..6 {
                // Cells around a point may lie beyond the edge.
                let range = |at: f32, half: f32| {
                    let of = |x: f32| (x / grid::size(level)).floor() as i32;
                    of(at - half) - 1..=of(at + half) + 1
                };
                for x in range(middle.x, half.x) {
                    for y in range(middle.y, half.y) {
                        expected.insert(grid::check((x, y).into(), height, normal, level));
                    }
                }
            }
        }
    }
    let found: BTreeSet<u32> = keys[..slots].iter().copied().filter(|key| *key != 0).collect();
    let strange = found.difference(&expected).count();
    let lit = cells.chunks_exact(6).filter(|cell| cell[3] > 0).count();
    println!("    {} cells, {lit} lit, {strange} elsewhere", found.len());
    assert!(found.len() > 300 && lit > 200, "{} {lit}", found.len());
    // Rounded normals and depths at edges.
    assert!(strange * 100 <= found.len(), "{strange} of {}", found.len());
}

fn a_cut_begins_anew() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let mut after_cut = || {
        set::apply(&mut stage, CACHED);
        frames(&mut stage, 5)
    };
    after_cut();
    frames(&mut stage, 30);
    let mut again = || {
        set::apply(&mut stage, CACHED);
        frames(&mut stage, 5)
    };
    let first = again();
    assert!(first.mean() > 1.0);
    assert!(again() == first);
}

fn light_follows_what_changes() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let lid = meshes::spawn_box(
        &mut stage,
        Vec3::new(0.0, 6.0, 30.0),
        Vec3::new(6.0, 0.1, 6.0),
        meshes::diffuse(0.0, 0.0, 0.0),
    );
    set::apply(&mut stage, CACHED);
    let open = set::radiance(&mut stage).mean();
    stage.world_mut().get_mut::<Transform>(lid).expect("the lid").translation.z = 0.0;
    let soon = frames(&mut stage, 12).mean();
    let later = frames(&mut stage, 60).mean();
    println!("    {open:.2} nits, under the lid {soon:.3} after 12 frames, {later:.5} after 72");
    assert!(open > 1.0 && soon < 0.4 * open && later < 0.005 * open, "{open} {soon} {later}");
    stage.world_mut().get_mut::<Transform>(lid).expect("the lid").translation.z = 30.0;
    let again = frames(&mut stage, 80).mean();
    assert!((again / open - 1.0).abs() < 0.05, "{again} {open}");
}

fn nothing_to_light_is_no_light() {
    let mut stage = corner(vec![]);
    set::apply(&mut stage, CACHED);
    assert_eq!(set::radiance(&mut stage).mean(), 0.0);
    assert_costs_nothing(&mut stage);
    let mut stage =
        set::bare(vec![sun(Vec3::NEG_Y)], set::radiance_options(48, 27, Component::Full));
    set::apply(&mut stage, CACHED);
    assert_eq!(set::radiance(&mut stage).mean(), 0.0);
    let counts = set::gathered(&stage);
    assert_eq!((counts.rays, counts.cameras), (0, 0), "an empty scene");
    // Away from all surfaces, and a pixel on none.
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    set::apply(&mut stage, CACHED);
    set::look(&mut stage, Vec3::new(0.0, 1.2, 3.0), Vec3::new(0.0, 9.0, 30.0));
    assert_eq!(set::radiance(&mut stage).mean(), 0.0);
    // A thousand kilometres away nothing lies where it should, but all is finite.
    set::look(&mut stage, Vec3::new(1e6, 1.2, 3.0), Vec3::new(1e6, 0.8, -2.0));
    assert!(set::radiance(&mut stage).rgb.iter().flatten().all(|value| value.is_finite()));
    set::apply(&mut stage, &format!("{PLAIN},gi_vpl_count=0"));
    stage.frame();
    assert_costs_nothing(&mut stage);
}

fn rays_are_fewer_than_those_of_the_next_level() {
    assert_eq!(
        GiVisibility::ALL,
        [GiVisibility::None, GiVisibility::Cached, GiVisibility::Coarse, GiVisibility::Fine]
    );
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let mut counts = |visibility: &str| -> GiCounts {
        set::apply(
            &mut stage,
            &format!("{CACHED},gi_visibility={visibility},gi_pixel_fraction=1/16"),
        );
        stage.get_ready().expect("a ready stage");
        set::gathered(&stage)
    };
    let [none, cached, coarse, fine] = ["none", "cached", "coarse", "fine"].map(&mut counts);
    let rays = [none, cached, coarse, fine].map(|counts| counts.rays);
    println!("    {rays:?} rays, {} bytes", cached.bytes);
    assert!(rays[0] == 0 && rays.windows(2).all(|pair| pair[0] < pair[1]), "{rays:?}");
    assert!(cached.bytes < coarse.bytes + (12 << 20));
}
