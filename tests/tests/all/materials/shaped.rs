//! Changes of a mesh's shape or appearance: normal maps, alpha masks, skins and morphs.

use bevy::camera::visibility::NoFrustumCulling;
use bevy::ecs::entity::Entity;
use bevy::math::{Vec2, Vec3};
use bevy::mesh::Mesh;
use bevy::mesh::morph::{MeshMorphWeights, MorphAttributes};
use bevy::pbr::StandardMaterial;
use bevy::prelude::{AlphaMode, Meshable, Plane3d, Transform};
use bevy::render::render_resource::TextureFormat;
use frugal_tests::meshes;

use super::{Bench, GREY, Placement, on_bench};

tests!(
    a_normal_map_tilts_sent_and_received_light,
    holes_of_a_mask_let_light_and_rays_through,
    a_skin_follows_its_joint,
    a_joint_takes_its_part_of_an_occluder_along,
    a_morph_follows_its_weights_but_occludes_at_the_original_position,
);

fn grey() -> StandardMaterial {
    meshes::diffuse(GREY, GREY, GREY)
}

/// A plate whose normal map tilts its normal by `tilt` (sines along x and z), and that normal after
/// quantisation to eight bits.
fn tilted(bench: &mut Bench, tilt: Vec2) -> (Entity, Vec3) {
    // Texture coordinates run along x and z; the second axis of a normal map runs along −z.
    let wanted = Vec3::new(tilt.x, -tilt.y, (1.0 - tilt.length_squared()).sqrt());
    let bits = wanted.to_array().map(|value| ((0.5 * value + 0.5) * 255.0).round() as u8);
    let stored = Vec3::from_array(bits.map(|bits| f32::from(bits) / 255.0 * 2.0 - 1.0)).normalize();
    let texture = meshes::texture(
        &mut bench.stage,
        TextureFormat::Rgba8Unorm,
        2,
        2,
        &[[bits[0], bits[1], bits[2], 255]; 4],
    );
    let mesh = meshes::plate(true).with_generated_tangents().expect("tangents of a plate");
    let plate =
        bench.sample(mesh, StandardMaterial { normal_map_texture: Some(texture), ..grey() });
    (plate, Vec3::new(stored.x, stored.z, -stored.y))
}

fn a_normal_map_tilts_sent_and_received_light() {
    on_bench(|bench| {
        // More VPLs than elsewhere, because the sampled VPLs depend on the normal.
        let settings = format!("{},gi_vpl_count=2048", super::SETTINGS);
        let mut received = Vec::new();
        for tilt in [Vec2::ZERO, Vec2::new(0.0, 0.6), Vec2::new(0.0, 0.8)] {
            let (plate, normal) = tilted(bench, tilt);
            let source = bench.as_source(plate, Placement::Floor);
            let reference = bench.reference();
            let sent = source.flux[1] / reference.source.flux[1];
            println!(
                "    tilt {tilt}: normal {}, sends {sent:.4}, wall {:.3}",
                source.normal,
                source.wall[1] / reference.source.wall[1]
            );
            assert!(source.normal.abs_diff_eq(normal, 2e-3), "{} is not {normal}", source.normal);
            // The flux is that without the map, and faces away from the wall.
            assert!(source.covered == 1.0 && (sent - 1.0).abs() < 1e-4, "{source:?}");
            assert!(tilt.y == 0.0 || source.wall[1] < 0.9 * reference.source.wall[1], "{source:?}");
            bench.put(plate, Placement::Wall);
            // In front of the wall, the plate's +z axis points down to the floor.
            received.push((normal, bench.look_at_wall(&settings)[1]));
            if tilt.y == 0.8 {
                let occluded = bench.as_occluder(plate);
                assert!(occluded > 0.95, "{occluded}");
            }
            bench.clear(plate);
        }
        // All light comes from the front of the flat and of both tilted planes, so that irradiance
        // is linear in the normal.
        let [(_, flat), (once, found), (twice, more)] = received[..] else {
            panic!("three normals")
        };
        let below = (found - f64::from(once.y) * flat) / f64::from(once.z);
        let expected = f64::from(twice.y) * flat + f64::from(twice.z) * below;
        println!(
            "    received {flat:.2}, {found:.2} and {more:.2} nits; {expected:.2} expected for the last"
        );
        assert!(
            found > 1.05 * flat && (more / expected - 1.0).abs() < 0.03,
            "{received:?}, {expected}"
        );
    });
}

fn holes_of_a_mask_let_light_and_rays_through() {
    on_bench(|bench| {
        let mut masked = |label: &str, alphas: [u8; 4], is_readable: bool| {
            let texels = alphas.map(|alpha| [128, 128, 128, alpha]);
            let texture =
                meshes::texture(&mut bench.stage, TextureFormat::Rgba8UnormSrgb, 2, 2, &texels);
            if !is_readable {
                meshes::keep_for_the_gpu(&mut bench.stage, &texture);
            }
            let material = StandardMaterial {
                base_color_texture: Some(texture),
                alpha_mode: AlphaMode::Mask(0.5),
                double_sided: true,
                cull_mode: None,
                ..meshes::diffuse(1.0, 1.0, 1.0)
            };
            let plate = bench.sample(meshes::plate(true), material);
            let effect = bench.measure(plate);
            bench.clear(plate);
            bench.relative(label, effect)
        };
        // The sRGB value 128, linear.
        let albedo = [0.215_860_5; 3];
        let solid = masked("a mask without holes", [255; 4], true);
        solid.assert_diffuse("a mask without holes", albedo);
        let half = masked("a mask with 50 % holes", [255, 0, 0, 255], true);
        let all = masked("a mask with 100 % holes", [0; 4], true);
        // The middle has about 26 texels per side; one row may lie on either half.
        assert!((half.covered - 0.5).abs() < 0.03, "{}", half.covered);
        assert!(
            (half.sent[1] - solid.sent[1]).abs() < 1e-4,
            "the opaque half sends as much per area: {:?}",
            half.sent
        );
        // The floor in the holes, which has a higher albedo, also lights the wall: half of the
        // plate and half of the floor light it, but from different distances.
        let open = all.wall[1];
        assert!(
            (half.wall[1] / (0.5 * (solid.wall[1] + open)) - 1.0).abs() < 0.05,
            "{:?} {open}",
            half.wall
        );
        // The mask is symmetric: the light through the holes of one side equals the occluded light
        // of the other.
        assert!(
            (half.occluded - 0.5 * solid.occluded).abs() < 0.02,
            "{} {}",
            half.occluded,
            solid.occluded
        );
        assert_eq!(all.covered, 0.0);
        all.assert_occludes("a plate of holes", false);
        let unread = masked("a mask with 50 % holes, kept for the GPU", [255, 0, 0, 255], false);
        assert!(
            (unread.occluded - half.occluded).abs() < 0.02,
            "the GPU reads it: {} {}",
            unread.occluded,
            half.occluded
        );
    });
}

fn a_skin_follows_its_joint() {
    on_bench(|bench| {
        let skin = bench.sample(meshes::with_joints(meshes::plate(false), |_| 0), grey());
        let joint = meshes::add_joints(&mut bench.stage, skin, 1)[0];
        let effect = bench.measure(joint);
        bench.clear(skin);
        bench.clear(joint);
        bench.relative("skin", effect).assert_diffuse("skin", [f64::from(GREY); 3]);
    });
}

/// Each joint moves its own part of an occluder: half of the plate goes away with its joint.
fn a_joint_takes_its_part_of_an_occluder_along() {
    on_bench(|bench| {
        let mesh = meshes::with_joints(halves(), |vertex| u16::from(vertex >= 4));
        let skin = bench.sample(mesh, grey());
        let joints = meshes::add_joints(&mut bench.stage, skin, 2);
        let whole = bench.as_occluder(joints[0]);
        let mut shift = |x: f32| {
            bench
                .stage
                .world_mut()
                .get_mut::<Transform>(joints[1])
                .expect("a joint")
                .translation
                .x = x;
            bench.as_occluder(joints[0])
        };
        let (half, again) = (shift(50.0), shift(0.0));
        bench.clear(skin);
        // Its child goes with it.
        bench.clear(joints[0]);
        println!("    both halves occlude {whole:.3}, one {half:.3}, both again {again:.3}");
        assert!(whole > 0.95, "{whole}");
        assert!((half - 0.5 * whole).abs() < 0.03, "{half} of {whole}");
        assert!((again - whole).abs() < 1e-3, "{again} of {whole}");
    });
}

/// A plate of two halves, four vertices each, along x.
fn halves() -> Mesh {
    let half = |x: f32| {
        let mesh: Mesh = Plane3d::default().mesh().size(0.5, 1.0).into();
        mesh.translated_by(Vec3::X * x).with_removed_attribute(Mesh::ATTRIBUTE_UV_0)
    };
    let mut mesh = half(-0.25);
    mesh.merge(&half(0.25)).expect("the same attributes");
    mesh
}

/// A plate displaced from its mesh by a morph target, by `offset` in local space.
fn morphed(bench: &mut Bench, offset: Vec3) -> Entity {
    let mut mesh: Mesh = meshes::plate(false);
    mesh.set_morph_targets(vec![
        MorphAttributes::new(offset, Vec3::ZERO, Vec3::ZERO);
        mesh.count_vertices()
    ]);
    let plate = bench.sample(mesh, grey());
    bench
        .stage
        .world_mut()
        .entity_mut(plate)
        .insert((MeshMorphWeights::Value { weights: vec![1.0] }, NoFrustumCulling));
    plate
}

fn a_morph_follows_its_weights_but_occludes_at_the_original_position() {
    on_bench(|bench| {
        // Displaced by 30 cm: above the floor upwards, in front of the wall towards the eye.
        let plate = morphed(bench, Vec3::new(0.0, 0.3, 0.0));
        let source = bench.as_source(plate, Placement::Floor);
        let (texels, _) = bench.middle();
        let height =
            texels.iter().map(|texel| texel.position[1]).sum::<f32>() / texels.len() as f32;
        let sent = source.flux[1] / bench.reference().source.flux[1];
        println!("    covers {}, at {height:.4} m, sends {sent:.4}", source.covered);
        assert!(
            source.covered == 1.0 && (height - 0.35).abs() < 1e-4 && (sent - 1.0).abs() < 1e-4,
            "{source:?} {height}"
        );
        let received = bench.as_receiver(plate)[1];
        let occluded = bench.as_occluder(plate);
        bench.clear(plate);

        // With its mesh 30 cm behind, inside the wall, the plate is rendered at the position of the
        // grey plate.
        let plate = morphed(bench, Vec3::new(0.0, 0.3, 0.0));
        let behind = |bench: &mut Bench| {
            let mut transform = Placement::Wall.transform();
            transform.translation.z -= 0.3;
            *bench.stage.world_mut().get_mut(plate).expect("a plate") = transform;
        };
        bench.as_occluder(plate);
        behind(bench);
        let drawn = bench.look_at_wall(super::SETTINGS)[1] / bench.reference().received[1];
        let still_open = 1.0 - bench.behind() / super::OPEN_WALL.get().expect("measured above");
        bench.clear(plate);
        println!(
            "    receives {received:.2} nits nearer; occludes {occluded:.3} where its mesh is, {still_open:.3} where it is drawn"
        );
        assert!(occluded > 0.95 && still_open.abs() < 0.02, "{occluded} {still_open}");
        assert!((drawn - 1.0).abs() < 4e-3, "{drawn}");
    });
}
