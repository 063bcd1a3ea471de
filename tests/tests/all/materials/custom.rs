//! Custom materials: extensions of Bevy's standard material, and others.

use bevy::color::{Color, LinearRgba};
use bevy::material::OpaqueRendererMethod;
use bevy::math::Vec4;
use bevy::pbr::{ExtendedMaterial, StandardMaterial};
use bevy::prelude::AlphaMode;
use frugal_tests::materials::{Deferred, Forward, ForwardTint, Shift, Tint, WithoutPrepass};
use frugal_tests::meshes;

use super::{GREY, on_bench};

tests!(
    an_extension_sends_and_receives_the_colour_that_it_gives,
    an_extension_that_moves_its_mesh_occludes_at_the_original_position,
    a_deferred_material_is_like_any_other,
    a_forward_material_occludes_only,
    a_material_without_prepass_covers_the_light_of_the_surface_behind,
);

const COLOR: LinearRgba = LinearRgba::rgb(0.1, 0.8, 0.4);
const ALBEDO: [f64; 3] = [0.1, 0.8, 0.4];

fn grey() -> StandardMaterial {
    meshes::diffuse(GREY, GREY, GREY)
}

fn an_extension_sends_and_receives_the_colour_that_it_gives() {
    on_bench(|bench| {
        let tinted = bench.measure_plate(
            "extended",
            ExtendedMaterial { base: grey(), extension: Tint { color: COLOR } },
        );
        tinted.assert_diffuse("extended", ALBEDO);
        // Bevy also renders it in the colour of its base.
        let forward = ExtendedMaterial { base: grey(), extension: ForwardTint { color: COLOR } };
        bench
            .measure_plate("extended for forward rendering only", forward)
            .assert_diffuse("forward", [f64::from(GREY); 3]);
        // It is transparent in the sun's map as in the image, but the occluders know the alpha mode
        // of Bevy's standard material only.
        let blend = StandardMaterial {
            alpha_mode: AlphaMode::Blend,
            base_color: Color::linear_rgba(GREY, GREY, GREY, 0.1),
            ..grey()
        };
        let plate = bench.plate(ExtendedMaterial { base: blend, extension: Tint { color: COLOR } });
        let source = bench.as_source(plate, super::Placement::Floor);
        let occluded = bench.as_occluder(plate);
        bench.clear(plate);
        println!("    extended and transparent: covers {}, occludes {occluded:.3}", source.covered);
        assert!(source.covered == 0.0 && occluded > 0.95, "{source:?} {occluded}");
    });
}

fn an_extension_that_moves_its_mesh_occludes_at_the_original_position() {
    on_bench(|bench| {
        let shift = |by| ExtendedMaterial { base: grey(), extension: Shift { by } };
        let plate = bench.plate(shift(Vec4::new(0.0, 0.3, 0.0, 0.0)));
        let source = bench.as_source(plate, super::Placement::Floor);
        let (texels, _) = bench.middle();
        let height =
            texels.iter().map(|texel| texel.position[1]).sum::<f32>() / texels.len() as f32;
        bench.clear(plate);
        // Displaced far below the floor, it still occludes the wall.
        let plate = bench.plate(shift(Vec4::new(0.0, -30.0, 0.0, 0.0)));
        let occluded = bench.as_occluder(plate);
        bench.clear(plate);
        println!(
            "    covers {} at {height:.4} m, occludes {occluded:.3} where it is not drawn",
            source.covered
        );
        assert!(
            source.covered == 1.0 && (height - 0.35).abs() < 1e-4 && occluded > 0.95,
            "{source:?} {height} {occluded}"
        );
        let sent = source.flux[1] / bench.reference().source.flux[1];
        assert!((sent - 1.0).abs() < 1e-4, "{sent}");
    });
}

fn a_deferred_material_is_like_any_other() {
    on_bench(|bench| {
        let found = bench.measure_plate("custom, deferred", Deferred { color: COLOR });
        found.assert_diffuse("custom, deferred", ALBEDO);
    });
}

fn a_forward_material_occludes_only() {
    on_bench(|bench| {
        let opaque_render_method = OpaqueRendererMethod::Forward;
        let custom = bench.measure_plate("custom, forward", Forward { color: COLOR });
        let standard = bench.measure_plate(
            "Bevy's own, forward",
            StandardMaterial { opaque_render_method, ..grey() },
        );
        // Bevy renders it forward, because its G-buffer cannot store it; and it is no occluder,
        // because it transmits light.
        let leaf = bench.measure_plate(
            "diffuse transmission",
            StandardMaterial { diffuse_transmission: 0.5, ..grey() },
        );
        for (label, found, occludes) in [
            ("custom", custom, true),
            ("Bevy's own", standard, true),
            ("diffuse transmission", leaf, false),
        ] {
            found.assert_covers(label, 1.0);
            found.assert_sends(label, [0.0; 3]);
            found.assert_receives(label, [0.0; 3]);
            found.assert_occludes(label, occludes);
        }
    });
}

fn a_material_without_prepass_covers_the_light_of_the_surface_behind() {
    on_bench(|bench| {
        let plate = bench.plate(WithoutPrepass { color: COLOR });
        let effect = bench.measure(plate);
        bench.clear(plate);
        let found = bench.relative("custom, without prepass", effect);
        found.assert_covers("custom, without prepass", 0.0);
        let share = bench.share_of_open_floor(&effect.source);
        assert!(
            (share - 1.0).abs() < 2e-3,
            "the floor under it reflects light as if unoccluded: {share}"
        );
        found.assert_receives("custom, without prepass", [0.0; 3]);
        found.assert_occludes("custom, without prepass", true);
    });
}
