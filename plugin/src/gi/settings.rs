//! Settings of a camera's global illumination.

use bevy::camera::{Camera3d, Hdr};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::prelude::*;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::view::Msaa;

/// Global illumination on this camera: one or more diffuse [bounces](Self::bounces) of every
/// directional, spot and point light, from virtual point lights (VPLs) sampled in reflective shadow
/// maps; light of emissive surfaces; and shadowed light of the camera's
/// [`EnvironmentMapLight`](bevy::light::EnvironmentMapLight).
///
/// Needs the deferred renderer, which [`GiPlugin`](super::GiPlugin) makes the default, and no
/// multisampling. A camera without this component costs nothing.
#[derive(Component, ExtractComponent, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(Camera3d, Hdr, Msaa::Off, DepthPrepass, DeferredPrepass)]
pub struct FrugalGi {
    /// Number of virtual point lights for the whole image. Every low-resolution pixel evaluates its
    /// [interleaved](Self::interleave) share of them. Higher values: smoother, and nearer the
    /// reference. Lower values: blotchier. 0 turns GI off: nothing is rendered, allocated or
    /// dispatched for it. At most [`MAX_VPL_COUNT`](Self::MAX_VPL_COUNT), and at most
    /// [`MAX_VPLS_PER_PIXEL`](Self::MAX_VPLS_PER_PIXEL) for a pixel.
    pub vpl_count: u32,
    /// Side of the square of low-resolution pixels among which the VPLs are interleaved. Larger:
    /// cheaper in proportion to its area, and softer, since a filter along surfaces averages over
    /// the square. Smaller: finer detail at edges and on small objects.
    pub interleave: GiInterleave,
    /// Visibility of VPLs from surfaces. Finer: less noise in indirect shadows, more rays. With
    /// [`Cached`](GiVisibility::Cached) surfaces share rays, from frame to frame.
    pub visibility: GiVisibility,
    /// Samples of the sky that every low-resolution pixel evaluates, where the camera has an
    /// [`EnvironmentMapLight`](bevy::light::EnvironmentMapLight): directions sampled by the map's
    /// radiance times its visibility from the surfaces in view, one set for each pixel of the
    /// [`interleave`](Self::interleave) square. [`visibility`](Self::visibility) sets the number of
    /// rays to the sky, too. Higher values: less noise in the sky's shadows, and a finer map. With
    /// 0, or without rays, Bevy's own unshadowed diffuse light of the map stays. Else ours replaces
    /// it (Bevy's reflections stay), also on meshes that are not deferred, which then receive it
    /// within reach of [`forward_spacing`](Self::forward_spacing). At most
    /// [`MAX_ENVIRONMENT_SAMPLES`](Self::MAX_ENVIRONMENT_SAMPLES).
    pub environment_samples: u32,
    /// Number of diffuse bounces. Emissive surfaces and the sky get one fewer. Without
    /// [`visibility`](Self::visibility) it is 1. Higher values: brighter shadows and rooms, nearer
    /// the converged solution (at an albedo of one half, 1 yields half of all indirect light, 2
    /// three quarters). Each further bounce costs a pass over the maps' texels and 16,384 rays
    /// (20,480 with a sky), but not in every frame: only when the maps are rendered, when the sky
    /// or these settings change, and when the camera has moved by a fortieth of
    /// [`range`](Self::range). At most [`MAX_BOUNCES`](Self::MAX_BOUNCES).
    pub bounces: u32,
    /// Whether emissive surfaces light others: visible meshes of a `StandardMaterial` with
    /// `emissive`, but unlit and skinned ones. Costs nothing where there are none.
    pub emissive: bool,
    /// Share of pixels at which the VPLs are gathered; the others are upsampled along surfaces.
    /// Higher values: finer indirect detail, at proportional cost. Lower values: indirect light
    /// blurs across small features.
    pub pixel_fraction: GiPixelFraction,
    /// Texels along the edge of a directional or spot light's reflective shadow map (a point
    /// light's six faces have a quarter as many, but 32 where that is less and half is more).
    /// Higher values: smaller lit features are captured, and the map's rasterisation costs more. In
    /// 16 to 2048.
    pub rsm_resolution: u32,
    /// Period, in frames, at which the maps are rendered and VPLs sampled while something moves.
    /// Higher values: light that moves, and light on moving surfaces, lags by as many frames, and
    /// the maps cost that much less. 1: no lag. While nothing moves, nothing is rendered again; see
    /// [`GiRefresh`](super::GiRefresh). Cameras that share lights share the shortest period.
    pub refresh_period: u32,
    /// Radius around the camera, in metres, within which directional lights bounce; for a camera
    /// outside the scene's bounding box, around where its view enters the box, and at least what
    /// fills the view there. Light fades over the outer quarter of the radius. Scenes smaller than
    /// twice the radius are covered as a whole. A second, finer cascade covers 0.3 of the radius,
    /// where that is much less than the scene. Higher values: more distant bounces, fewer
    /// texels on near surfaces.
    pub range: f32,
    /// Length of temporal accumulation, in frames, while something moves. History is rejected at
    /// disocclusions and where luminance changes by 95 % or more (lights that are switched). Higher
    /// values: less flicker, and light that moves lags by about as many frames. 1: no accumulation.
    /// In 1 to 64. Not across a [cut](super::CameraCut).
    pub history_frames: u32,
    /// Frames for which a camera at rest goes on gathering, each with other samples: the image
    /// converges to their mean, and then nothing is gathered until something changes. Higher values:
    /// less noise and finer detail at rest, and the gather's cost for that much longer after each
    /// stop. 0: history fades out, and the noise of the last gather stays. In 0 to
    /// [`MAX_REST_FRAMES`](Self::MAX_REST_FRAMES). Without [`visibility`](Self::visibility) and
    /// [`interleave`](Self::interleave) there is no history, and nothing to average.
    pub rest_frames: u32,
    /// Whether Bevy's [irradiance volumes](bevy::light::IrradianceVolume) light the camera while it
    /// gathers. `true` suits volumes that hold only what is not gathered, such as light of
    /// punctual lights without a map; else their light counts twice. Where GI is off they always do.
    pub irradiance_volumes: bool,
    /// Distance between the places around the camera, in metres, at which light is sampled for meshes
    /// that are not deferred: forward-rendered, transparent and transmissive ones of any material
    /// that Bevy lights. There are 32 × 16 × 32 places. They exist once the camera draws such a mesh,
    /// need [`visibility`](Self::visibility), and cost 2.4 MB; in a frame up to 8,192 rays to VPLs, as
    /// many to the sky, and as many to neighbours, and none once nothing changes. Higher values: light
    /// reaches farther from the camera (16 steps, 8 upwards), is coarser, and leaks through walls
    /// thinner than a step. In 0.01 to 100. 0, or with
    /// [`irradiance_volumes`](Self::irradiance_volumes): such meshes receive none.
    pub forward_spacing: f32,
    /// Reflection model of indirect light. Costs nothing.
    pub shading: GiShading,
    /// Output written to the image.
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

    /// Largest [`bounces`](Self::bounces).
    pub const MAX_BOUNCES: u32 = 8;

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
            bounces: 1,
            emissive: true,
            pixel_fraction: GiPixelFraction::Quarter,
            rsm_resolution: 128,
            refresh_period: 1,
            range: 40.0,
            history_frames: 32,
            rest_frames: 64,
            irradiance_volumes: false,
            forward_spacing: 0.5,
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
    Eight,
    /// Each of 4 × 4 pixels evaluates a 16th.
    #[default]
    Four,
    /// Each of 2 × 2 pixels evaluates a quarter.
    Two,
    /// Every pixel evaluates all.
    One,
}

impl GiInterleave {
    /// All, cheapest first.
    pub const ALL: [Self; 4] = [Self::Eight, Self::Four, Self::Two, Self::One];

    /// Pixels along the side of the square.
    pub const fn side(self) -> u32 {
        match self {
            Self::Eight => 8,
            Self::Four => 4,
            Self::Two => 2,
            Self::One => 1,
        }
    }
}

/// Visibility of VPLs from surfaces: shadow rays per low-resolution pixel.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum GiVisibility {
    /// No rays: light leaks through walls.
    None,
    /// At most 4,096 places of the image are lit in a frame, by two rays each, whatever its size; about
    /// as many rays again find the cells that they light while a view is new. What they receive is kept
    /// in the world, in cells of surface of 0.9 degrees or more, which all pixels show: far fewer rays
    /// than `Coarse` (at 640×360 less than half), none once nothing changes, no filters, and 4 MB.
    /// Softer: shadows smaller than a cell are lost. After a cut light is coarse for some frames. Where
    /// lights or meshes change, a quarter of the old light is left after twelve frames.
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

    /// Rays to VPLs per low-resolution pixel, or per place that is lit.
    pub const fn rays(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Cached | Self::Coarse => 2,
            Self::Fine => 8,
        }
    }

    /// Rays to the sky per low-resolution pixel, or per place that is lit, where the sky is gathered.
    pub const fn sky_rays(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Cached | Self::Coarse => 2,
            Self::Fine => 8,
        }
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
    /// The albedo of Bevy's own shading under uniform incident light: its diffuse term, which
    /// reflects more at grazing angles the rougher a surface is, and its specular term, by which
    /// metals reflect. Correct in the mean, without highlights of single bright spots. The specular
    /// term fades out below a perceptual roughness of 0.4 and is gone at 0.2: such surfaces are
    /// left to screen-space reflections.
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

/// Limits for the whole app.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub struct GiLimits {
    /// Most reflective shadow maps (a point light has six). Where lights need more, those that
    /// illuminate the surroundings of a GI camera most keep theirs; others fade in and out as the
    /// camera moves. Higher values: more lights bounce; each map's texels take memory, and time where
    /// VPLs are sampled.
    pub max_rsm_count: usize,
    /// Most maps rendered in a frame, but at least those of one light. Maps that are not out of date
    /// need none; of the others, those that matter most or have waited longest come first. A map
    /// costs about as much as a shadow map. Higher values: light follows sooner where many maps
    /// change at once. After a [cut](super::CameraCut) all are rendered.
    pub max_rsms_per_frame: usize,
}

impl Default for GiLimits {
    fn default() -> Self {
        Self { max_rsm_count: 384, max_rsms_per_frame: 24 }
    }
}
