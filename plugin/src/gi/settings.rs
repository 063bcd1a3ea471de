//! Settings of a camera's global illumination.

use bevy::camera::{Camera3d, Hdr};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::prelude::*;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::view::Msaa;

/// Global illumination on this camera, from three sources: diffuse [bounces](Self::bounces) of
/// directional, spot and point lights, by virtual point lights (VPLs) sampled in reflective shadow
/// maps; emissive surfaces; and the camera's
/// [`EnvironmentMapLight`](bevy::light::EnvironmentMapLight), with shadows.
///
/// Needs deferred rendering, which [`GiPlugin`](super::GiPlugin) makes the default, and no
/// multisampling. A camera without this component costs nothing.
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(Camera3d, Hdr, Msaa::Off, DepthPrepass, DeferredPrepass)]
pub struct FrugalGi {
    /// Number of virtual point lights (VPLs) for the whole image, 0 to
    /// [`MAX_VPL_COUNT`](Self::MAX_VPL_COUNT). Each low-resolution pixel evaluates its
    /// [interleaved](Self::interleave) share, at most
    /// [`MAX_VPLS_PER_PIXEL`](Self::MAX_VPLS_PER_PIXEL). Higher values: less noise, at proportional
    /// cost. Lower values: blotchier. 0 turns GI off: its light fades within half a second, or at a
    /// [cut](super::CameraCut) at once, and then costs nothing; light that is switched on comes as
    /// gradually. Default: 1024.
    pub vpl_count: u32,
    /// Side of a square of low-resolution pixels that share the VPLs: each evaluates another part,
    /// and a filter along surfaces averages the square. Larger: softer, and cheaper in proportion
    /// to the square's area. Smaller: finer detail at edges and on small objects. Default: `Four`.
    pub interleave: GiInterleave,
    /// Rays from surfaces to VPLs. Finer: less noise in indirect shadows, more rays.
    /// [`Cached`](GiVisibility::Cached) shares rays among pixels and frames. Default: `Coarse`.
    pub visibility: GiVisibility,
    /// Samples of the camera's [`EnvironmentMapLight`](bevy::light::EnvironmentMapLight) for each
    /// low-resolution pixel, 0 to [`MAX_ENVIRONMENT_SAMPLES`](Self::MAX_ENVIRONMENT_SAMPLES).
    /// Directions are sampled by the map's radiance times its visibility from the surfaces in view.
    /// [`visibility`](Self::visibility) sets the number of rays. Higher values: less noise in the
    /// sky's shadows and a finer map, at proportional cost. Default: 16.
    ///
    /// The samples replace Bevy's diffuse light of the map, also on meshes that are not deferred,
    /// within reach of [`forward_spacing`](Self::forward_spacing). Bevy's reflections stay. With 0,
    /// or without rays, Bevy's unshadowed diffuse light stays.
    pub environment_samples: u32,
    /// Number of diffuse bounces, 1 to [`MAX_BOUNCES`](Self::MAX_BOUNCES), or
    /// [`ALL_BOUNCES`](Self::ALL_BOUNCES). Emissive surfaces and the sky get one fewer. Without
    /// [`visibility`](Self::visibility) it is 1. Higher values: brighter shadows and rooms, nearer
    /// the converged solution (at an albedo of one half, 1 yields half of all indirect light, 3
    /// seven eighths). Default: all.
    ///
    /// Each further bounce costs 16,384 rays, the second also a pass over the maps' texels and 4,096
    /// rays to the sky. `ALL_BOUNCES` costs as much as 3 and adds the rest of the series, estimated
    /// from the ratio of the last two bounces in the whole scene. A bounce runs when the maps are rendered, when the sky or these settings change, and after the
    /// camera has moved by a fortieth of [`range`](Self::range); under a sky that is generated in
    /// every frame, it runs in every frame.
    pub bounces: u32,
    /// Whether emissive surfaces light others: visible meshes whose `StandardMaterial` has
    /// `emissive`, except unlit and skinned ones. Costs nothing without such meshes. Default: true.
    pub emissive: bool,
    /// Share of pixels at which the VPLs are gathered; the others are upsampled along surfaces.
    /// Higher values: finer indirect detail, at proportional cost. Lower values: indirect light
    /// blurs across small features. Default: `Quarter`.
    pub pixel_fraction: GiPixelFraction,
    /// Texels along the edge of a directional or spot light's reflective shadow map, 16 to 2048.
    /// Two cascades of a directional light have 11/16 as many each; a point light's six maps a
    /// quarter as many, at least 32 and at most half. Higher values: smaller lit features are
    /// captured, and rasterisation costs more. Default: 128.
    pub rsm_resolution: u32,
    /// Period, in frames, at which maps are rendered and VPLs sampled while something moves; 0
    /// counts as 1. Higher values: the maps cost that much less; moving lights, and light on moving
    /// surfaces, lag by as many frames. 1: no lag. While nothing moves, nothing is rendered again;
    /// see [`GiRefresh`](super::GiRefresh). Maps follow the shortest period of all active cameras.
    /// Default: 1.
    pub refresh_period: u32,
    /// Radius around the camera, in metres, within which directional lights bounce; above 0 and
    /// finite, other values cover the whole scene. For a camera outside the scene's bounding box,
    /// the centre is where its view enters the box, and the radius at least what fills the view
    /// there. Light fades over the outer quarter. Scenes smaller than twice the radius are covered
    /// as a whole. A finer cascade covers 0.3 of the radius, where that is much less than the
    /// scene. Higher values: more distant bounces, fewer texels on near surfaces. Default: 40.
    pub range: f32,
    /// Length of temporal accumulation, in frames, while something moves, 1 to 64. Higher values:
    /// less flicker, and moving light lags by about as many frames. 1: no accumulation. History is
    /// rejected at disocclusions, where luminance changes by 95 % or more (a light is switched),
    /// and at a [cut](super::CameraCut). Default: 32.
    pub history_frames: u32,
    /// Frames for which a camera at rest goes on gathering, 0 to
    /// [`MAX_REST_FRAMES`](Self::MAX_REST_FRAMES). Each takes other samples, and the image
    /// converges to their mean; then nothing is gathered until something changes. Higher values:
    /// less noise and finer detail at rest, at the gather's cost for longer after each stop. 0:
    /// history fades out, and the noise of the last gather stays. No effect with
    /// `GiVisibility::None` and `GiInterleave::One` together, where there is no noise. Default: 64.
    pub rest_frames: u32,
    /// Whether Bevy's [irradiance volumes](bevy::light::IrradianceVolume) light the camera while it
    /// gathers. Use `true` where volumes hold only light that GI lacks, such as punctual lights
    /// without a map; other light counts twice. Volumes always light a camera whose GI is off.
    /// Default: false.
    pub irradiance_volumes: bool,
    /// Distance, in metres, between the 32 × 16 × 32 places around the camera at which light is
    /// sampled for meshes that are not deferred: forward-rendered, transparent and transmissive
    /// ones of any material that Bevy lights. 0.01 to 100; with 0, or with
    /// [`irradiance_volumes`](Self::irradiance_volumes), such meshes receive none. Higher values:
    /// light reaches farther from the camera (16 steps, 8 upwards), is coarser, and leaks through
    /// walls thinner than a step. Default: 0.5.
    ///
    /// The places exist once the camera draws such a mesh, or [`fog`](Self::fog). They need
    /// [`visibility`](Self::visibility) and 2.4 MB. A frame traces up to 8,192 rays to VPLs, as
    /// many to the sky and as many to neighbours: eight times as many after a cut or a jump, and
    /// none once nothing changes.
    pub forward_spacing: f32,
    /// Whether indirect light and the sky's light up fog: every
    /// [`FogVolume`](bevy::light::FogVolume), for a camera with
    /// [`VolumetricFog`](bevy::light::VolumetricFog), in place of that component's ambient light. The
    /// light is that of [`forward_spacing`](Self::forward_spacing)'s places; beyond them, fog has the
    /// light of the nearest. A ray takes a quarter of the component's steps: higher values have less
    /// banding, at proportional cost. Default: true.
    pub fog: bool,
    /// Reflection model of indirect light; all cost the same. Default: `Standard`.
    pub shading: GiShading,
    /// What GI writes to the image. Default: `Added`.
    pub output: GiOutput,
}

impl FrugalGi {
    /// Largest [`vpl_count`](Self::vpl_count).
    pub const MAX_VPL_COUNT: u32 = 16_384;
    /// Most VPLs that one pixel evaluates.
    pub const MAX_VPLS_PER_PIXEL: u32 = 1024;

    /// Largest [`environment_samples`](Self::environment_samples).
    pub const MAX_ENVIRONMENT_SAMPLES: u32 = 32;

    /// Largest [`rest_frames`](Self::rest_frames).
    pub const MAX_REST_FRAMES: u32 = 256;

    /// Largest number of [`bounces`](Self::bounces) that are counted.
    pub const MAX_BOUNCES: u32 = 8;

    /// All [`bounces`](Self::bounces), and what any larger number means.
    pub const ALL_BOUNCES: u32 = Self::MAX_BOUNCES + 1;

    /// Whether VPLs are sampled and gathered for this camera.
    pub(super) fn gathers(&self) -> bool {
        self.vpl_count > 0 && self.output != GiOutput::MapsOnly
    }

    /// Whether rays are traced for this camera.
    pub(super) fn traces(&self) -> bool {
        self.gathers() && self.visibility.rays() > 0
    }

    /// Whether light is kept in cells of surface, in place of the gather and its filters.
    pub(super) fn caches(&self) -> bool {
        self.gathers() && self.visibility == GiVisibility::Cached
    }

    /// Whether neighbouring low-resolution pixels use different VPLs or rays, whose noise is
    /// filtered in space and time.
    pub(super) fn filters(&self) -> bool {
        !self.caches() && (self.interleave.side() > 1 || self.visibility.rays() > 0)
    }

    /// Whether light converges while nothing changes.
    pub(super) fn converges(&self) -> bool {
        self.caches() || self.filters()
    }

    /// Whether this camera has more than one bounce.
    pub(super) fn reflects(&self) -> bool {
        self.traces() && self.bounces > 1
    }
}

impl Default for FrugalGi {
    fn default() -> Self {
        Self {
            vpl_count: 1024,
            interleave: GiInterleave::Four,
            visibility: GiVisibility::Coarse,
            environment_samples: 16,
            bounces: Self::ALL_BOUNCES,
            emissive: true,
            pixel_fraction: GiPixelFraction::Quarter,
            rsm_resolution: 128,
            refresh_period: 1,
            range: 40.0,
            history_frames: 32,
            rest_frames: 64,
            irradiance_volumes: false,
            forward_spacing: 0.5,
            fog: true,
            shading: GiShading::Standard,
            output: GiOutput::Added,
        }
    }
}

/// Share of the pixels at which indirect light is gathered.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum GiPixelFraction {
    /// One pixel in 4 × 4.
    Sixteenth,
    /// One pixel in 2 × 2.
    #[default]
    Quarter,
    /// Every other column.
    Half,
    /// Every pixel.
    Full,
}

impl GiPixelFraction {
    /// All, cheapest first.
    pub const ALL: [Self; 4] = [Self::Sixteenth, Self::Quarter, Self::Half, Self::Full];

    /// Width and height in pixels of a low-resolution pixel.
    pub const fn cell(self) -> (u32, u32) {
        match self {
            Self::Sixteenth => (4, 4),
            Self::Quarter => (2, 2),
            Self::Half => (2, 1),
            Self::Full => (1, 1),
        }
    }

    /// Share of pixels gathered, in (0, 1].
    pub const fn share(self) -> f64 {
        let (width, height) = self.cell();
        1.0 / (width * height) as f64
    }
}

/// Interleaving of the VPLs among low-resolution pixels (Keller and Heidrich 2001, "Interleaved
/// Sampling").
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum GiInterleave {
    /// Each of 8 × 8 pixels evaluates a 64th of the VPLs.
    Eight = 8,
    /// Each of 4 × 4 pixels evaluates a 16th.
    #[default]
    Four = 4,
    /// Each of 2 × 2 pixels evaluates a quarter.
    Two = 2,
    /// Every pixel evaluates all.
    One = 1,
}

impl GiInterleave {
    /// All, cheapest first.
    pub const ALL: [Self; 4] = [Self::Eight, Self::Four, Self::Two, Self::One];

    /// Pixels along the side of the square.
    pub const fn side(self) -> u32 {
        self as u32
    }
}

/// Visibility of VPLs from surfaces: shadow rays per low-resolution pixel.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum GiVisibility {
    /// No rays: light leaks through walls.
    None,
    /// Two rays each for at most 4,096 pixels of a frame, at any resolution. Their light is kept in
    /// the world, in cells of surface that appear 0.9 degrees wide or more, and all pixels show
    /// them. While a view is new, about as many rays again find the cells that a pixel lights.
    /// Cheaper than `Coarse`: fewer rays, none once nothing changes, no filters; takes 4 MB.
    /// Softer: shadows smaller than a cell are lost. After a cut, light is coarse for some frames.
    /// After a change of lights or meshes, old light fades within 28 frames.
    Cached,
    /// Two rays per low-resolution pixel.
    #[default]
    Coarse,
    /// Eight rays per low-resolution pixel.
    Fine,
}

impl GiVisibility {
    /// All, cheapest first.
    pub const ALL: [Self; 4] = [Self::None, Self::Cached, Self::Coarse, Self::Fine];

    /// Rays to VPLs per low-resolution pixel; with `Cached`, per sampled pixel.
    pub const fn rays(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Cached | Self::Coarse => 2,
            Self::Fine => 8,
        }
    }

    /// Rays to the sky per low-resolution pixel (`Cached`: sampled pixel), where it is gathered.
    pub const fn sky_rays(self) -> u32 {
        self.rays()
    }
}

/// Reflection model of indirect light.
///
/// Directions of incident light are not stored: terms that depend on them are averaged over the
/// hemisphere.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum GiShading {
    /// Lambertian reflection by the base colour; metals reflect nothing. For comparison with
    /// Lambertian references.
    #[doc(hidden)]
    Lambertian,
    /// The albedo of Bevy's shading under uniform incident light. Its diffuse term reflects more at
    /// grazing angles on rougher surfaces; by its specular term metals reflect. Correct in the
    /// mean, without highlights of single bright spots. The specular term fades below a perceptual
    /// roughness of 0.4, to nothing at 0.2: such surfaces are left to screen-space reflections.
    #[default]
    Standard,
}

/// Output of GI in the image.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum GiOutput {
    /// Indirect light is added to the rendered image.
    #[default]
    Added,
    /// Indirect light alone, over black: for measurement and inspection.
    IndirectOnly,
    /// None. The reflective shadow maps are rendered, for passes of the app that read them (see
    /// [`inspect`](super::inspect)), but nothing is sampled or gathered.
    #[doc(hidden)]
    MapsOnly,
}

/// Limits of GI's work, for the whole app.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub struct GiLimits {
    /// Most reflective shadow maps; a point light has six. Where lights need more, maps go to the
    /// lights that most illuminate the surroundings of a GI camera; others fade in and out as it
    /// moves. Higher values: more lights bounce; each map takes memory, and time where VPLs are
    /// sampled. Default: 384.
    pub max_rsm_count: usize,
    /// Most maps rendered in a frame, but at least those of one light. Of the maps that are out of
    /// date, those that matter most or have waited longest come first. A map costs about as much as
    /// a shadow map. Higher values: light follows sooner where many maps change at once. After a
    /// [cut](super::CameraCut) all are rendered. Default: 24.
    pub max_rsms_per_frame: usize,
}

impl Default for GiLimits {
    fn default() -> Self {
        Self { max_rsm_count: 384, max_rsms_per_frame: 24 }
    }
}
