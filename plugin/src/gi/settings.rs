//! What an app says of a camera's global illumination.

use bevy::camera::{Camera3d, Hdr};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::prelude::*;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::view::Msaa;

/// Global illumination on this camera: one [bounce](Self::bounces), or more, of every directional,
/// spot and point light, from virtual point lights (VPLs) drawn in reflective shadow maps; the
/// light of [glowing surfaces](super::GiEmitters); and that of the camera's
/// [`EnvironmentMapLight`](bevy::light::EnvironmentMapLight), shadowed.
///
/// Needs the deferred renderer, which [`GiPlugin`](super::GiPlugin) makes the default, and no
/// multisampling. A camera without this component pays nothing.
#[derive(Component, ExtractComponent, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(Camera3d, Hdr, Msaa::Off, DepthPrepass, DeferredPrepass)]
pub struct FrugalGi {
    /// Virtual point lights for the whole picture. Higher values: smoother and nearer the truth;
    /// every gathered pixel evaluates its [interleaved](Self::interleave) share of them. Lower
    /// values: blotchier. 0 turns GI off, and nothing is rendered, allocated or dispatched for it.
    /// At most [`MAX_VPL_COUNT`](Self::MAX_VPL_COUNT), and at most
    /// [`MAX_VPLS_PER_PIXEL`](Self::MAX_VPLS_PER_PIXEL) for a pixel.
    pub vpl_count: u32,
    /// Side of the square of gathered pixels that share the VPLs out among them. Wider: cheaper by
    /// its area, and softer, since a filter along surfaces then joins what the pixels found.
    /// Narrower: more for the same cost at edges and on small things.
    pub interleave: GiInterleave,
    /// Whether what stands between a surface and a VPL is found. Finer: less noise in indirect
    /// shadow, more rays.
    pub visibility: GiVisibility,
    /// Samples of the sky that every gathered pixel evaluates, where the camera has an
    /// [`EnvironmentMapLight`](bevy::light::EnvironmentMapLight): directions drawn by how bright
    /// the map is there and how much of it the picture could receive, each a set of
    /// [`interleave`](Self::interleave)² pixels' own. As many rays again as
    /// [`visibility`](Self::visibility) says find what hides them. Higher values: less noise in the
    /// sky's shadows, and a finer map. 0, or no rays: Bevy's own diffuse light of the map stays,
    /// which nothing shadows. Else ours replaces it (its reflections stay), also on meshes that are
    /// not deferred, to which no global illumination is added. At most
    /// [`MAX_ENVIRONMENT_SAMPLES`](Self::MAX_ENVIRONMENT_SAMPLES).
    pub environment_samples: u32,
    /// Times that light of lamps is reflected on its way to what the camera sees; that of glowing
    /// surfaces and of the sky one time less. Needs [`visibility`](Self::visibility), or it is 1.
    /// Higher values: lighter shadows and rooms, nearer to all the light that there is (where
    /// surfaces reflect half of it, 1 finds half of what is indirect, 2 three quarters); each costs
    /// a pass over the maps' texels and 16,384 rays (20,480 with a sky), but not in every frame:
    /// when the maps are rendered, when the sky or these settings change, and when the camera has
    /// gone a fortieth of [`range`](Self::range). At most [`MAX_BOUNCES`](Self::MAX_BOUNCES). See
    /// [`GiPatches`](super::GiPatches).
    pub bounces: u32,
    /// Whether [glowing surfaces](super::GiEmitters) light others. Costs nothing where there are
    /// none.
    pub emissive: bool,
    /// Share of pixels at which the VPLs are gathered; the others are interpolated along surfaces.
    /// Higher values: finer indirect detail, at proportional cost. Lower values: indirect light
    /// blurs across small features.
    pub pixel_fraction: GiPixelFraction,
    /// Texels along the edge of a directional or spot light's reflective shadow map (a point
    /// light's six faces have a quarter as many, but 32 where that is less and half is more).
    /// Higher values: smaller lit features are found, and the light's rasterisation costs more. In
    /// 16 to 2048.
    pub rsm_resolution: u32,
    /// Frames from one rendering of the maps, and drawing of VPLs, to the next while something
    /// moves. Higher values: light that moves, or on what moves, lags behind by as many frames, and
    /// the maps cost that much less. 1 never lags. Where nothing moves nothing is rendered again,
    /// whatever this says; see [`GiRefresh`](super::GiRefresh). Cameras that share lights share the
    /// smallest.
    pub refresh_period: u32,
    /// How far around the camera, in metres, directional lights bounce. Scenes smaller than twice
    /// that are covered whole. What lies within 0.3 of it has a map of its own, where that is much
    /// less than the scene. Higher values: more distant bounces, fewer texels on near surfaces.
    pub range: f32,
    /// Frames over which light that reaches a place is averaged while something moves, beside what
    /// is thrown away because it was not seen before or because light was switched. Higher values:
    /// less flicker, and light that moves lags behind by about as many frames. 1: none. In 1 to 64;
    /// not for parallel projections, nor after a cut (more than 1 m or 30° in a frame).
    pub history_frames: u32,
    /// How surfaces scatter light that bounces. Free.
    pub shading: GiShading,
    /// What is written into the picture.
    pub output: GiOutput,
}

impl FrugalGi {
    /// Most VPLs of a picture.
    pub const MAX_VPL_COUNT: u32 = 16_384;
    /// Most VPLs that one pixel evaluates: as many of 48 bytes as fit into the 64 KiB of a uniform
    /// buffer that every GPU binds.
    pub const MAX_VPLS_PER_PIXEL: u32 = 1024;

    /// Most samples of the sky that one pixel evaluates.
    pub const MAX_ENVIRONMENT_SAMPLES: u32 = 32;

    /// Most bounces.
    pub const MAX_BOUNCES: u32 = 8;

    /// Whether VPLs are drawn and gathered for this camera.
    pub(super) fn gathers(&self) -> bool {
        self.vpl_count > 0 && self.output != GiOutput::MapsOnly
    }

    /// Whether rays are traced for this camera.
    pub(super) fn traces(&self) -> bool {
        self.gathers() && self.visibility.rays() > 0
    }

    /// Whether light is reflected more than once for this camera.
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
            shading: GiShading::Standard,
            output: GiOutput::Added,
        }
    }
}

/// Share of the pixels at which indirect light is gathered.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
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

    /// Size in pixels of the cell that shares one gather.
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

/// How many gathered pixels share the VPLs out among them (Keller and Heidrich 2001, "Interleaved
/// Sampling").
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
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

/// Whether what stands between a surface and a VPL is found.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
pub enum GiVisibility {
    /// Nothing does: light goes through walls, and a real level gets about a third too much of it.
    None,
    /// Two rays per gathered pixel.
    #[default]
    Coarse,
    /// Eight rays per gathered pixel.
    Fine,
}

impl GiVisibility {
    /// All, cheapest first.
    pub const ALL: [Self; 3] = [Self::None, Self::Coarse, Self::Fine];

    /// Rays per gathered pixel.
    pub const fn rays(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Coarse => 2,
            Self::Fine => 8,
        }
    }

    /// Rays to the sky per gathered pixel, where that is gathered.
    pub const fn sky_rays(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Coarse => 2,
            Self::Fine => 8,
        }
    }
}

/// How surfaces scatter light that bounces.
///
/// The directions from which light arrives at a pixel are not kept: what depends on them is
/// averaged over all.
#[derive(
    Component, ExtractComponent, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash,
)]
#[reflect(Component, Default, Clone, PartialEq, Hash)]
pub enum GiShading {
    /// As matt surfaces of their base colour; metals take no part. For measuring against references
    /// of that kind.
    Lambertian,
    /// With as much light as Bevy's own shading scatters where it arrives evenly: its diffuse term,
    /// which sends more back at grazing angles the rougher a surface is, and its specular term, by
    /// which metals take part. That is right in the mean and blurred in the picture: highlights of
    /// single bright spots are missing, and what is smoother than a perceptual roughness of 0.2 to
    /// 0.4 is left to reflections on screen.
    #[default]
    Standard,
}

/// What GI writes into the picture.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Clone, PartialEq, Hash)]
pub enum GiOutput {
    /// Indirect light is added to what the renderer has drawn.
    #[default]
    Added,
    /// Indirect light alone, over black: for measuring and looking at it.
    IndirectOnly,
    /// Nothing, and nothing is drawn from the reflective shadow maps or gathered: they are
    /// rendered, for passes of the app's own that read them (see [`inspect`](super::inspect)).
    MapsOnly,
}

/// Limits that hold for the whole app.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub struct GiLimits {
    /// Most reflective shadow maps rendered in a frame (a point light takes six). Where lights need
    /// more, those that light the surroundings of a GI camera most keep theirs. Higher values: more
    /// lights bounce, each map costs about one shadow map.
    pub max_rsm_count: usize,
}

impl Default for GiLimits {
    fn default() -> Self {
        Self { max_rsm_count: 24 }
    }
}
