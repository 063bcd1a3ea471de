//! Lights that blink too fast for eyes, and the stripes that they draw in a rolling-shutter camera.
//!
//! Look at the stripes: shadows have them too, since light that has bounced is modulated like
//! direct light; surfaces by the steady light at the back have the least. Space changes what the lights
//! do: a code in the ratio of their frequencies, of which the detector's verdict is below the image
//! and on the terminal; frequencies that change; one frequency, which Up and Down can undo by the
//! exposure; and a frequency that follows the exposure, so that this one camera sees no stripes.
//! Changing frequencies are taken for the code: the lines of their pattern, multiples of 100 Hz, have
//! its ratios.
//!
//! Each light is rendered alone once, with its indirect light. The camera reads 15 000 rows a second,
//! and an image is the sum of the lights' images, each with its rows scaled.

use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy_frugal_gi::knobs::{KnobSpace, WarmKnobs};
use bevy_frugal_gi::prelude::*;
use frugal_examples::{ExamplePlugin, caption, spawn_blocks};
use frugal_trace::coded::{self, CODES, CodedError, Detector, Sequence, Shutter, Waveform};
use frugal_trace::metrics::{Radiance, tone};
use half::f16;

/// The camera's image: rows of it are a multiple of 256 bytes, as copies from the GPU need.
const SIZE: UVec2 = UVec2::new(640, 480);
/// Rows per second.
const READ_OUT: f64 = 15_000.0;
/// The frequencies whose ratios are the code, hertz.
const CODE: [f64; 3] = CODES[0];
/// Exposures, 1 ÷ second.
const EXPOSURES: [f64; 6] = [4000.0, 2000.0, 1300.0, 700.0, 400.0, 150.0];
/// Frames after a change of light before its image is read.
const SETTLING_FRAMES: u32 = 40;
/// Place and luminous power, lumens, of each light. The last one is steady.
const LIGHTS: [(Vec3, f32); 3] = [
    (Vec3::new(-2.4, 2.7, 1.2), 250_000.0),
    (Vec3::new(2.2, 2.4, 0.6), 180_000.0),
    (Vec3::new(0.3, 2.6, -2.4), 60_000.0),
];

fn main() -> AppExit {
    App::new()
        .add_plugins((DefaultPlugins, FrugalGiPlugins))
        .add_plugins(ExamplePlugin { title: "coded_light" })
        .insert_resource(GlobalAmbientLight::NONE)
        .add_systems(Startup, set_up)
        .add_systems(Update, (light_in_turn, choose, expose).chain())
        .run()
}

/// What the lights do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pattern {
    Code,
    Scrambled,
    OneFrequency,
    Authorised,
}

#[derive(Resource)]
struct Studio {
    /// The target of the camera, and the image in the window.
    target: Handle<Image>,
    shown: Handle<Image>,
    /// Images of each light alone, as they arrive.
    images: Vec<Radiance>,
    /// Frames since the light changed.
    frames: u32,
    is_reading: bool,
    pattern: Pattern,
    /// Index of [`EXPOSURES`].
    exposure: usize,
    /// Whether the settings changed since the last image.
    is_changed: bool,
}

/// Index of [`LIGHTS`].
#[derive(Component)]
struct Source(usize);

/// The caption.
#[derive(Component)]
struct Report;

fn set_up(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut images: ResMut<Assets<Image>>,
) {
    let grey = Color::srgb(0.75, 0.75, 0.75);
    let (red, green) = (Color::srgb(0.85, 0.25, 0.2), Color::srgb(0.25, 0.7, 0.3));
    let blocks = [
        (vec3(8.0, 0.1, 6.0), vec3(0.0, -0.05, 0.0), grey),
        (vec3(8.0, 0.1, 6.0), vec3(0.0, 3.05, 0.0), grey),
        (vec3(8.0, 3.0, 0.1), vec3(0.0, 1.5, -3.05), grey),
        (vec3(0.1, 3.0, 6.0), vec3(-4.05, 1.5, 0.0), red),
        (vec3(0.1, 3.0, 6.0), vec3(4.05, 1.5, 0.0), green),
        (vec3(0.6, 2.2, 0.6), vec3(-0.8, 1.1, -0.6), grey),
        (vec3(1.2, 0.9, 0.9), vec3(1.3, 0.45, 0.4), Color::srgb(0.4, 0.45, 0.7)),
    ];
    spawn_blocks(&mut commands, &mut meshes, &mut materials, blocks);
    for (i, (place, _)) in LIGHTS.into_iter().enumerate() {
        let light = PointLight { intensity: 0.0, shadow_maps_enabled: true, ..default() };
        commands.spawn((light, Source(i), Transform::from_translation(place)));
    }
    let size = Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 };
    let mut target = Image::new_fill(
        size,
        TextureDimension::D2,
        &[0; 8],
        TextureFormat::Rgba16Float,
        RenderAssetUsages::default(),
    );
    target.texture_descriptor.usage |= TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC;
    let target = images.add(target);
    let shown = images.add(Image::new_fill(
        size,
        TextureDimension::D2,
        &[0, 0, 0, 255],
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::default(),
    ));
    commands.spawn((
        Camera3d::default(),
        Camera { order: -1, ..default() },
        RenderTarget::Image(target.clone().into()),
        // Light as it is, which can be added up.
        (Tonemapping::None, DebandDither::Disabled, Msaa::Off),
        FrugalGi::default(),
        // Images are empty until the shaders are compiled.
        WarmKnobs::new(KnobSpace::default()),
        Transform::from_xyz(0.0, 1.8, 6.6).looking_at(vec3(0.0, 1.4, 0.0), Vec3::Y),
    ));
    commands.spawn((Camera2d, Msaa::Off, IsDefaultUiCamera));
    let whole = Node {
        position_type: PositionType::Absolute,
        width: percent(100),
        height: percent(100),
        ..default()
    };
    commands.spawn((ImageNode::new(shown.clone()), whole));
    commands.spawn((caption("each light alone ..."), Report, GlobalZIndex(1)));
    commands.insert_resource(Studio {
        target,
        shown,
        images: Vec::new(),
        frames: 0,
        is_reading: false,
        pattern: Pattern::Code,
        exposure: 1,
        is_changed: true,
    });
}

/// Turns on one light after the other, and reads its image when the light has settled.
fn light_in_turn(
    mut commands: Commands,
    mut studio: ResMut<Studio>,
    mut lights: Query<(&mut PointLight, &Source)>,
    warming: Query<(), With<WarmKnobs>>,
) {
    if studio.images.len() == LIGHTS.len() || !warming.is_empty() {
        return;
    }
    for (mut light, source) in &mut lights {
        let intensity = if source.0 == studio.images.len() { LIGHTS[source.0].1 } else { 0.0 };
        if light.intensity != intensity {
            light.intensity = intensity;
        }
    }
    studio.frames += 1;
    if studio.frames > SETTLING_FRAMES && !studio.is_reading {
        studio.is_reading = true;
        commands.spawn(Readback::texture(studio.target.clone())).observe(receive);
    }
}

/// Keeps the image of a light.
fn receive(read: On<ReadbackComplete>, mut commands: Commands, mut studio: ResMut<Studio>) {
    // A copy that was under way when the first one arrived.
    if !studio.is_reading {
        return;
    }
    let halves = |bytes: &[u8]| f16::from_le_bytes([bytes[0], bytes[1]]).to_f32();
    let pixel = |bytes: &[u8]| [halves(&bytes[0..2]), halves(&bytes[2..4]), halves(&bytes[4..6])];
    let rgb: Vec<[f32; 3]> = read.data.chunks_exact(8).map(pixel).collect();
    commands.entity(read.entity).despawn();
    studio.images.push(Radiance { width: SIZE.x, height: SIZE.y, rgb });
    (studio.is_reading, studio.frames) = (false, 0);
}

fn choose(keys: Res<ButtonInput<KeyCode>>, mut studio: ResMut<Studio>) {
    let (pattern, exposure) = (studio.pattern, studio.exposure);
    let pattern = if keys.just_pressed(KeyCode::Space) {
        match pattern {
            Pattern::Code => Pattern::Scrambled,
            Pattern::Scrambled => Pattern::OneFrequency,
            Pattern::OneFrequency => Pattern::Authorised,
            Pattern::Authorised => Pattern::Code,
        }
    } else {
        pattern
    };
    let longer = usize::from(keys.just_pressed(KeyCode::ArrowUp));
    let shorter = usize::from(keys.just_pressed(KeyCode::ArrowDown));
    let exposure = (exposure + longer).saturating_sub(shorter).min(EXPOSURES.len() - 1);
    if (pattern, exposure) != (studio.pattern, studio.exposure) {
        (studio.pattern, studio.exposure, studio.is_changed) = (pattern, exposure, true);
    }
}

/// Takes a few images a second, and reports on the first after a change.
fn expose(
    time: Res<Time>,
    mut studio: ResMut<Studio>,
    mut images: ResMut<Assets<Image>>,
    mut report: Single<&mut Text, With<Report>>,
    mut last: Local<f64>,
) {
    let now = time.elapsed_secs_f64();
    if studio.images.len() < LIGHTS.len() || (now - *last < 0.2 && !studio.is_changed) {
        return;
    }
    *last = now;
    let (taken, steady) = match take(&studio, now) {
        Ok(images) => images,
        Err(error) => {
            error!("no image: {error}");
            return;
        }
    };
    let picture = tone::display(&taken, tone::middle_grey_ev100(&steady));
    if let Some(mut image) = images.get_mut(&studio.shown) {
        image.data = Some(picture.rgb.iter().flat_map(|[r, g, b]| [*r, *g, *b, 255]).collect());
    }
    if !std::mem::take(&mut studio.is_changed) {
        return;
    }
    let detector = Detector { rows_per_second: READ_OUT, tolerance: 0.03, ..Detector::strict() };
    match detector.detect(&taken, &coded::ratios(&CODE)) {
        Ok(verdict) => {
            let line = format!(
                "{:?}, 1/{} s: {} ({} matching ratios, {} needed)",
                studio.pattern,
                EXPOSURES[studio.exposure],
                if verdict.is_protected() { "a code" } else { "no code" },
                verdict.matches,
                verdict.threshold
            );
            println!("{line}");
            report.0 = format!("{line}\nSpace: pattern   Up, Down: exposure");
        }
        Err(error) => error!("no verdict: {error}"),
    }
}

/// The image of a frame that begins at `start`, seconds; and that of steady lights.
fn take(studio: &Studio, start: f64) -> Result<(Radiance, Radiance), CodedError> {
    let exposure = 1.0 / EXPOSURES[studio.exposure];
    let shutter = Shutter::new(exposure, 1.0 / READ_OUT, SIZE.y)?;
    let steady = vec![1.0; SIZE.y as usize];
    let wave = |frequency| Waveform::new(frequency, 0.5, 0.0, 1.0);
    let profile = match studio.pattern {
        Pattern::Code => {
            // Each frequency for a third of a frame.
            let dwell = f64::from(SIZE.y) / READ_OUT / 3.0;
            shutter.profile(&coded::barcode(&CODE, dwell, 0.5, 1.0)?, start)
        }
        Pattern::Scrambled => {
            shutter.profile(&Sequence::scrambled(2, 200.0, 50.0, 0.5, 1.0)?, start)
        }
        Pattern::OneFrequency => shutter.profile(&wave(400.0)?, start),
        Pattern::Authorised => {
            shutter.profile(&wave(coded::authorised_frequency(exposure, 1)?)?, start)
        }
    };
    let image = |modulated: &[f64]| {
        let lights: Vec<(&Radiance, [&[f64]; 3])> = studio
            .images
            .iter()
            .enumerate()
            .map(|(i, image)| {
                (image, [if i + 1 < LIGHTS.len() { modulated } else { &steady[..] }; 3])
            })
            .collect();
        coded::compose(&lights)
    };
    Ok((image(&profile)?, image(&steady)?))
}
