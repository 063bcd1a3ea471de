use bevy::app::App;
use bevy::asset::{AssetApp, Assets, Handle, RenderAssetUsages};
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::camera::{Exposure, PerspectiveProjection, Projection};
use bevy::color::{Color, LinearRgba};
use bevy::ecs::entity::Entity;
use bevy::ecs::name::Name;
use bevy::ecs::reflect::AppTypeRegistry;
use bevy::ecs::world::World;
use bevy::image::{Image, ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::light::{
    AtmosphereEnvironmentMapLight, DirectionalLight, EnvironmentMapLight,
    GeneratedEnvironmentMapLight, GlobalAmbientLight, PointLight, SpotLight, VolumetricFog,
};
use bevy::math::{Affine2, Mat4, Quat, Vec2, Vec3};
use bevy::mesh::morph::{MeshMorphWeights, MorphAttributes, MorphWeights};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Indices, Mesh, Mesh3d, PrimitiveTopology, UvChannel, VertexAttributeValues};
use bevy::pbr::decal::ForwardDecalMaterial;
use bevy::pbr::{DistanceFog, MeshMaterial3d, StandardMaterial};
use bevy::prelude::AlphaMode as BevyAlpha;
use bevy::render::render_resource::{Extent3d, Face, TextureDimension, TextureFormat};
use bevy::transform::components::{GlobalTransform, Transform};
use frugal_trace::light::Light;
use frugal_trace::scene::{AlphaMode, Texels, Wrap};

use super::{ExtractedScene, ExtractedSky, Gaps, extract};

fn world() -> World {
    let mut app = App::new();
    app.add_plugins(bevy::asset::AssetPlugin::default())
        .init_asset::<Mesh>()
        .init_asset::<Image>()
        .init_asset::<StandardMaterial>()
        .init_asset::<SkinnedMeshInverseBindposes>();
    std::mem::take(app.world_mut())
}

/// A triangle in the plane z = 0 that faces +z.
fn triangle() -> Mesh {
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_POSITION,
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0, 0.0, 1.0]; 3])
}

fn spawn(world: &mut World, mesh: Mesh, material: StandardMaterial, at: Transform) -> Entity {
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
    let place = GlobalTransform::from(at);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), place, Name::new("it"))).id()
}

/// Extracts the only mesh.
fn one(mesh: Mesh, material: StandardMaterial, at: Transform) -> ExtractedScene {
    let mut world = world();
    spawn(&mut world, mesh, material, at);
    let found = extract(&mut world, None);
    assert_eq!(found.geometry.validate(), Ok(()));
    found
}

/// The normal that the winding of a scene's first triangle gives it.
fn facing(scene: &ExtractedScene) -> Vec3 {
    let [a, b, c] = scene.geometry.triangles().next().expect("a triangle").corners;
    (b - a).cross(c - a).normalize()
}

#[test]
fn meshes_are_where_they_are_drawn() {
    let at = Transform::from_xyz(1.0, 2.0, 3.0).with_scale(Vec3::new(2.0, 1.0, 1.0));
    let found = one(triangle(), StandardMaterial::default(), at);
    assert_eq!(
        found.geometry.meshes[0].positions,
        [Vec3::new(1.0, 2.0, 3.0), Vec3::new(3.0, 2.0, 3.0), Vec3::new(1.0, 3.0, 3.0)]
    );
    assert!(found.gaps.is_empty(), "{:?}", found.gaps);
    let quarter = Transform::from_rotation(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2));
    let normal =
        one(triangle(), StandardMaterial::default(), quarter).geometry.meshes[0].normals[0];
    assert!(normal.distance(Vec3::X) < 1e-6, "{normal}");
}

#[test]
fn front_sides_are_those_that_are_drawn() {
    let mirrored = Transform::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let with = |cull_mode| StandardMaterial { cull_mode, ..Default::default() };
    for (cull_mode, at, z) in [
        (Some(Face::Back), Transform::IDENTITY, 1.0),
        (Some(Face::Front), Transform::IDENTITY, -1.0),
        // What Bevy's glTF loader makes of a mirrored node.
        (Some(Face::Front), mirrored, 1.0),
        (Some(Face::Back), mirrored, -1.0),
        (None, mirrored, 1.0),
    ] {
        let found = one(triangle(), with(cull_mode), at);
        assert_eq!(facing(&found).z, z, "{cull_mode:?} {at:?}");
        assert_eq!(found.geometry.meshes[0].normals[0], Vec3::Z);
        assert_eq!(found.geometry.materials[0].double_sided, cull_mode.is_none());
    }
}

#[test]
fn all_formats_of_attributes_are_read() {
    let quantized = Mesh::new(PrimitiveTopology::TriangleStrip, RenderAssetUsages::default())
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_POSITION,
            VertexAttributeValues::Float32x3(vec![
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [1.0, 1.0, 0.0],
            ]),
        )
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_COLOR,
            VertexAttributeValues::Float32x4(vec![[0.25, 0.5, 0.75, 1.0]; 4]),
        )
        .with_inserted_indices(Indices::U16(vec![0, 1, 2, 3]));
    let found = one(quantized, StandardMaterial::default(), Transform::IDENTITY);
    assert_eq!(found.geometry.triangle_count(), 2);
    assert!(found.geometry.triangles().all(|each| {
        let [a, b, c] = each.corners;
        (b - a).cross(c - a).z > 0.0
    }));
    assert_eq!(found.geometry.meshes[0].colors[2], [0.25, 0.5, 0.75, 1.0]);
    let values = |values: VertexAttributeValues| super::vertices::floats(&values).expect("floats");
    assert_eq!(
        values(VertexAttributeValues::Unorm8x4(vec![[0, 51, 255, 255]]))[0],
        [0.0, 0.2, 1.0, 1.0]
    );
    assert_eq!(
        values(VertexAttributeValues::Uint16x4(vec![[1, 2, 3, 400]]))[0],
        [1.0, 2.0, 3.0, 400.0]
    );
    assert!(super::vertices::floats(&VertexAttributeValues::Uint32(vec![1])).is_none());
}

#[test]
fn skins_follow_their_joints_and_not_their_entity() {
    let mut world = world();
    // In centimetres, Z up, under an armature that turns it Y up.
    let joint = Transform::from_rotation(Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2))
        .with_scale(Vec3::splat(0.01));
    let joint = world.spawn(GlobalTransform::from(joint)).id();
    let poses = vec![Mat4::from_translation(Vec3::new(0.0, 0.0, 100.0))];
    let poses = world.resource_mut::<Assets<SkinnedMeshInverseBindposes>>().add(poses);
    let mesh = triangle()
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_JOINT_INDEX,
            VertexAttributeValues::Uint16x4(vec![[0; 4]; 3]),
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, vec![[0.75, 0.25, 0.0, 0.0]; 3]);
    let entity =
        spawn(&mut world, mesh, StandardMaterial::default(), Transform::from_xyz(9.0, 9.0, 9.0));
    world.entity_mut(entity).insert(SkinnedMesh { inverse_bindposes: poses, joints: vec![joint] });
    let found = extract(&mut world, None).geometry;
    let expected = [Vec3::Y, Vec3::new(0.01, 1.0, 0.0), Vec3::new(0.0, 1.0, -0.01)];
    for (position, expected) in found.meshes[0].positions.iter().zip(expected) {
        assert!(position.distance(expected) < 1e-6, "{position} {expected}");
    }
    assert!(found.meshes[0].normals[0].distance(Vec3::Y) < 1e-6);
    // Without its joint it cannot be placed.
    world.despawn(joint);
    let gone = extract(&mut world, None);
    assert_eq!(gone.geometry.triangle_count(), 0);
    assert_eq!(gone.gaps, ["skinned meshes without joints are left out: it"]);
}

#[test]
fn morph_weights_move_vertices() {
    let mut world = world();
    let offset = |x: f32| MorphAttributes::new(Vec3::X * x, Vec3::X, Vec3::ZERO);
    let mut mesh = triangle();
    mesh.set_morph_targets(vec![
        offset(1.0),
        offset(2.0),
        offset(3.0),
        offset(9.0),
        offset(9.0),
        offset(9.0),
    ]);
    let entity = spawn(&mut world, mesh, StandardMaterial::default(), Transform::IDENTITY);
    world.entity_mut(entity).insert(MeshMorphWeights::Value { weights: vec![0.5, 0.0] });
    let xs = |world: &mut World| {
        let found = extract(world, None).geometry;
        found.meshes[0].positions.iter().map(|position| position.x).collect::<Vec<_>>()
    };
    assert_eq!(xs(&mut world), [0.5, 2.0, 1.5]);
    let owner = world.spawn(MorphWeights::new(vec![0.0, 1.0], None).expect("weights")).id();
    world.entity_mut(entity).insert(MeshMorphWeights::Reference(owner));
    assert_eq!(xs(&mut world), [9.0, 10.0, 9.0]);
    // More weights than targets.
    world.entity_mut(entity).insert(MeshMorphWeights::Value { weights: vec![0.0, 0.0, 1.0] });
    assert_eq!(xs(&mut world), [0.0, 1.0, 0.0]);
}

#[test]
fn what_the_camera_does_not_see_is_not_there() {
    let mut world = world();
    let hidden = spawn(&mut world, triangle(), StandardMaterial::default(), Transform::IDENTITY);
    world.entity_mut(hidden).insert(InheritedVisibility::HIDDEN);
    let elsewhere = spawn(&mut world, triangle(), StandardMaterial::default(), Transform::IDENTITY);
    world.entity_mut(elsewhere).insert(RenderLayers::layer(3));
    let lens = PerspectiveProjection { fov: 1.0, near: 0.2, far: 77.0, ..Default::default() };
    let camera = world
        .spawn((Projection::Perspective(lens), Exposure { ev100: 6.0 }, RenderLayers::layer(3)))
        .id();
    assert_eq!(extract(&mut world, None).geometry.triangle_count(), 0);
    let seen = extract(&mut world, Some(camera));
    assert_eq!(seen.geometry.triangle_count(), 1);
    assert_eq!((seen.exposure_ev100, seen.near, seen.far), (6.0, 0.2, 77.0));
    assert!((seen.vertical_fov_degrees - 1.0_f32.to_degrees()).abs() < 1e-4);
}

#[test]
fn fog_is_named() {
    let mut world = world();
    let clear = world.spawn(Exposure::default()).id();
    assert!(extract(&mut world, Some(clear)).gaps.is_empty());
    for fogs in [true, false] {
        let camera = if fogs {
            world.spawn(DistanceFog::default()).id()
        } else {
            world.spawn(VolumetricFog::default()).id()
        };
        assert_eq!(extract(&mut world, Some(camera)).gaps, ["fog is not traced: camera"]);
    }
}

/// Bevy hides the names of components unless its feature `debug` is on.
#[test]
fn meshes_with_materials_of_other_kinds_are_grey_and_named() {
    type Other = MeshMaterial3d<ForwardDecalMaterial<StandardMaterial>>;
    let mut world = world();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(triangle());
    let bare = (Mesh3d(mesh.clone()), GlobalTransform::default());
    world.spawn(bare);
    assert!(extract(&mut world, None).geometry.meshes.is_empty(), "nothing draws it");
    world.init_resource::<AppTypeRegistry>();
    world.resource::<AppTypeRegistry>().write().register::<Other>();
    let material = Other::from(Handle::default());
    world.spawn((Mesh3d(mesh), material, GlobalTransform::default(), Name::new("decal")));
    let found = extract(&mut world, None);
    assert_eq!(found.geometry.meshes.len(), 1);
    assert!(found.gaps.iter().any(|gap| format!("{gap:?}").contains("decal")), "{:?}", found.gaps);
}

#[test]
fn materials_keep_what_the_shader_reads() {
    let mut world = world();
    let size = Extent3d { width: 2, height: 1, depth_or_array_layers: 1 };
    let mut image = Image::new(
        size,
        TextureDimension::D2,
        vec![1, 2, 3, 4, 5, 6, 7, 8],
        TextureFormat::Rgba8Unorm,
        RenderAssetUsages::default(),
    );
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::MirrorRepeat,
        ..ImageSamplerDescriptor::nearest()
    });
    let image = world.resource_mut::<Assets<Image>>().add(image);
    let transform = Affine2::from_translation(Vec2::X);
    let material = StandardMaterial {
        base_color: Color::LinearRgba(LinearRgba::new(0.1, 0.2, 0.3, 0.4)),
        metallic_roughness_texture: Some(image),
        metallic_roughness_channel: UvChannel::Uv1,
        uv_transform: transform,
        metallic: 0.75,
        perceptual_roughness: 0.25,
        reflectance: 0.125,
        emissive: LinearRgba::rgb(1.0, 2.0, 3.0),
        emissive_exposure_weight: 0.0,
        alpha_mode: BevyAlpha::Mask(0.3),
        normal_map_texture: Some(Handle::default()),
        ..Default::default()
    };
    spawn(&mut world, triangle(), material.clone(), Transform::IDENTITY);
    let camera = world.spawn(Exposure { ev100: 10.0 }).id();
    let found = extract(&mut world, Some(camera));
    assert_eq!(found.gaps, ["normal maps are not traced: it"]);
    let read = &found.geometry.materials[0];
    assert_eq!((read.base_color, read.alpha), ([0.1, 0.2, 0.3, 0.4], AlphaMode::Mask(0.3)));
    assert_eq!((read.metallic, read.perceptual_roughness, read.reflectance), (0.75, 0.25, 0.125));
    // In the renderer's units: 1.2 × 2^10 nits each.
    assert!((read.emissive[1] / (2.0 * 1.2 * 1024.0) - 1.0).abs() < 1e-5, "{:?}", read.emissive);
    let texture = read.metallic_roughness_texture.expect("a texture");
    assert_eq!((texture.second_uvs, texture.transform), (true, transform));
    let texture = &found.geometry.textures[texture.texture];
    assert_eq!(texture.wrap, [Wrap::Mirror, Wrap::Clamp]);
    assert_eq!(texture.texels, Texels::Linear(vec![[1, 2, 3, 4], [5, 6, 7, 8]]));
    // In nits, exactly.
    let nits = StandardMaterial { emissive_exposure_weight: 1.0, ..material };
    spawn(&mut world, triangle(), nits, Transform::IDENTITY);
    assert_eq!(extract(&mut world, Some(camera)).geometry.materials[1].emissive, [1.0, 2.0, 3.0]);
}

#[test]
fn what_is_not_represented_is_named() {
    let named = |material: StandardMaterial, what: &str, is_left_out: bool| {
        let found = one(triangle(), material, Transform::IDENTITY);
        assert!(found.gaps.iter().any(|gap| gap.contains(what)), "{what}: {:?}", found.gaps);
        assert_eq!(found.geometry.triangle_count() == 0, is_left_out, "{what}");
    };
    let base = StandardMaterial::default;
    named(StandardMaterial { alpha_mode: BevyAlpha::Blend, ..base() }, "blended surfaces", true);
    named(StandardMaterial { alpha_mode: BevyAlpha::Add, ..base() }, "it (0.50 m²)", true);
    named(StandardMaterial { specular_transmission: 0.5, ..base() }, "transmissive", true);
    named(StandardMaterial { unlit: true, ..base() }, "unlit", false);
    named(StandardMaterial { clearcoat: 1.0, ..base() }, "clearcoat", false);
    named(StandardMaterial { cull_mode: None, ..base() }, "as double-sided", false);
    let missing = Some(Handle::default());
    named(StandardMaterial { base_color_texture: missing, ..base() }, "images that are", false);
    let lines = Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0; 3]; 2]);
    assert_eq!(one(lines, base(), Transform::IDENTITY).gaps, ["points and lines are left out: it"]);
    let nan = triangle().with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[f32::NAN; 3]; 3]);
    assert!(one(nan, base(), Transform::IDENTITY).gaps[0].contains("not finite"));
    let wild = triangle().with_inserted_indices(Indices::U32(vec![0, 1, 9]));
    assert!(one(wild, base(), Transform::IDENTITY).gaps[0].contains("out of range"));
}

#[test]
fn lights_have_their_units_and_axes() {
    let mut world = world();
    let down =
        GlobalTransform::from(Transform::from_xyz(1.0, 2.0, 3.0).looking_to(Vec3::NEG_Y, Vec3::X));
    let sun =
        DirectionalLight { illuminance: 5e4, shadow_maps_enabled: true, ..Default::default() };
    let lamp = PointLight {
        intensity: 800.0,
        range: 7.0,
        shadow_maps_enabled: true,
        ..Default::default()
    };
    let spot = SpotLight {
        intensity: 900.0,
        range: 8.0,
        inner_angle: 0.25,
        outer_angle: 0.5,
        shadow_maps_enabled: true,
        ..Default::default()
    };
    let seen = InheritedVisibility::VISIBLE;
    world.spawn((sun, down, seen));
    world.spawn((lamp, down, seen));
    world.spawn((spot, down, seen));
    let hidden = world.spawn((lamp, down, InheritedVisibility::HIDDEN)).id();
    let found = extract(&mut world, None);
    assert!(found.gaps.is_empty(), "{:?}", found.gaps);
    let [
        Light::Directional { direction, illuminance, .. },
        Light::Point { position, luminous_power, range, .. },
        Light::Spot { outer_angle, .. },
    ] = &found.lights[..]
    else {
        panic!("{:?}", found.lights)
    };
    assert!(direction.distance(Vec3::NEG_Y) < 1e-6 && *illuminance == 5e4);
    assert_eq!((*position, *luminous_power, *range), (Vec3::new(1.0, 2.0, 3.0), 800.0, 7.0));
    assert!((outer_angle - 0.5_f32.to_degrees()).abs() < 1e-4);
    world.despawn(hidden);
    let shadowless = PointLight { shadow_maps_enabled: false, ..lamp };
    world.spawn((shadowless, down, seen, Name::new("lamp")));
    assert!(extract(&mut world, None).gaps[0].ends_with("lamp"));
}

#[test]
fn a_sky_has_its_directions() {
    let mut world = world();
    assert_eq!(extract(&mut world, None).sky, ExtractedSky::Black);
    // Faces in GPU order: +x, −x, +y, −y, +z, −z, of which Bevy shows z negated.
    let cube = |faces: [f32; 6]| {
        let texels = faces.iter().flat_map(|value| [*value, 0.0, 0.0, 1.0]);
        Image::new(
            Extent3d { width: 1, height: 1, depth_or_array_layers: 6 },
            TextureDimension::D2,
            texels.flat_map(f32::to_le_bytes).collect(),
            TextureFormat::Rgba32Float,
            RenderAssetUsages::default(),
        )
    };
    let mut sky = |faces| {
        let map = world.resource_mut::<Assets<Image>>().add(cube(faces));
        let light = EnvironmentMapLight {
            diffuse_map: map.clone(),
            specular_map: map,
            intensity: 10.0,
            ..Default::default()
        };
        let camera = world.spawn(light).id();
        extract(&mut world, Some(camera)).sky
    };
    // Not printed: a map would be long.
    assert!(sky([2.0; 6]) == ExtractedSky::Constant([20.0, 0.0, 0.0]));
    let ExtractedSky::Map(map, 10.0) = sky([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) else { panic!() };
    for (direction, value) in [
        (Vec3::X, 1.0),
        (Vec3::NEG_X, 2.0),
        (Vec3::Y, 3.0),
        (Vec3::NEG_Y, 4.0),
        (Vec3::NEG_Z, 5.0),
        (Vec3::Z, 6.0),
    ] {
        // Off the seams between texels.
        let direction = (direction + Vec3::new(0.01, 0.02, 0.015)).normalize();
        assert_eq!(map.look_up(direction)[0], value, "{direction}");
    }
}

#[test]
fn a_small_sun_in_a_fine_sky_keeps_its_light() {
    use std::f64::consts::{PI, TAU};
    let (edge, nits) = (512, 1e4_f32);
    let mut texels = vec![[0.0_f32, 0.0, 0.0, 1.0]; 6 * edge * edge];
    // Beside the middle of the first face.
    texels[edge / 2 * edge + edge / 2][0] = nits;
    let size = Extent3d { width: 512, height: 512, depth_or_array_layers: 6 };
    let image = Image::new(
        size,
        TextureDimension::D2,
        texels.into_iter().flatten().flat_map(f32::to_le_bytes).collect(),
        TextureFormat::Rgba32Float,
        RenderAssetUsages::default(),
    );
    let mut world = world();
    let specular_map = world.resource_mut::<Assets<Image>>().add(image);
    let light = EnvironmentMapLight { specular_map, intensity: 1.0, ..Default::default() };
    let camera = world.spawn(light).id();
    let ExtractedSky::Map(map, _) = extract(&mut world, Some(camera)).sky else { panic!() };
    let (width, height) = map.size();
    let (across, down) = (TAU / f64::from(width), PI / f64::from(height));
    let texels = (0..).zip(map.texels());
    let light: f64 = texels
        .map(|(i, texel): (u32, _)| {
            let sine = ((f64::from(i / width) + 0.5) * down).sin();
            f64::from(texel[0]) * across * down * sine
        })
        .sum();
    // In the middle of a face, whose half is 1 wide at the distance of 1.
    let expected = f64::from(nits) * (2.0 / edge as f64).powi(2);
    assert!((0.5..2.0).contains(&(light / expected)), "{light} {expected}");
}

#[test]
fn an_environment_map_is_there_where_it_cannot_be_read_and_ambient_light_is_none() {
    let mut world = world();
    let map = |intensity| EnvironmentMapLight { intensity, ..Default::default() };
    let of_gpu = GeneratedEnvironmentMapLight { intensity: 5.0, ..Default::default() };
    let cameras = [
        (world.spawn(map(10.0)).id(), true),
        (world.spawn(of_gpu.clone()).id(), true),
        (world.spawn(AtmosphereEnvironmentMapLight::default()).id(), true),
        // Bevy generates none beside another.
        (world.spawn((map(0.0), of_gpu)).id(), false),
    ];
    for (camera, has_map) in cameras {
        let found = extract(&mut world, Some(camera));
        assert_eq!(found.has_environment_map, has_map, "{:?}", found.gaps);
        assert_eq!(found.sky, ExtractedSky::Black, "{:?}", found.gaps);
    }
    world.insert_resource(GlobalAmbientLight::default());
    let found = extract(&mut world, None);
    assert!(!found.has_environment_map && found.sky != ExtractedSky::Black, "{:?}", found.gaps);
}

#[test]
fn many_names_are_counted() {
    let mut gaps = Gaps::default();
    (0..7).for_each(|i| gaps.add("no fog", format!("m{i}")));
    gaps.add("no fog", "m0");
    gaps.add("a", "x");
    assert_eq!(gaps.lines(), ["a: x", "no fog: m0, m1, m2, m3, m4 and 2 more"]);
    // As many as a large level has, in less than minutes.
    let mut gaps = Gaps::default();
    (0..100_000).for_each(|i| gaps.add("no fog", format!("mesh {i:05}")));
    assert!(gaps.lines()[0].ends_with("mesh 00004 and 99995 more"));
}
