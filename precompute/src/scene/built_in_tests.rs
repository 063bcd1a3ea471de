use std::path::PathBuf;

use frugal_trace::bsdf::Shading;
use frugal_trace::integrator::{Settings, Watch, render};
use frugal_trace::light::Light;
use frugal_trace::scene::{AlphaMode, CameraPose, SceneTexture, Side, Texels, sphere_directions};
use glam::{UVec2, Vec3};

use super::*;
use crate::scene::{Environment, Geometry, LoadedScene, SceneDescription, load};

/// The scene file of a name.
fn scene(name: &str) -> LoadedScene {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join(format!("../assets/scenes/{name}.scene.ron"));
    load(&file).unwrap_or_else(|error| panic!("{error}"))
}

/// The scene of a name, without light.
fn built_in(name: &str) -> LoadedScene {
    let description = SceneDescription::new(Geometry::Procedural(name.to_owned()));
    LoadedScene::new(description).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_scene_is_valid_and_within_its_budget() {
    for name in BUILT_IN {
        let geometry = built_in(name).geometry;
        assert_eq!(geometry.validate(), Ok(()), "{name}");
        let budget = if name == "furnace" { 6000 } else { 5000 };
        assert!(
            geometry.triangle_count() <= budget,
            "{name}: {} triangles",
            geometry.triangle_count()
        );
        assert!(geometry.materials.len() <= 3, "{name}: {} materials", geometry.materials.len());
        assert!(geometry.materials.iter().all(|material| material.base_color == [1.0; 4]));
        assert!(built_in(name).gaps.is_empty());
        for mesh in &geometry.meshes {
            assert!(
                mesh.uvs.iter().all(|uv| uv.is_finite())
                    && mesh.positions.iter().all(|position| position.is_finite()),
                "{name}"
            );
            assert!(
                mesh.colors.iter().flatten().all(|value| (0.0..=1.0).contains(value)),
                "{name}"
            );
            for triangle in mesh.indices.chunks_exact(3) {
                let [a, b, c] = [0, 1, 2].map(|i| mesh.positions[triangle[i] as usize]);
                let area = (b - a).cross(c - a);
                assert!(area.length() > 1e-8, "{name}: no area at {a} {b} {c}");
                for index in triangle {
                    let normal = mesh.normals[*index as usize];
                    assert!((normal.length() - 1.0).abs() < 1e-3, "{name}: normal {normal}");
                    assert!(
                        normal.dot(area.normalize()) > 0.5,
                        "{name}: normal {normal} is not its face's at {a} {b} {c}"
                    );
                }
            }
        }
    }
    assert_eq!(glb("no"), None);
}

#[test]
fn every_tour_stays_in_the_open_within_its_bounds_and_has_something_to_see() {
    for name in BUILT_IN {
        let scene = scene(name);
        assert_eq!(scene.description.geometry, Geometry::Procedural(name.into()));
        let (rays, bounds) = (&scene.rays, scene.camera_bounds());
        let tour = &scene.paths["tour"];
        assert!(
            (5.0..=6.0).contains(&tour.duration()) && (4..=8).contains(&tour.keys.len()),
            "{name}"
        );
        for frame in 0..=180 {
            let time = tour.start() + tour.duration() * frame as f32 / 180.0;
            let pose = tour.sample(time).unwrap();
            assert!(
                bounds.contains(pose.position),
                "{name} at {time} s: {} is out of bounds",
                pose.position
            );
            assert!(
                !rays.inside_geometry(pose.position),
                "{name} at {time} s: {} is inside",
                pose.position
            );
            assert!(rays.sees_geometry(
                pose.position,
                pose.rotation,
                scene.camera.vertical_fov.to_radians(),
                16.0 / 9.0
            ));
            // No geometry within the near plane's distance, which would clip walls.
            let least = sphere_directions(128)
                .filter_map(|direction| rays.closest(pose.position, direction, 1.0))
                .map(|hit| hit.distance)
                .fold(1.0, f32::min);
            assert!(
                least > scene.camera.near * 1.5,
                "{name} at {time} s: something is {least} m away"
            );
        }
    }
}

#[test]
fn the_furnace_is_closed_white_and_exactly_radial() {
    let geometry = built_in("furnace").geometry;
    assert_eq!(geometry.triangle_count(), 5120);
    let material = &geometry.materials[0];
    assert_eq!(
        (material.perceptual_roughness, material.reflectance, material.metallic),
        (1.0, 0.0, 0.0)
    );
    let mesh = &geometry.meshes[0];
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        assert!(
            (position.length() - 2.0).abs() < 1e-5 && (*position * -0.5).distance(*normal) < 1e-6
        );
    }
    assert!(mesh.colors.iter().all(|color| *color == [0.8, 0.8, 0.8, 1.0]));
}

#[test]
fn the_two_rooms_are_closed_and_apart() {
    let rays = built_in("two_rooms").rays;
    for (center, walls) in
        [(Vec3::new(-2.1, 1.5, 0.0), -4.1..=-0.1_f32), (Vec3::new(2.1, 1.5, 0.0), 0.1..=4.1)]
    {
        for direction in sphere_directions(5000) {
            let hit = rays.closest(center, direction, f32::INFINITY).unwrap();
            assert_eq!(hit.side, Side::Front);
            let x = (center + direction * hit.distance).x;
            assert!(
                x > walls.start() - 1e-3 && x < walls.end() + 1e-3,
                "a ray left its room to x = {x}"
            );
        }
    }
    assert!(rays.inside_geometry(Vec3::new(0.0, 1.5, 0.0)), "the dividing wall is solid");
}

#[test]
fn the_cornell_box_has_its_published_size_and_colors_on_the_right_sides() {
    let geometry = built_in("cornell").geometry;
    assert!(geometry.bounds().unwrap().size().distance(Vec3::new(5.528, 5.488, 5.592)) < 1e-4);
    let rays = built_in("cornell").rays;
    let color = |direction: Vec3| {
        let hit = rays.closest(Vec3::new(0.0, 4.5, 0.0), direction, f32::INFINITY).unwrap();
        assert_eq!(hit.side, Side::Front);
        let mesh = &geometry.meshes[hit.triangle.mesh];
        mesh.colors[mesh.indices[hit.triangle.index * 3] as usize]
    };
    let (left, right) = (color(Vec3::NEG_X), color(Vec3::X));
    assert!(
        left[0] > 4.0 * left[1] && right[1] > 3.0 * right[0],
        "red is to the left and green to the right of a viewer at +Z"
    );
    assert!(!rays.any(Vec3::new(0.0, 4.5, 0.0), Vec3::Z, f32::INFINITY), "the front is open");
}

#[test]
fn the_courtyard_has_cut_out_cloth_and_fine_textures() {
    let geometry = built_in("courtyard").geometry;
    let drapes = geometry
        .materials
        .iter()
        .find(|material| matches!(material.alpha, AlphaMode::Mask(_)))
        .unwrap();
    assert!(drapes.double_sided);
    let cloth = &geometry.textures[drapes.base_color_texture.unwrap().texture];
    let texels = |texture: &SceneTexture| match &texture.texels {
        Texels::Srgb(texels) => texels.clone(),
        other => panic!("{other:?}"),
    };
    let solid = texels(cloth).iter().filter(|texel| texel[3] >= 128).count() as f32;
    let share = solid / texels(cloth).len() as f32;
    assert!((0.75..0.97).contains(&share), "{share}");
    for texture in &geometry.textures {
        // Contrast of neighbours at full size.
        let luma: Vec<f32> = texels(texture).iter().map(|texel| f32::from(texel[1])).collect();
        let contrast = luma.windows(2).map(|pair| (pair[0] - pair[1]).abs()).sum::<f32>();
        assert!(contrast > 3.0 * luma.len() as f32, "{contrast}");
    }
}

#[test]
fn every_scene_can_be_path_traced() {
    let pictured = |scene: &LoadedScene, from: Vec3, to: Vec3, settings: &Settings| {
        let view = scene.view(CameraPose::looking_at(from, to), UVec2::new(16, 9));
        let traced = scene.reference().expect("a scene of our own");
        render(&traced, &view, settings, Watch::default()).expect("nothing interrupts")
    };
    let point_light = |position: Vec3, luminous_power: f32| Light::Point {
        position,
        luminous_power,
        range: 1e6,
        color: [1.0; 3],
    };
    let mut furnace = built_in("furnace");
    furnace.description.lights = vec![point_light(Vec3::ZERO, 20_000.0)];
    let settings = Settings {
        samples: 16,
        bounces: Some(1),
        shading: Shading::Lambertian,
        ..Settings::default()
    };
    let rendering = pictured(&furnace, Vec3::new(0.3, -0.2, 0.5), Vec3::X, &settings);
    let direct = 0.8 / std::f64::consts::PI * 20_000.0 / (4.0 * std::f64::consts::PI) / 4.0;
    assert!(
        (rendering.direct.mean() / direct - 1.0).abs() < 5e-3
            && (rendering.indirect.mean() / direct / 0.8 - 1.0).abs() < 5e-3
    );
    furnace.description.environment = Environment::Map("no/such/sky.hdr".to_owned(), 1.0);
    let refused = furnace.reference().expect_err("no such file").to_string();
    assert!(refused.contains("no/such/sky.hdr"), "{refused}");
    for name in BUILT_IN {
        let mut scene = built_in(name);
        scene.description.environment = Environment::Constant([10.0; 3]);
        scene.description.lights = vec![Light::Directional {
            direction: Vec3::new(-0.45, -1.0, -0.3),
            illuminance: 5e4,
            color: [1.0; 3],
        }];
        if name == "hall" {
            // Neither sun nor sky reaches into it.
            scene.description.lights.push(point_light(Vec3::new(1.5, 2.0, 1.0), 2e4));
        }
        let settings = Settings { samples: 2, ..Settings::default() };
        let (from, to) = (Vec3::new(0.0, 1.5, 2.0), Vec3::new(0.0, 1.0, 0.0));
        let rendering = pictured(&scene, from, to, &settings);
        for value in rendering.direct.rgb.iter().chain(&rendering.indirect.rgb).flatten() {
            assert!(value.is_finite() && *value >= 0.0, "{name}: {value}");
        }
        assert!(rendering.dropped == 0 && rendering.full().mean() > 0.0, "{name}");
    }
}
