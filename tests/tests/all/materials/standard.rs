//! Bevy's standard material: colours, kinds of light and sides.

use bevy::color::{Color, LinearRgba};
use bevy::light::NotShadowCaster;
use bevy::math::{Quat, Vec3};
use bevy::mesh::Mesh;
use bevy::pbr::StandardMaterial;
use bevy::prelude::AlphaMode;
use bevy::render::render_resource::TextureFormat;
use bevy_frugal_gi::gi::{FrugalGi, GiShading};
use frugal::scene::{Geometry, SceneDescription};
use frugal::stage::Component;
use frugal_tests::{gpu, meshes, set};

use super::{GREY, Placement, on_bench, relative_albedo};

tests!(
    a_diffuse_plate_sends_receives_and_occludes,
    a_texture_sends_and_receives_its_colours_where_they_are,
    vertex_colours_tint_sent_and_received_light,
    metals_reflect_no_diffuse_light_but_occlude,
    emission_lights_the_wall_like_reflected_sunlight,
    a_scene_s_emission_is_in_nits,
    rough_metals_and_gloss_reflect_as_bevy_shades_them,
    masked_materials_are_lit_as_opaque_ones_are,
    unlit_materials_occlude_only,
    sides_are_those_that_bevy_draws,
    transparent_materials_neither_reflect_nor_occlude,
    meshes_that_cast_no_shadow_only_receive_light,
);

fn grey() -> StandardMaterial {
    meshes::diffuse(GREY, GREY, GREY)
}

fn a_diffuse_plate_sends_receives_and_occludes() {
    on_bench(|bench| {
        let reference = bench.reference();
        println!(
            "    wall {:.1} nits, received {:.1} nits",
            reference.source.wall[1], reference.received[1]
        );
        assert!(
            reference.source.wall[1] > 10.0 && reference.received[1] > 10.0,
            "the bench is lit: {reference:?}"
        );
        assert!(reference.source.normal.abs_diff_eq(Vec3::Y, 1e-3), "{reference:?}");
        let found = bench.measure_plate("another colour", meshes::diffuse(0.9, 0.25, 0.0));
        found.assert_diffuse("another colour", [0.9, 0.25, 0.0]);
    });
}

fn a_texture_sends_and_receives_its_colours_where_they_are() {
    on_bench(|bench| {
        let colours = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]];
        let texture =
            meshes::texture(&mut bench.stage, TextureFormat::Rgba8UnormSrgb, 2, 2, &colours);
        let material = StandardMaterial {
            base_color_texture: Some(texture),
            ..meshes::diffuse(1.0, 1.0, 1.0)
        };
        let plate = bench.sample(meshes::plate(true), material);
        let reference = bench.reference();
        let white = relative_albedo(1.0);
        let expect = |quadrant: usize, channel: usize| {
            if colours[quadrant][channel] > 0 { white } else { 0.0 }
        };

        bench.as_source(plate, Placement::Floor);
        let (texels, _) = bench.middle();
        for quadrant in 0..4 {
            // Texture coordinates run along x and z.
            let inside = |point: &&gpu::Point| {
                (point.position[0] > 0.0, point.position[2] > 0.0)
                    == (quadrant % 2 == 1, quadrant / 2 == 1)
            };
            let there: Vec<_> = texels.iter().filter(inside).copied().collect();
            for channel in 0..3 {
                let sent = gpu::total_flux(&there)[channel]
                    / super::across(&there)
                    / reference.source.flux[channel];
                assert!(
                    (sent - expect(quadrant, channel)).abs() < 1e-4,
                    "quadrant {quadrant}, channel {channel}: {sent}"
                );
            }
        }

        // Means of the image's quadrants relative to those of a grey plate. The light comes from
        // below and differs between them.
        bench.put(plate, Placement::Away);
        let grey = bench.plate(grey());
        let quadrants = |bench: &mut super::Bench, sample| {
            bench.put(sample, Placement::Wall);
            bench.look_at_wall(super::SETTINGS);
            let image = bench.stage.radiance().expect("an image");
            std::array::from_fn::<_, 4, _>(|quadrant| {
                let (x, y) = (quadrant % 2 * 16, quadrant / 2 * 9);
                // Without the rows and columns at the borders of two colours.
                let pixels = (y + 1..y + 8)
                    .flat_map(|row| (x + 1..x + 15).map(move |column| row * 32 + column));
                [0, 1, 2].map(|channel| {
                    pixels.clone().map(|pixel| f64::from(image.rgb[pixel][channel])).sum::<f64>()
                })
            })
        };
        let grey_quadrants = quadrants(bench, grey);
        bench.put(grey, Placement::Away);
        let found = quadrants(bench, plate);
        for quadrant in 0..4 {
            for channel in 0..3 {
                let received = found[quadrant][channel] / grey_quadrants[quadrant][channel];
                assert!(
                    (received - expect(quadrant, channel)).abs() < 4e-3,
                    "quadrant {quadrant}, channel {channel}: {received}"
                );
            }
        }
        let occluded = bench.as_occluder(plate);
        println!("    occludes {occluded:.3}");
        assert!(occluded > 0.95, "{occluded}");
        bench.clear(plate);
        bench.clear(grey);
    });
}

fn vertex_colours_tint_sent_and_received_light() {
    on_bench(|bench| {
        let mesh = meshes::plate(false)
            .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, vec![[0.2f32, 1.0, 0.6, 1.0]; 4]);
        let plate = bench.sample(mesh, grey());
        let effect = bench.measure(plate);
        bench.clear(plate);
        bench
            .relative("vertex colours", effect)
            .assert_diffuse("vertex colours", [0.2, 1.0, 0.6].map(|tint| tint * f64::from(GREY)));
    });
}

fn metals_reflect_no_diffuse_light_but_occlude() {
    on_bench(|bench| {
        for (metallic, left) in [(0.4, 0.6), (1.0, 0.0)] {
            let label = format!("metallic {metallic}");
            let found = bench.measure_plate(&label, StandardMaterial { metallic, ..grey() });
            found.assert_covers(&label, 1.0);
            found.assert_occludes(&label, true);
            for (role, value) in [
                ("sends", found.sent[0]),
                ("lights the wall", found.wall[0]),
                ("receives", found.received[0]),
            ] {
                assert!((value - left).abs() < 4e-3, "{label}: {role} {value}");
            }
        }
    });
}

fn rough_metals_and_gloss_reflect_as_bevy_shades_them() {
    on_bench(|bench| {
        // Vertical light on a rough metal, which absorbs some of it, and on a glossy dielectric,
        // relative to a diffuse surface, which both shading models treat alike.
        let diffuse_plate =
            bench.plate(StandardMaterial { perceptual_roughness: 0.7, reflectance: 0.0, ..grey() });
        let metal =
            bench.plate(StandardMaterial { metallic: 1.0, perceptual_roughness: 0.7, ..grey() });
        let gloss =
            bench.plate(StandardMaterial { perceptual_roughness: 0.7, reflectance: 1.0, ..grey() });
        let sent = |bench: &mut super::Bench, plate| {
            let flux = bench.as_source(plate, Placement::Floor).flux[1];
            bench.put(plate, Placement::Away);
            flux
        };
        let lambertian = [diffuse_plate, metal, gloss].map(|plate| sent(bench, plate));
        let camera = set::camera(&mut bench.stage);
        let shade = |bench: &mut super::Bench, shading| {
            bench
                .stage
                .world_mut()
                .get_mut::<FrugalGi>(camera)
                .expect("a camera with GI")
                .shading = shading;
        };
        shade(bench, GiShading::Standard);
        let standard = [diffuse_plate, metal, gloss].map(|plate| sent(bench, plate));
        shade(bench, GiShading::Lambertian);
        println!("    sent with Lambertian shading {lambertian:.0?}, with Bevy's {standard:.0?}");
        let [diffuse, metallic, glossy] = [0, 1, 2].map(|plate| standard[plate] / lambertian[0]);
        // Sums of pixels of two images, whose roundings need not cancel.
        assert!((lambertian[1] / lambertian[0]).abs() < 1e-6, "{lambertian:?}");
        assert!(
            (lambertian[2] / lambertian[0] - 1.0).abs() < 1e-6 && (diffuse - 1.0).abs() < 0.02,
            "{lambertian:?} {standard:?}"
        );
        // The metal reflects about as much as the diffuse surface of that colour, minus the loss
        // between its facets; the glossy surface adds about 0.16 to an albedo of 0.5.
        assert!((0.7..1.0).contains(&metallic), "{metallic}");
        assert!((1.15..1.4).contains(&glossy), "{glossy}");
        for plate in [diffuse_plate, metal, gloss] {
            bench.clear(plate);
        }
    });
}

fn masked_materials_are_lit_as_opaque_ones_are() {
    // Without GI: Bevy itself would render masked materials a second time over their own light.
    let mut found = Vec::new();
    for alpha_mode in [AlphaMode::Opaque, AlphaMode::Mask(0.5)] {
        let mut stage = set::bare(
            vec![crate::gi::sun(Vec3::NEG_Y)],
            set::radiance_options(32, 18, Component::Direct),
        );
        let double = StandardMaterial { alpha_mode, double_sided: true, cull_mode: None, ..grey() };
        let plate =
            meshes::spawn(&mut stage, meshes::plate(true), double, Placement::Floor.transform());
        set::apply(&mut stage, "min,resolution_scale=100%");
        set::look(&mut stage, Vec3::new(0.0, 1.0, 0.5), Vec3::ZERO);
        found.push(set::channel_means(&set::radiance(&mut stage)));
        assert!(stage.world_mut().despawn(plate));
    }
    println!("    {:.1} and {:.1} nits", found[0][1], found[1][1]);
    assert!(
        found[0][1] > 1.0
            && found.iter().flatten().all(|value| (value / found[0][1] - 1.0).abs() < 1e-3),
        "{found:?}"
    );
}

fn emission_lights_the_wall_like_reflected_sunlight() {
    on_bench(|bench| {
        // 100 nits at the bench's exposure: Bevy's deferred renderer ignores
        // `emissive_exposure_weight`. The exitance is 314 lm/m², a sixteenth of the sunlight that
        // the plate reflects.
        let emissive = LinearRgba::rgb(100.0 / (1.2 * 256.0), 0.0, 0.0);
        let added = 100.0 * std::f64::consts::PI / bench.reference().source.flux[0];
        let found = bench.measure_plate("emissive", StandardMaterial { emissive, ..grey() });
        found.assert_covers("emissive", 1.0);
        found.assert_occludes("emissive", true);
        assert!(
            (found.wall[0] / found.wall[1] - 1.0 - added).abs() < 0.1 * added,
            "{added} {:?}",
            found.wall
        );
        found.assert_receives("emissive", [f64::from(GREY); 3]);
        // Other VPLs are sampled than without emission.
        assert!((found.wall[2] - 1.0).abs() < 0.03, "{:?}", found.wall);
    });
}

/// An emissive square of 8 m in front of the eye.
const EMISSIVE_SQUARE: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
 "meshes":[{"primitives":[{"attributes":{"POSITION":1},"indices":0,"material":0}]}],
 "materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0,0,0,1],"metallicFactor":0},"emissiveFactor":[1,0.5,0.25]}],
 "accessors":[{"bufferView":0,"componentType":5121,"count":6,"type":"SCALAR"},
  {"bufferView":1,"componentType":5126,"count":4,"type":"VEC3","min":[-4,-4,-1],"max":[4,4,-1]}],
 "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":6},{"buffer":0,"byteOffset":8,"byteLength":48}],
 "buffers":[{"byteLength":56,"uri":"data:application/octet-stream;base64,AAECAAIDAAAAAIDAAACAwAAAgL8AAIBAAACAwAAAgL8AAIBAAACAQAAAgL8AAIDAAACAQAAAgL8="}]}"#;

fn a_scene_s_emission_is_in_nits() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("emissive.gltf");
    std::fs::write(&file, EMISSIVE_SQUARE).expect("a file");
    let mut scene = SceneDescription::new(Geometry::Gltf(file.to_string_lossy().into_owned()));
    for ev100 in [0.0, 8.0] {
        scene.exposure_ev100 = ev100;
        let mut stage = set::open(&scene, set::radiance_options(32, 18, Component::Full));
        stage.place(Vec3::ZERO, Quat::IDENTITY);
        let found = set::channel_means(&set::radiance(&mut stage));
        println!("    {found:.4?} nits at EV {ev100}");
        for (found, expected) in found.into_iter().zip([1.0, 0.5, 0.25]) {
            // The G-buffer stores nine bits per channel with a shared exponent.
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "{found}, {expected} expected at EV {ev100}"
            );
        }
    }
}

fn unlit_materials_occlude_only() {
    on_bench(|bench| {
        let found = bench.measure_plate("unlit", StandardMaterial { unlit: true, ..grey() });
        found.assert_covers("unlit", 1.0);
        found.assert_sends("unlit", [0.0; 3]);
        found.assert_receives("unlit", [0.0; 3]);
        found.assert_occludes("unlit", true);
    });
}

fn sides_are_those_that_bevy_draws() {
    on_bench(|bench| {
        let reference = bench.reference();
        let mut upside_down = |double_sided, cull_back: bool| {
            let material = StandardMaterial {
                double_sided,
                cull_mode: grey().cull_mode.filter(|_| cull_back),
                ..grey()
            };
            let plate = bench.plate(material);
            let source = bench.as_source(plate, Placement::FloorUpsideDown);
            // Facing away from the floor; rays intersect both sides.
            bench.put(plate, Placement::Wall);
            let mut transform = bench
                .stage
                .world_mut()
                .get_mut::<bevy::transform::components::Transform>(plate)
                .expect("a plate");
            transform.rotate_y(std::f32::consts::PI);
            let behind = bench.behind();
            bench.clear(plate);
            (source, 1.0 - behind / super::OPEN_WALL.get().expect("the reference was measured"))
        };
        let flux = |source: super::Source| source.flux[0] / reference.source.flux[0];

        let (single, occluded) = upside_down(false, true);
        println!("    back of a single side: covers {}, occludes {occluded:.3}", single.covered);
        assert_eq!(single.covered, 0.0, "invisible to the light as to the eye");
        assert!(occluded > 0.95, "but not to rays: {occluded}");

        let (double, occluded) = upside_down(true, false);
        println!(
            "    back of a double side: covers {}, normal {}, occludes {occluded:.3}",
            double.covered, double.normal
        );
        assert!(
            double.covered == 1.0
                && double.normal.abs_diff_eq(Vec3::Y, 1e-3)
                && (flux(double) - 1.0).abs() < 1e-4,
            "{double:?}"
        );
        assert!(
            (double.wall[0] / reference.source.wall[0] - 1.0).abs() < 2e-3 && occluded > 0.95,
            "{double:?} {occluded}"
        );

        // Bevy leaves such a side dark under direct light. In GI its light leaves on the other
        // side.
        let (bare, occluded) = upside_down(false, false);
        println!(
            "    back of a single side without culling: covers {}, normal {}, occludes {occluded:.3}",
            bare.covered, bare.normal
        );
        assert!(
            bare.covered == 1.0
                && bare.normal.abs_diff_eq(Vec3::NEG_Y, 1e-3)
                && (flux(bare) - 1.0).abs() < 1e-4,
            "{bare:?}"
        );
        assert!(
            bare.wall[0] < 0.1 * reference.source.wall[0] && occluded > 0.95,
            "{bare:?} {occluded}"
        );
    });
}

fn transparent_materials_neither_reflect_nor_occlude() {
    on_bench(|bench| {
        let blended = |alpha_mode| StandardMaterial {
            alpha_mode,
            base_color: Color::linear_rgba(GREY, GREY, GREY, 0.9),
            ..grey()
        };
        let materials = [
            ("blended", blended(AlphaMode::Blend)),
            ("added", blended(AlphaMode::Add)),
            ("transmissive", StandardMaterial { specular_transmission: 0.9, ..grey() }),
        ];
        for (label, material) in materials {
            let plate = bench.plate(material);
            let source = bench.as_source(plate, Placement::Floor);
            let occluded = bench.as_occluder(plate);
            bench.clear(plate);
            let share = bench.share_of_open_floor(&source);
            println!(
                "    {label}: covers {}, lets through {share:.3}, occludes {occluded:.3}",
                source.covered
            );
            assert_eq!(source.covered, 0.0, "{label}");
            assert!(
                (share - 1.0).abs() < 2e-3 && occluded.abs() < 0.02,
                "{label}: {share} {occluded}"
            );
        }
    });
}

fn meshes_that_cast_no_shadow_only_receive_light() {
    on_bench(|bench| {
        let plate = bench.plate(grey());
        bench.stage.world_mut().entity_mut(plate).insert(NotShadowCaster);
        let effect = bench.measure(plate);
        bench.clear(plate);
        let found = bench.relative("casting no shadow", effect);
        found.assert_covers("source", 0.0);
        found.assert_receives("receiver", [f64::from(GREY); 3]);
        found.assert_occludes("occluder", false);
    });
}
