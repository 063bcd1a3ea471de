//! A game with things of its own, which the tool renders in the game itself: `own_game [MAP]`.
//!
//! Look at the hall: a shader of its own paints stripes on the pillars, a creature with bones sways, a pane
//! of glass and fog are in the air, and moss grows as thick as the game's own knob says. Up and Down
//! change a power budget, once there is a map:
//!
//! ```sh
//! mkdir -p target
//! frugal precompute --app "cargo run --example own_game" \
//!     --size 160x90 --time-limit 10m -o target/own_game.pareto.ron
//! ```

mod creature;
mod moss;

use bevy::asset::embedded_asset;
use bevy::pbr::{ExtendedMaterial, MaterialExtension};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy::render::render_resource::AsBindGroup;
use bevy::shader::ShaderRef;
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi::stage::{StageCamera, on_stage};
use bevy_frugal_gi_tools::HudPlugin;
use frugal_examples::{ExamplePlugin, change_power_budget, control_if_mapped, workspace_file};

/// The standard material with stripes.
type Striped = ExtendedMaterial<StandardMaterial, Stripes>;

/// Linear colour, and stripes per metre.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
struct Stripes {
    #[uniform(100)]
    stripes: Vec4,
}

impl MaterialExtension for Stripes {
    fn fragment_shader() -> ShaderRef {
        "embedded://own_game/stripes.wgsl".into()
    }

    fn deferred_fragment_shader() -> ShaderRef {
        Self::fragment_shader()
    }
}

fn main() -> AppExit {
    let map = std::env::args_os()
        .nth(1)
        .map_or_else(|| workspace_file("target/own_game.pareto.ron"), std::path::PathBuf::from);
    let mut app = App::new();
    app.add_plugins((on_stage(DefaultPlugins), FrugalGiPlugins, HudPlugin))
        .add_plugins((ExamplePlugin { title: "own_game" }, MaterialPlugin::<Striped>::default()))
        .insert_resource(GlobalAmbientLight::NONE)
        .insert_resource(Map(map))
        .add_systems(Startup, (set_up, creature::spawn))
        .add_systems(Update, (creature::sway, moss::grow, change_power_budget));
    embedded_asset!(app, "examples/own_game/", "stripes.wgsl");
    moss::register(&mut app);
    app.run()
}

/// The map's file.
#[derive(Resource)]
struct Map(std::path::PathBuf);

fn set_up(
    mut commands: Commands,
    map: Res<Map>,
    mut maps: ResMut<Assets<FrontierMap>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut striped: ResMut<Assets<Striped>>,
) {
    let diffuse = |color: Color| StandardMaterial {
        base_color: color,
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    };
    let stone = materials.add(diffuse(Color::srgb(0.7, 0.68, 0.64)));
    let brick = materials.add(diffuse(Color::srgb(0.7, 0.25, 0.15)));
    let mut block = |size: Vec3, centre: Vec3, material: &Handle<StandardMaterial>| {
        let cuboid = Mesh3d(meshes.add(Cuboid::from_size(size)));
        let place = Transform::from_translation(centre);
        commands.spawn((cuboid, MeshMaterial3d(material.clone()), place));
    };
    block(vec3(8.0, 0.2, 12.0), vec3(0.0, -0.1, 0.0), &stone);
    block(vec3(0.2, 4.0, 12.0), vec3(-4.0, 2.0, 0.0), &brick);
    block(vec3(0.2, 4.0, 12.0), vec3(4.0, 2.0, 0.0), &stone);
    block(vec3(8.0, 4.0, 0.2), vec3(0.0, 2.0, -6.0), &stone);
    // Half a roof: the sun shines in.
    block(vec3(4.0, 0.2, 12.0), vec3(-2.0, 4.1, 0.0), &stone);
    let glass = StandardMaterial {
        base_color: Color::srgba(0.6, 0.8, 0.9, 0.25),
        alpha_mode: AlphaMode::Blend,
        ..default()
    };
    block(vec3(2.4, 2.0, 0.04), vec3(1.2, 1.0, -2.0), &materials.add(glass));
    let pillar = Mesh3d(meshes.add(Cylinder::new(0.3, 4.0)));
    let stripes = Stripes { stripes: vec4(0.05, 0.15, 0.5, 3.0) };
    let paint =
        striped.add(Striped { base: diffuse(Color::srgb(0.8, 0.8, 0.75)), extension: stripes });
    for z in [-4.0, 0.0, 4.0] {
        let place = Transform::from_xyz(-1.2, 2.0, z);
        commands.spawn((pillar.clone(), MeshMaterial3d(paint.clone()), place));
    }
    let sun = DirectionalLight { illuminance: 40_000.0, shadow_maps_enabled: true, ..default() };
    let down = Transform::default().looking_to(vec3(-0.6, -1.0, -0.35), Vec3::Y);
    commands.spawn((sun, down));

    let haze = DistanceFog {
        color: Color::srgb(0.5, 0.55, 0.6),
        falloff: FogFalloff::Exponential { density: 0.02 },
        ..default()
    };
    let view = Transform::from_xyz(0.6, 1.7, 5.2).looking_at(vec3(-0.4, 1.2, 0.0), Vec3::Y);
    let exposure = bevy::camera::Exposure { ev100: 13.0 };
    let gi = (Camera3d::default(), Msaa::Off, FrugalGi::default(), moss::Moss(400));
    let mut camera = commands.spawn((gi, StageCamera, haze, exposure, view));
    control_if_mapped(&mut camera, &map.0, &mut maps);
}
