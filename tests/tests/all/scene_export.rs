//! Exported scenes, read again by the tool.

use bevy::app::App;
use bevy::asset::{Assets, RenderAssetUsages};
use bevy::camera::Exposure;
use bevy::color::{Color, LinearRgba};
use bevy::image::Image;
use bevy::light::{DirectionalLight, PointLight, SpotLight};
use bevy::math::{Vec3, Vec4};
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::prelude::{AlphaMode, Cuboid, Plane3d};
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::transform::components::Transform;
use bevy_frugal_gi_tools::scene_export::{ExportScene, SceneExportPlugin};
use frugal::scene;
use frugal::stage::Stage;
use frugal_tests::set;
use frugal_trace::light::Light;
use frugal_trace::metrics::ssim;
use frugal_trace::scene::AlphaMode as SceneAlpha;

tests!(what_an_app_spawned_is_read_back, an_exported_scene_looks_the_same);

/// Adds the export to an app, to `my.scene.ron` in `folder`.
fn exporting(folder: &tempfile::TempDir) -> impl FnOnce(&mut App) {
    let file = folder.path().join("my.scene.ron");
    move |app: &mut App| {
        app.add_plugins(SceneExportPlugin::new(file));
    }
}

fn export(stage: &mut Stage) {
    stage.world_mut().write_message(ExportScene);
    stage.frame();
}

fn what_an_app_spawned_is_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = set::options(32, 32);
    let mut stage = set::bare_with(vec![], options, exporting(&folder));
    let world = stage.world_mut();
    let texture = Image::new(
        Extent3d { width: 2, height: 1, depth_or_array_layers: 1 },
        TextureDimension::D2,
        vec![255, 0, 0, 255, 0, 0, 255, 0],
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::default(),
    );
    let texture = world.resource_mut::<Assets<Image>>().add(texture);
    let mut add = |material: StandardMaterial| {
        MeshMaterial3d(world.resource_mut::<Assets<StandardMaterial>>().add(material))
    };
    let exposure = Exposure { ev100: 8.0 };
    let emissive = add(StandardMaterial {
        emissive: LinearRgba::rgb(300.0, 600.0, 0.0),
        emissive_exposure_weight: 1.0,
        perceptual_roughness: 0.25,
        metallic: 0.5,
        ..Default::default()
    });
    let leaf = add(StandardMaterial {
        base_color: Color::linear_rgb(0.5, 0.25, 1.0),
        base_color_texture: Some(texture),
        alpha_mode: AlphaMode::Mask(0.75),
        cull_mode: None,
        ..Default::default()
    });
    let glass = add(StandardMaterial { alpha_mode: AlphaMode::Blend, ..Default::default() });
    let mut meshes = world.resource_mut::<Assets<Mesh>>();
    let (cube, floor) = (meshes.add(Cuboid::from_length(1.0)), meshes.add(Plane3d::default()));
    let at = Transform::from_xyz(3.0, 1.0, -2.0).with_scale(Vec3::new(-2.0, 1.0, 1.0));
    world.spawn((Mesh3d(cube.clone()), emissive.clone(), at));
    world.spawn((Mesh3d(cube.clone()), leaf.clone(), Transform::default()));
    world.spawn((Mesh3d(floor), leaf, Transform::default()));
    world.spawn((Mesh3d(cube.clone()), glass, Transform::default()));
    world.spawn((Mesh3d(cube), emissive, Transform::default(), bevy::prelude::Visibility::Hidden));
    let down = Transform::default().looking_to(Vec3::NEG_Y, Vec3::X);
    world.spawn((DirectionalLight { illuminance: 123.0, ..Default::default() }, down));
    world.spawn((
        PointLight { intensity: 456.0, range: 7.0, ..Default::default() },
        Transform::from_xyz(0.0, 5.0, 0.0),
    ));
    let (inner_angle, outer_angle) = (0.25, 0.5);
    let spot = SpotLight { intensity: 789.0, inner_angle, outer_angle, ..Default::default() };
    world.spawn((spot, down));
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(exposure);
    set::look(&mut stage, Vec3::new(0.0, 2.0, 6.0), Vec3::ZERO);
    // The tour has a key for every half second of the stage's clock, which steps by frames.
    (0..40).for_each(|_| stage.frame());
    export(&mut stage);

    let read = scene::load(folder.path().join("my.scene.ron")).unwrap_or_else(|e| panic!("{e}"));
    let geometry = &read.geometry;
    let triangles: usize = geometry.meshes.iter().map(|mesh| mesh.indices.len() / 3).sum();
    assert_eq!(triangles, 12 + 12 + 2, "two cubes and a floor; neither glass nor the hidden one");
    let emissive =
        geometry.materials.iter().find(|material| material.emissive[0] > 0.0).expect("it");
    for (found, nits) in emissive.emissive.into_iter().zip([300.0, 600.0, 0.0]) {
        assert!((found - nits).abs() < 1e-3 * 600.0, "{:?}", emissive.emissive);
    }
    assert_eq!((emissive.perceptual_roughness, emissive.metallic), (0.25, 0.5));
    let leaf = geometry.materials.iter().find(|material| material.double_sided).expect("it");
    assert_eq!(leaf.alpha, SceneAlpha::Mask(0.75));
    // The tool moves colors from materials to vertices, so that meshes can be merged.
    let is_leaf = |color: &[f32; 4]| {
        (Vec4::from_array(*color) - Vec4::new(0.5, 0.25, 1.0, 1.0)).length() < 1e-6
    };
    let colors = || geometry.meshes.iter().flat_map(|mesh| &mesh.colors);
    assert!(colors().any(is_leaf), "{:?}", colors().next());
    assert!(leaf.base_color_texture.is_some() && geometry.textures.len() == 1);
    let furthest = geometry
        .meshes
        .iter()
        .flat_map(|mesh| &mesh.positions)
        .fold(0.0_f32, |most, position| most.max(position.x));
    assert_eq!(furthest, 4.0, "the mirrored cube spans 2 to 4 m");
    let mut lights = read.lights.iter();
    let close = |a: Vec3, b: Vec3| a.distance(b) < 1e-5;
    assert!(lights.any(|light| matches!(light, Light::Directional { direction, illuminance, .. }
        if close(*direction, Vec3::NEG_Y) && *illuminance == 123.0)));
    assert!(
        lights.any(|light| matches!(light, Light::Point { position, luminous_power, range, .. }
        if *position == Vec3::Y * 5.0 && *luminous_power == 456.0 && *range == 7.0))
    );
    assert!(lights.any(|light| matches!(light, Light::Spot { luminous_power, outer_angle, .. }
        if *luminous_power == 789.0 && (outer_angle - 0.5_f32.to_degrees()).abs() < 1e-3)));
    assert_eq!(read.exposure_ev100, 8.0);
    let tour = &read.paths["tour"];
    let end = tour.sample(tour.duration()).expect("a key");
    assert!(close(end.position, Vec3::new(0.0, 2.0, 6.0)), "{end:?}");
    assert!((end.rotation * Vec3::NEG_Z).dot(Vec3::new(0.0, -2.0, -6.0).normalize()) > 0.9999);
}

fn an_exported_scene_looks_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let original = set::scene("cornell");
    let options = set::options(64, 36);
    let mut stage = set::open_with(&original, options.clone(), exporting(&folder));
    let (eye, target) = (Vec3::new(0.0, 2.5, 7.5), Vec3::new(0.0, 2.5, 0.0));
    let picture = |stage: &mut Stage| {
        set::look(stage, eye, target);
        stage.get_ready().expect("a ready stage");
        stage.picture().expect("an image")
    };
    let expected = picture(&mut stage);
    export(&mut stage);
    drop(stage);
    let read = scene::load(folder.path().join("my.scene.ron")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(read.lights.len(), original.lights.len());
    let mut stage = set::open(&read, options);
    let found = picture(&mut stage);
    let error = ssim::error(&expected, &found).expect("images of one size");
    println!("    the exported scene differs by {error:.5}");
    assert!(error < 0.01, "{error}");
    let dark = found.rgb.iter().all(|rgb| rgb[0] < 30);
    assert!(!dark, "the image shows something");
}
