//! A time-of-flight camera, and how far light that took detours misleads it.
//!
//! The light of such a camera is modulated, and the camera takes the phase of what returns for distance.
//! Light that went from wall to wall returns later. Look at the third panel: what other surfaces light
//! is measured too far (red), most of all the darkest, such as the sides of boxes that face away; in
//! the corner itself detours are short. The plugin's virtual point lights, of a light at the eye, are
//! the places where that light turned, so that a pass of the example knows the length of every detour.
//! The last panel is corrected as such a camera could do it: it takes off the light of one detour that
//! its own image implies. Where that is too much, depth is too near (blue).
//!
//! Light that turned more than once is left out: its paths have no known lengths. With it, by path
//! tracing, the median error at 20 MHz is 18 cm in place of 13.
//!
//! Up and Down change the modulation. The higher its frequency, the smaller the errors, and the
//! nearer the distance at which depth begins anew.

mod pass;
mod room;

use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::image::ImageSampler;
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::render::storage::ShaderBuffer;
use bevy_frugal_gi::gi::{GiInterleave, GiPixelFraction};
use bevy_frugal_gi::knobs::{KnobSpace, WarmKnobs};
use bevy_frugal_gi::prelude::*;
use frugal_examples::{ExamplePlugin, caption, spawn_blocks};
use frugal_trace::time::{TimeError, range, without_bounce};
use pass::{PhasorPlugin, Sensor};

/// The camera's image.
const SIZE: UVec2 = UVec2::new(96, 54);
/// Modulations, hertz. The room is smaller than the shortest range.
const FREQUENCIES: [f64; 4] = [10e6, 15e6, 20e6, 30e6];
/// Frames after a change before the sensor is read.
const SETTLING_FRAMES: u32 = 10;
/// Rounds of the correction.
const ROUNDS: u32 = 3;
/// Depths that have the first and the last colour, metres.
const DEPTHS: [f64; 2] = [1.5, 5.0];
/// Error that has the last colour, metres.
const WORST: f64 = 0.3;

fn main() -> AppExit {
    App::new()
        .add_plugins((DefaultPlugins, FrugalGiPlugins))
        .add_plugins((ExamplePlugin { title: "time_of_flight" }, PhasorPlugin))
        .insert_resource(GlobalAmbientLight::NONE)
        .add_systems(Startup, set_up)
        .add_systems(Update, (choose, read).chain())
        .run()
}

#[derive(Resource)]
struct Bench {
    panels: [Handle<Image>; 4],
    /// Index of [`FREQUENCIES`].
    frequency: usize,
    /// Frames since it changed.
    frames: u32,
    progress: Progress,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Progress {
    Settling,
    Reading,
    Shown,
}

/// Text of the panel of this index.
#[derive(Component)]
struct Label(usize);

/// What the panels show, metres: measured and true depth; errors as measured, and corrected.
struct Measurement {
    depths: [Vec<Option<f64>>; 2],
    errors: [Vec<Option<f64>>; 2],
}

fn set_up(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut images: ResMut<Assets<Image>>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
) {
    spawn_blocks(&mut commands, &mut meshes, &mut materials, room::BLOCKS);
    let view = room::view(SIZE);
    let pose = Transform::from_translation(view.pose.position).with_rotation(view.pose.rotation);
    let [inner_angle, outer_angle] = room::CONE_DEGREES.map(f32::to_radians);
    let light = SpotLight {
        // Bevy spreads a light's lumens over the sphere, whatever its cone.
        intensity: room::CANDELA * 4.0 * std::f32::consts::PI,
        range: room::RANGE,
        inner_angle,
        outer_angle,
        shadow_maps_enabled: true,
        ..default()
    };
    commands.spawn((light, pose));
    let lens = PerspectiveProjection {
        fov: view.vertical_fov_degrees.to_radians(),
        near: view.near,
        ..default()
    };
    let target = Image::new_target_texture(SIZE.x, SIZE.y, TextureFormat::Rgba8UnormSrgb, None);
    commands.spawn((
        Camera3d::default(),
        Camera { order: -1, ..default() },
        RenderTarget::Image(images.add(target).into()),
        (Projection::Perspective(lens), pose, Msaa::Off),
        FrugalGi {
            // Lengths of paths are known for one bounce.
            bounces: 1,
            // All pixels see the same VPLs.
            interleave: GiInterleave::One,
            vpl_count: 512,
            // Nobody sees the image, nor what GI adds to it.
            pixel_fraction: GiPixelFraction::Sixteenth,
            rest_frames: 0,
            ..default()
        },
        WarmKnobs::new(KnobSpace::default()),
    ));
    let frequency = 2;
    let sensor = Sensor::new(FREQUENCIES[frequency], room::CANDELA, SIZE, &mut buffers);
    commands.insert_resource(sensor);
    commands.spawn((Camera2d, Msaa::Off, IsDefaultUiCamera));
    let panels = [0, 1, 2, 3].map(|_| images.add(panel()));
    for (index, panel) in panels.iter().enumerate() {
        let place = Node {
            position_type: PositionType::Absolute,
            left: percent(50 * (index as i32 % 2)),
            top: percent(50 * (index as i32 / 2)),
            width: percent(50),
            height: percent(50),
            ..default()
        };
        commands
            .spawn((ImageNode::new(panel.clone()), place))
            .with_child((caption(""), Label(index)));
    }
    commands.insert_resource(Bench { panels, frequency, frames: 0, progress: Progress::Settling });
}

/// A black image whose pixels stay squares.
fn panel() -> Image {
    let size = Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 };
    let mut image = Image::new_fill(
        size,
        TextureDimension::D2,
        &[0, 0, 0, 255],
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::default(),
    );
    image.sampler = ImageSampler::nearest();
    image
}

fn choose(keys: Res<ButtonInput<KeyCode>>, mut bench: ResMut<Bench>, mut sensor: ResMut<Sensor>) {
    let higher = usize::from(keys.just_pressed(KeyCode::ArrowUp));
    let lower = usize::from(keys.just_pressed(KeyCode::ArrowDown));
    let frequency = (bench.frequency + higher).saturating_sub(lower).min(FREQUENCIES.len() - 1);
    if frequency != bench.frequency {
        (bench.frequency, bench.frames, bench.progress) = (frequency, 0, Progress::Settling);
        sensor.frequency = FREQUENCIES[frequency];
    }
}

/// Reads the sensor when it has settled.
fn read(
    mut commands: Commands,
    mut bench: ResMut<Bench>,
    sensor: Res<Sensor>,
    warming: Query<(), With<WarmKnobs>>,
) {
    if bench.progress != Progress::Settling || !warming.is_empty() {
        return;
    }
    bench.frames += 1;
    if bench.frames > SETTLING_FRAMES {
        bench.progress = Progress::Reading;
        commands.spawn(Readback::buffer(sensor.pixels.clone())).observe(show);
    }
}

/// Shows what the sensor has measured.
fn show(
    read: On<ReadbackComplete>,
    mut commands: Commands,
    mut bench: ResMut<Bench>,
    mut images: ResMut<Assets<Image>>,
    mut labels: Query<(&mut Text, &Label)>,
) {
    commands.entity(read.entity).despawn();
    // A copy that was under way when the first one arrived, or the frequency changed.
    if bench.progress != Progress::Reading {
        return;
    }
    bench.progress = Progress::Shown;
    let frequency = FREQUENCIES[bench.frequency];
    let Measurement { depths, errors } = match measure(&read.data, frequency) {
        Ok(measurement) => measurement,
        Err(error) => {
            error!("no depth: {error}");
            return;
        }
    };
    let megahertz = frequency / 1e6;
    let [raw, corrected] = errors.each_ref().map(|errors| match quantiles(errors) {
        Some([median, most]) => format!("median {median:.1}, 90 % below {most:.1} cm"),
        // The plugin says there why it is off.
        None => "nothing measured, see the log".to_owned(),
    });
    println!("{megahertz} MHz: error {raw}; corrected {corrected}");
    let [nearest, farthest] = DEPTHS;
    let texts = [
        format!("depth at {megahertz} MHz, unique to {:.1} m (Up, Down)", range(frequency)),
        format!("true depth, {nearest} to {farthest} m"),
        format!("error: {raw}"),
        format!("corrected: {corrected}"),
    ];
    for (mut text, Label(index)) in &mut labels {
        text.0.clone_from(&texts[*index]);
    }
    let colors = depths
        .map(|depths| colored(&depths, depth_color))
        .into_iter()
        .chain(errors.map(|errors| colored(&errors, error_color)));
    for (panel, colors) in bench.panels.iter().zip(colors) {
        if let Some(mut image) = images.get_mut(panel) {
            image.data = Some(colors);
        }
    }
}

/// Takes depths from the bytes of the sensor.
fn measure(bytes: &[u8], frequency: f64) -> Result<Measurement, TimeError> {
    let capture = pass::capture(&room::view(SIZE), frequency, bytes)?;
    let corrected = without_bounce(&capture, f64::from(room::CANDELA), ROUNDS)?;
    let depths = [capture.all(), &corrected].map(|phasors| capture.depths(phasors));
    let error = |(measured, truth): (&Option<f64>, &Option<f64>)| Some((*measured)? - (*truth)?);
    let errors =
        depths.each_ref().map(|own| own.iter().zip(capture.distances()).map(error).collect());
    let [measured, _] = depths;
    Ok(Measurement { depths: [measured, capture.distances().to_vec()], errors })
}

/// Median and 90th percentile of errors' sizes, centimetres; `None` of none.
fn quantiles(errors: &[Option<f64>]) -> Option<[f64; 2]> {
    let mut sizes: Vec<f64> = errors.iter().flatten().map(|error| error.abs() * 100.0).collect();
    sizes.sort_by(f64::total_cmp);
    let at = |share: usize| sizes.get(sizes.len() * share / 100).copied();
    Some([at(50)?, at(90)?])
}

fn colored(values: &[Option<f64>], color: fn(f64) -> Color) -> Vec<u8> {
    let color = |value: &Option<f64>| value.map_or(Color::BLACK, color).to_srgba().to_u8_array();
    values.iter().flat_map(color).collect()
}

/// From red, which is near, to blue.
fn depth_color(metres: f64) -> Color {
    let share = (metres - DEPTHS[0]) / (DEPTHS[1] - DEPTHS[0]);
    Color::hsl(share.clamp(0.0, 1.0) as f32 * 240.0, 0.9, 0.5)
}

/// White; blue where it is too near, and red where it is too far.
fn error_color(metres: f64) -> Color {
    let share = (metres / WORST).clamp(-1.0, 1.0) as f32;
    let rest = 1.0 - share.abs();
    if share > 0.0 { Color::srgb(1.0, rest, rest) } else { Color::srgb(rest, rest, 1.0) }
}
