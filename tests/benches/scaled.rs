//! Resolution scale in every arrangement of cameras: cost, error against the native size, images.
//!
//! `make bench BENCH=scaled ARGS='[--size WxH] [--count FRAMES] [ARRANGEMENT]…'`.
//!
//! `courtyard` at low settings of global illumination, which keep what the scale does to the fixed
//! cost of a frame visible. Error is 1 − SSIM against the same arrangement at scale 1, over what the
//! scaled cameras show. Costs are medians of FRAMES frames, of which scales take turns, relative to
//! scale 1.

use std::path::Path;

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Camera, CameraOutputMode, ClearColorConfig, Hdr, RenderTarget};
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy::ui::{IsDefaultUiCamera, UiPlugin};
use bevy::ui_render::UiRenderPlugin;
use bevy_frugal_gi::knobs::KnobSettings;
use bevy_frugal_gi::resolution::ResolutionScale;
use frugal::stage::{Stage, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::{Clock, median};
use frugal_tests::set;
use frugal_tests::table::markdown;
use frugal_trace::metrics::{Picture, ssim};

const SCALES: [&str; 6] = ["100%", "90%", "80%", "70%", "60%", "50%"];
const SETTINGS: &str =
    "gi_vpl_count=256,gi_pixel_fraction=1/4,gi_visibility=coarse,ambient_occlusion=off";
/// The layer of what a camera over another shows.
const OVERLAY: RenderLayers = RenderLayers::layer(3);

/// How cameras share a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Arrangement {
    /// One camera.
    Whole,
    /// Two viewports side by side, both scaled.
    Split,
    /// A small scaled viewport in the corner of a camera at its native size.
    Inset,
    /// A scaled camera that clears nothing over another scaled one, as a first-person view model.
    Blended,
    /// One camera with bloom.
    Bloom,
    /// One camera after its target has been resized.
    Resized,
    /// One camera under a user interface of a camera of its own.
    Interface,
}

impl Arrangement {
    const ALL: [Self; 7] = [
        Self::Whole,
        Self::Split,
        Self::Inset,
        Self::Blended,
        Self::Bloom,
        Self::Resized,
        Self::Interface,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::Split => "split",
            Self::Inset => "inset",
            Self::Blended => "blended",
            Self::Bloom => "bloom",
            Self::Resized => "resized",
            Self::Interface => "interface",
        }
    }

    /// The part of the target that scaled cameras fill: corner and size, pixels.
    fn part(self, size: UVec2) -> (UVec2, UVec2) {
        match self {
            Self::Inset => (size / 2, size - size / 2),
            // Without the lines of text below.
            Self::Interface => (UVec2::ZERO, UVec2::new(size.x, size.y / 2)),
            Self::Resized => (UVec2::ZERO, resized(size)),
            _ => (UVec2::ZERO, size),
        }
    }
}

fn resized(size: UVec2) -> UVec2 {
    (size * 3 / 4).max(UVec2::splat(32))
}

struct Bench {
    stage: Stage,
    size: UVec2,
    camera: Entity,
    /// The cameras that are scaled, beside the stage's own.
    others: Vec<Entity>,
    arrangement: Arrangement,
}

impl Bench {
    fn open(arrangement: Arrangement, size: UVec2) -> Self {
        let scene = set::scene("courtyard");
        let mut stage = set::open_with(&scene, set::options(size.x, size.y), |app| {
            app.add_plugins((UiPlugin, UiRenderPlugin));
        });
        let pose = scene.paths["tour"].sample(4.0).expect("courtyard has a tour");
        stage.place(pose.position, pose.rotation);
        let camera = set::camera(&mut stage);
        let mut bench = Self { stage, size, camera, others: Vec::new(), arrangement };
        bench.arrange(pose.position, pose.rotation * Vec3::NEG_Z);
        bench
    }

    fn arrange(&mut self, position: Vec3, ahead: Vec3) {
        let (size, half, camera) = (self.size, self.size / 2, self.camera);
        match self.arrangement {
            Arrangement::Whole | Arrangement::Bloom => {}
            Arrangement::Split => {
                let left = UVec2::new(half.x, size.y);
                set::set_viewport(&mut self.stage, camera, UVec2::ZERO, left);
                let second = set::add_camera(&mut self.stage, position, position - ahead);
                let right = UVec2::new(size.x - half.x, size.y);
                set::set_viewport(&mut self.stage, second, UVec2::new(half.x, 0), right);
                self.others.push(second);
            }
            Arrangement::Inset => {
                let second = set::add_camera(&mut self.stage, position, position - ahead);
                set::set_viewport(&mut self.stage, second, half, size - half);
                self.others.push(second);
            }
            Arrangement::Blended => {
                let second = set::add_camera(&mut self.stage, Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO);
                let world = self.stage.world_mut();
                let mesh = world.resource_mut::<Assets<Mesh>>().add(Torus::new(0.3, 0.8));
                let material =
                    world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
                        base_color: Color::srgb(0.9, 0.5, 0.1),
                        unlit: true,
                        ..default()
                    });
                world.spawn((Mesh3d(mesh), MeshMaterial3d(material), OVERLAY));
                let mut second_camera = world.entity_mut(second);
                second_camera.insert(OVERLAY);
                if let Some(mut camera) = second_camera.get_mut::<Camera>() {
                    camera.clear_color = ClearColorConfig::None;
                }
                self.others.push(second);
            }
            Arrangement::Resized => {
                (0..3).for_each(|_| self.stage.frame());
                let world = self.stage.world_mut();
                let target = world.get::<RenderTarget>(camera).expect("a target").clone();
                let RenderTarget::Image(target) = target else { panic!("a stage has an image") };
                let size = resized(size);
                let extent = bevy::render::render_resource::Extent3d {
                    width: size.x,
                    height: size.y,
                    depth_or_array_layers: 1,
                };
                let mut images = world.resource_mut::<Assets<Image>>();
                images.get_mut(&target.handle).expect("the target").resize(extent);
            }
            Arrangement::Interface => {
                let world = self.stage.world_mut();
                let target = world.get::<RenderTarget>(camera).expect("a target").clone();
                let output_mode = CameraOutputMode::Write {
                    blend_state: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                    clear_color: ClearColorConfig::None,
                };
                let clear_color = ClearColorConfig::Custom(Color::NONE);
                let over = Camera { order: 10, clear_color, output_mode, ..default() };
                world.spawn((Camera2d, over, target, Hdr, Msaa::Off, IsDefaultUiCamera));
                let at = Node {
                    position_type: PositionType::Absolute,
                    top: percent(50),
                    width: percent(100),
                    height: percent(50),
                    ..default()
                };
                let font = TextFont { font_size: FontSize::Px(11.0), ..default() };
                world.spawn((
                    Text::new("native size, whatever\nthe scale of the scene"),
                    font,
                    at,
                    BackgroundColor(Color::BLACK),
                ));
            }
        }
    }

    /// Gives every scaled camera `scale`.
    fn scale(&mut self, scale: &str) {
        let own = if self.arrangement == Arrangement::Inset { "100%" } else { scale };
        let bloom = if self.arrangement == Arrangement::Bloom { "high" } else { "off" };
        let text = format!("{SETTINGS},post_processing={bloom},resolution_scale={own}");
        set::switch(&mut self.stage, &text);
        let knobs = self.stage.world_mut().get::<KnobSettings>(self.camera).cloned();
        let share = scale.trim_end_matches('%').parse::<f32>().unwrap_or(100.0) / 100.0;
        for other in self.others.clone() {
            let mut other = self.stage.world_mut().entity_mut(other);
            match (&knobs, self.arrangement) {
                (Some(knobs), Arrangement::Split) => other.insert(knobs.clone()),
                _ => other.remove::<KnobSettings>().insert(ResolutionScale(share)),
            };
        }
    }

    fn picture(&mut self) -> Picture {
        self.stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
        self.stage.picture().unwrap_or_else(|error| panic!("{error}"))
    }
}

fn cropped(picture: &Picture, (corner, size): (UVec2, UVec2)) -> Picture {
    let rows = (corner.y..corner.y + size.y).flat_map(|y| {
        let start = (y * picture.width + corner.x) as usize;
        picture.rgb[start..start + size.x as usize].iter().copied()
    });
    Picture { width: size.x, height: size.y, rgb: rows.collect() }
}

/// What was measured at one scale.
struct Found {
    /// Median time of a frame relative to scale 1.
    cost: f64,
    error: f64,
}

fn measure(arrangement: Arrangement, options: &Arguments, images: &Path) -> Vec<Found> {
    let clock = Clock::suitable();
    let mut bench = Bench::open(arrangement, options.size);
    let part = arrangement.part(options.size);
    let pictures: Vec<Picture> = SCALES
        .iter()
        .map(|scale| {
            bench.scale(scale);
            let picture = bench.picture();
            let name = format!("{}-{}.png", arrangement.name(), scale.trim_end_matches('%'));
            picture.write_png(&images.join(name)).unwrap_or_else(|e| panic!("{e}"));
            picture
        })
        .collect();
    let mut times = vec![Vec::new(); SCALES.len()];
    for round in 0..options.count as usize {
        for turn in 0..SCALES.len() {
            // Forwards and backwards in turn, so that drift of the machine evens out.
            let index = if round % 2 == 0 { turn } else { SCALES.len() - 1 - turn };
            bench.scale(SCALES[index]);
            (0..3).for_each(|_| bench.stage.frame());
            times[index].push(clock.frames_ms(&mut bench.stage, 4));
        }
    }
    let native = median(times[0].clone());
    let reference = cropped(&pictures[0], part);
    if arrangement == Arrangement::Interface {
        let below = (UVec2::new(0, options.size.y / 2), options.size / UVec2::new(1, 2));
        let same = pictures
            .iter()
            .filter(|picture| cropped(picture, below).rgb == cropped(&pictures[0], below).rgb)
            .count();
        println!("interface: {same} of {} images have the same text to the bit\n", pictures.len());
    }
    pictures
        .iter()
        .zip(times)
        .map(|(picture, times)| Found {
            cost: median(times) / native,
            error: ssim::error(&reference, &cropped(picture, part))
                .unwrap_or_else(|error| panic!("{error}")),
        })
        .collect()
}

fn main() {
    let options =
        Arguments { size: UVec2::new(320, 180), samples: 0, count: 7, names: vec![] }.read();
    let Some(adapter) = adapter() else {
        println!("no graphics adapter: nothing is measured");
        return;
    };
    let images = frugal_tests::folder::workspace().join("target/scaled");
    std::fs::create_dir_all(&images).unwrap_or_else(|error| panic!("{images:?}: {error}"));
    println!(
        "{}; `courtyard`, {}x{}, {} rounds; images in target/scaled\n",
        adapter.name, options.size.x, options.size.y, options.count
    );
    let mut rows = Vec::new();
    for arrangement in Arrangement::ALL {
        if options.wants(arrangement.name()) {
            let found = measure(arrangement, &options, &images);
            let cells = found.iter().map(|found| format!("{:.2}, {:.4}", found.cost, found.error));
            rows.push(std::iter::once(arrangement.name().to_owned()).chain(cells).collect());
        }
    }
    let headers: Vec<&str> = std::iter::once("cost, error at").chain(SCALES).collect();
    println!("{}", markdown::<String>(&headers, &rows));
}
