//! The shipped compute shaders on synthetic buffers, against CPU references in 64-bit floats.
//! `extremes` tests them at extreme values.

use bevy::math::Vec3;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized,
};
use bevy::render::render_resource::{BindGroupEntries, BindGroupLayoutEntries, ShaderStages};
use frugal::stage::{Component, Stage};
use frugal_tests::gather::{Gather, irradiance, plan_bytes};
use frugal_tests::gpu::{self, Point};
use frugal_tests::kernel::{self, Kernel};
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};
use frugal_tests::set;

tests!(
    the_gather_is_the_sum_over_vpls,
    sampling_follows_flux,
    sampling_by_importance_keeps_the_expectation,
    sampling_dark_texels_gives_no_flux
);

fn stage() -> Stage {
    set::bare(vec![], set::radiance_options(32, 18, Component::Indirect))
}

const VPLS: [Point; 4] = [
    Point {
        position: [0.3, 2.0, 1.5],
        normal: [0.0, -1.0, 0.0],
        flux: [900.0, 400.0, 50.0],
        extent: 1e10,
    },
    Point {
        position: [-2.0, 0.7, 3.0],
        normal: [0.6, 0.0, -0.8],
        flux: [10.0, 800.0, 300.0],
        extent: 0.05,
    },
    Point {
        position: [0.6, 0.2, 0.4],
        normal: [0.0, -0.6, -0.8],
        flux: [3000.0, 2000.0, 1000.0],
        extent: 0.5,
    },
    Point {
        position: [1.0, -1.0, -4.0],
        normal: [0.0, 1.0, 0.0],
        flux: [70_000.0, 500.0, 20.0],
        extent: 1e10,
    },
];

fn the_gather_is_the_sum_over_vpls() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (packed, normal) = g_buffer_normal(Vec3::new(-0.06, 0.6, 0.8));
    let size = [8, 8];
    let pixels = Pixels::new(&stage, size, &[packed; 64]);
    for (center, scale) in
        [(Vec3::ZERO, 1.0), (Vec3::ZERO, 1e-2), (Vec3::new(0.25, 0.5, -1.0), 1e6)]
    {
        let vpls = VPLS.map(|vpl| Point { extent: vpl.extent * scale, ..vpl });
        let plane = Plane { center, ..Plane::ORIGIN };
        let found = gather.run(&stage, &pixels, &plane, &vpls);
        let (mut worst, mut lit) = (0.0f64, 0);
        for (pixel, found) in (0..).zip(&found) {
            let expected = irradiance(
                &vpls,
                plane.position(size, pixel % 8, pixel / 8),
                normal,
                plane.exposure,
            );
            for channel in 0..3 {
                // Below the smallest normal half float, 6e-5, the format rounds more coarsely.
                if expected[channel] > 1e-4 {
                    worst = worst.max((found[channel] / expected[channel] - 1.0).abs());
                    lit += 1;
                }
            }
        }
        println!(
            "    bounds of {scale} times their own: off by at most {worst:.1e} over {lit} values"
        );
        // Half floats are rounded to the nearest, by up to 4.9e-4, or on a software driver down, by
        // up to 9.8e-4.
        assert!(worst < 1e-3 && lit > 100, "{worst}, {lit}");
    }
}

/// Samples VPLs from maps of equally long rows. A texel's weight is its luminance times the
/// `importance` of its index.
fn sample(
    stage: &mut Stage,
    texels: &[Point],
    length: u32,
    count: usize,
    importance: impl Fn(usize) -> f32,
) -> Vec<Point> {
    let (read, write) =
        (|| storage_buffer_read_only_sized(false, None), || storage_buffer_sized(false, None));
    let layout = BindGroupLayoutEntries::sequential(
        ShaderStages::COMPUTE,
        (read(), read(), write(), write(), write(), read()),
    );
    let kernels = ["accumulate_rows", "sample_vpls"]
        .map(|entry| Kernel::new(stage, "gi/vpl/sample.wgsl", entry, vec![], &layout));
    let row_count = texels.len() as u32 / length;
    let words: Vec<f32> = texels.iter().flat_map(|texel| texel.to_texel()).collect();
    let weights: Vec<f32> = texels
        .iter()
        .enumerate()
        .map(|(index, texel)| texel.luminance() as f32 * importance(index))
        .collect();
    let zeros = |floats: usize| gpu::bytes(&vec![0.0; floats]);
    let contents = [
        gpu::bytes(&words),
        gpu::row_table(row_count, length),
        gpu::bytes(&weights),
        zeros((row_count + row_count.div_ceil(64)) as usize),
        zeros(count * 12),
        // One set of all VPLs.
        plan_bytes(count as u32),
    ];
    let buffers = contents.map(|contents| kernel::buffer(stage, &contents));
    let [a, b, c, d, e, f] = buffers.each_ref().map(|buffer| buffer.as_entire_binding());
    let bindings = BindGroupEntries::sequential((a, b, c, d, e, f));
    for (kernel, groups) in kernels.iter().zip([row_count.div_ceil(64), count.div_ceil(64) as u32])
    {
        kernel.run(stage, &bindings, (groups, 1));
    }
    gpu::vpl_slots(&gpu::read_buffer(stage.render_world(), &buffers[4]))
}

/// A map of `rows` rows, in which each texel's position encodes its index.
fn texels(rows: u32, length: u32, scale: f32) -> Vec<Point> {
    let texel = |index: u32| {
        // An irregular pattern; a third of the texels is dark.
        let weight = (index.wrapping_mul(2_654_435_761) >> 24) as f32;
        let flux = if index.is_multiple_of(3) { 0.0 } else { weight * scale };
        Point {
            position: [index as f32, 0.0, 0.0],
            normal: [0.0, 1.0, 0.0],
            flux: [flux, 0.5 * flux, 2.0 * flux],
            extent: 1e-4,
        }
    };
    (0..rows * length).map(texel).collect()
}

fn sampling_follows_flux() {
    let mut stage = stage();
    for scale in [1.0, 1e-20, 1e20] {
        let texels = texels(100, 32, scale);
        let vpls = sample(&mut stage, &texels, 32, 1024, |_| 1.0);
        let (sampled, all) = (gpu::total_flux(&vpls), gpu::total_flux(&texels));
        let off = sampled[1] / all[1] - 1.0;
        println!("    fluxes of {scale:e}: off by {off:+.1e}");
        // All texels have the same colour, so that the flux of each channel is kept like luminance.
        assert!(off.abs() < 1e-4, "{scale}: {off}");
        for vpl in &vpls {
            let source = &texels[vpl.position[0] as usize];
            let turned = (0..3)
                .map(|axis| (source.normal[axis] - vpl.normal[axis]).abs())
                .fold(0.0, f32::max);
            // Normals are packed to 16 bits an axis.
            assert!(source.flux[0] > 0.0 && turned < 5e-5, "a dark texel was sampled: {vpl:?}");
        }
        // The number of samples in a row is proportional to its flux, up to one VPL at each end.
        for (row, texels_of_row) in texels.chunks_exact(32).enumerate() {
            let share = 1024.0 * gpu::total_flux(texels_of_row)[1] / all[1];
            let sampled =
                vpls.iter().filter(|vpl| vpl.position[0] as usize / 32 == row).count() as f64;
            assert!(
                (sampled - share).abs() <= 1.01,
                "row {row}: {sampled} sampled, {share} expected"
            );
        }
    }
}

fn sampling_by_importance_keeps_the_expectation() {
    let mut stage = stage();
    let texels = texels(100, 32, 1.0);
    // The middle is a hundred times as important.
    let matters = |index: usize| (1200..2000).contains(&index);
    let vpls =
        sample(&mut stage, &texels, 32, 1024, |index| if matters(index) { 100.0 } else { 1.0 });
    let sum = |points: &[Point], inside: bool| {
        points
            .iter()
            .filter(|p| matters(p.position[0] as usize) == inside)
            .map(|p| f64::from(p.flux[1]))
            .sum::<f64>()
    };
    let inside = vpls.iter().filter(|vpl| matters(vpl.position[0] as usize)).count();
    let off = [true, false].map(|inside| sum(&vpls, inside) / sum(&texels, inside) - 1.0);
    println!(
        "    {inside} of 1024 sampled in the important texels; flux there off by {:+.2} %, elsewhere by {:+.1} %",
        off[0] * 100.0,
        off[1] * 100.0
    );
    assert!(inside > 950, "{inside}");
    // About 30 VPLs represent the rest.
    assert!(off[0].abs() < 0.01 && off[1].abs() < 0.2, "{off:?}");
}

fn sampling_dark_texels_gives_no_flux() {
    let mut stage = stage();
    let vpls = sample(&mut stage, &texels(64, 16, 0.0), 16, 64, |_| 1.0);
    assert!(
        vpls.iter()
            .all(|vpl| vpl.flux == [0.0; 3] && vpl.position.iter().all(|value| value.is_finite()))
    );
}
