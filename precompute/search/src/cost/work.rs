//! Work of a frame as a function of its settings.

use frugal_core::knobs::{KnobLevels, KnobSpace};

/// Parameters of a frame's work other than its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameLayout {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Number of whole reflective shadow maps: one for each light that is no point light.
    pub maps: u32,
    /// Number of point lights: each has six smaller maps.
    pub point_lights: u32,
    /// Whether a sky is gathered.
    pub has_sky: bool,
}

impl FrameLayout {
    /// Number of reflective shadow maps, and of their texels, where a whole map has `resolution` texels
    /// along its edge.
    fn maps(&self, resolution: f64) -> (f64, f64) {
        let faces = f64::from(POINT_LIGHT_MAPS * self.point_lights);
        let edge = face_resolution(resolution);
        let texels = f64::from(self.maps) * resolution * resolution + faces * edge * edge;
        (f64::from(self.maps) + faces, texels)
    }
}

/// Maps of a point light.
pub const POINT_LIGHT_MAPS: u32 = 6;
/// The plugin's limit of VPLs for a pixel.
pub const MAX_VPLS_PER_PIXEL: u32 = 1024;
/// Rays of a low-resolution pixel at the plugin's levels of visibility: to VPLs, and to the sky. At the
/// second, places of the image have them, whose number is limited.
pub const VISIBILITY_RAYS: [[u32; 2]; 4] = [[0, 0], [2, 2], [2, 2], [8, 8]];
/// Values of the knob at these levels.
const VISIBILITY_VALUES: [f64; 4] = [0.0, 1.0, 2.0, 8.0];
/// Most places that are lit in a frame at the second level.
const MAX_CACHE_SAMPLES: f64 = 4096.0;
/// Least pixels for each of them.
const PIXELS_OF_SAMPLE: f64 = 64.0;

/// Texels along the edge of each map of a point light, as the plugin renders it (its `gi/rsm/lights.rs`).
fn face_resolution(resolution: f64) -> f64 {
    (resolution / 4.0).floor().max(32.0).min((resolution / 2.0).floor()).max(8.0)
}

/// Kinds of work, in the order of [`Work`]'s values. Levels of unknown knobs follow.
const KINDS: [&str; 21] = [
    "frame",
    "pixels",
    "upscaled pixels",
    "gathering frames",
    "gathered pixels",
    "pairs",
    "rays",
    "filter taps",
    "VPLs",
    "weighed texels",
    "map texels",
    "maps",
    "tile rays",
    "shadow texels",
    "cascades",
    "occlusion pixels",
    "occlusion samples",
    "FXAA pixels",
    "SMAA pixels",
    "SMAA steps",
    "bloom texels",
];

/// Names of all kinds of work in `space`.
pub fn work_names(space: &KnobSpace) -> Vec<String> {
    let others = other_levels(space).map(|(knob, level)| {
        let knob = &space.knobs()[knob];
        format!("{}={} pixels", knob.name, knob.levels[level].label)
    });
    KINDS.iter().map(|kind| (*kind).to_owned()).chain(others).collect()
}

/// Knobs that [`Work`] models.
const KNOWN: [&str; 13] = [
    "resolution_scale",
    "gi_vpl_count",
    "gi_pixel_fraction",
    "gi_interleave",
    "gi_visibility",
    "gi_environment_samples",
    "rsm_resolution",
    "gi_refresh_period",
    "shadow_map_resolution",
    "shadow_cascades",
    "ambient_occlusion",
    "antialiasing",
    "post_processing",
];

/// Levels above the lowest of unknown knobs: each has a price of its own.
fn other_levels(space: &KnobSpace) -> impl Iterator<Item = (usize, usize)> + '_ {
    let others =
        space.knobs().iter().enumerate().filter(|(_, knob)| !KNOWN.contains(&knob.name.as_str()));
    others.flat_map(|(index, knob)| (1..knob.levels.len()).map(move |level| (index, level)))
}

/// Amount of each kind of work in a frame: counts, 0 or more, in the order of [`work_names`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Work(pub Vec<f64>);

impl Work {
    /// The work of `settings`. Knobs that `space` lacks count as at their best.
    pub fn of(space: &KnobSpace, settings: KnobLevels, layout: &FrameLayout) -> Self {
        let settings = space.canonical(settings);
        let value = |name: &str, best: f64| space.value(settings, name).unwrap_or(best);
        let [width, height] = layout.size.map(f64::from);
        let scale = value("resolution_scale", 1.0);
        let pixels = (width * scale).round() * (height * scale).round();
        let mut work = vec![1.0, pixels, if scale < 1.0 { width * height } else { 0.0 }];
        work.extend(indirect(&value, pixels, layout));
        let (shadow, cascades) =
            (value("shadow_map_resolution", 2048.0), value("shadow_cascades", 4.0));
        work.extend([shadow * shadow * cascades, cascades]);
        let samples = value("ambient_occlusion", 32.0);
        work.extend([if samples > 0.0 { pixels } else { 0.0 }, samples * pixels]);
        let antialiasing = value("antialiasing", 32.0);
        let is = |condition: bool| if condition { pixels } else { 0.0 };
        work.extend([
            is(antialiasing == 1.0),
            is(antialiasing > 1.0),
            if antialiasing > 1.0 { antialiasing * pixels } else { 0.0 },
        ]);
        work.push(bloom(value("post_processing", 1.0), [width * scale, height * scale]));
        work.extend(other_levels(space).map(|(knob, level)| is(settings.level(knob) == level)));
        Self(work)
    }
}

/// Work of indirect light: from gathering frames to tile rays.
fn indirect(value: &impl Fn(&str, f64) -> f64, pixels: f64, layout: &FrameLayout) -> [f64; 10] {
    let vpls = value("gi_vpl_count", 4096.0);
    if vpls == 0.0 {
        return [0.0; 10];
    }
    let shown = pixels * value("gi_pixel_fraction", 1.0);
    let side = value("gi_interleave", 2.0);
    let per_set = (vpls / (side * side)).ceil().clamp(1.0, f64::from(MAX_VPLS_PER_PIXEL));
    let visibility = value("gi_visibility", 8.0);
    let level = VISIBILITY_VALUES.iter().position(|value| *value >= visibility).unwrap_or(3);
    let [rays, sky_rays] = VISIBILITY_RAYS[level].map(f64::from);
    let is_cached = level == 1;
    let gathered =
        if is_cached { (pixels / PIXELS_OF_SAMPLE).min(MAX_CACHE_SAMPLES) } else { shown };
    let sky =
        if layout.has_sky && rays > 0.0 { value("gi_environment_samples", 32.0) } else { 0.0 };
    let traced = rays.min(per_set) + sky_rays.min(sky);
    let resolution = value("rsm_resolution", 256.0);
    let (maps, texels) = layout.maps(resolution);
    // Maps are rendered in one frame per period.
    let rendered = value("gi_refresh_period", 1.0);
    let radius = if rays > 0.0 { side.max(4.0) } else { side };
    let taps = (radius + 1.0).powi(2) + if rays > 0.0 { 25.0 } else { 0.0 };
    [
        1.0,
        shown,
        gathered * (per_set + sky),
        gathered * traced,
        if is_cached { 0.0 } else { shown * taps },
        per_set * side * side,
        texels,
        texels * rendered,
        maps * rendered,
        if rays > 0.0 { texels / 256.0 * 32.0 } else { 0.0 },
    ]
}

/// Texels of bloom's mip chain at the knob's level.
fn bloom(share: f64, [width, height]: [f64; 2]) -> f64 {
    if share == 0.0 || width <= 0.0 || height <= 0.0 {
        return 0.0;
    }
    let rows = (height * share).clamp(8.0, 512.0).log2().floor().exp2();
    rows * rows * width / height * 4.0 / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYOUT: FrameLayout =
        FrameLayout { size: [160, 90], maps: 2, point_lights: 0, has_sky: true };

    fn named(space: &KnobSpace, settings: KnobLevels, name: &str) -> f64 {
        let at = work_names(space).iter().position(|kind| kind == name).expect("a kind of work");
        Work::of(space, settings, &LAYOUT).0[at]
    }

    #[test]
    fn work_follows_the_settings() {
        let space = crate::testing::knobs();
        let best = space.highest();
        assert_eq!(Work::of(&space, best, &LAYOUT).0.len(), work_names(&space).len());
        assert_eq!(named(&space, best, "pixels"), 160.0 * 90.0);
        // 4,096 VPLs in four sets, and 32 samples of the sky.
        assert_eq!(named(&space, best, "pairs"), 160.0 * 90.0 * (1024.0 + 32.0));
        let quarter = space
            .parse("max,gi_pixel_fraction=1/4")
            .or_else(|_| space.parse("gi_pixel_fraction=1/4"))
            .expect("settings");
        assert_eq!(named(&space, quarter, "rays"), named(&space, best, "rays") / 4.0);
        let off = space.parse("gi_vpl_count=0").expect("settings");
        for kind in
            ["pairs", "rays", "gathered pixels", "map texels", "tile rays", "gathering frames"]
        {
            assert_eq!(named(&space, off, kind), 0.0, "{kind}");
        }
        let half = space.parse("resolution_scale=50%").expect("settings");
        assert_eq!(
            (named(&space, half, "pixels"), named(&space, half, "upscaled pixels")),
            (80.0 * 45.0, 160.0 * 90.0)
        );
        assert!(
            Work::of(&space, space.lowest(), &LAYOUT)
                .0
                .iter()
                .all(|count| count.is_finite() && *count >= 0.0)
        );
    }

    #[test]
    fn a_point_light_has_six_maps_of_a_quarter_of_the_size() {
        let space = crate::testing::knobs();
        let count = |layout: &FrameLayout, settings: &str, kind: &str| {
            let settings = space.parse(settings).expect("settings");
            let at = work_names(&space).iter().position(|it| it == kind).expect("a kind of work");
            Work::of(&space, settings, layout).0[at]
        };
        let point = FrameLayout { maps: 0, point_lights: 1, ..LAYOUT };
        let both = FrameLayout { maps: 1, point_lights: 2, ..LAYOUT };
        for (settings, edge) in [("max,rsm_resolution=256", 64.0), ("max,rsm_resolution=64", 32.0)]
        {
            let whole: f64 = if edge == 64.0 { 256.0 } else { 64.0 };
            let faces = 6.0 * edge * edge;
            assert_eq!(count(&point, settings, "maps"), 6.0);
            assert_eq!(count(&point, settings, "map texels"), faces);
            assert_eq!(count(&point, settings, "tile rays"), faces / 256.0 * 32.0);
            assert_eq!(count(&both, settings, "maps"), 13.0);
            assert_eq!(count(&both, settings, "weighed texels"), whole * whole + 2.0 * faces);
        }
    }

    #[test]
    fn an_app_s_own_knob_has_a_price_of_its_own() {
        use frugal_core::knobs::Knob;
        let space = KnobSpace::new(vec![Knob::new("hair_strands", [0.0, 10.0, 100.0])])
            .expect("a valid space");
        assert_eq!(named(&space, space.highest(), "hair_strands=100 pixels"), 160.0 * 90.0);
        assert_eq!(named(&space, space.highest(), "hair_strands=10 pixels"), 0.0);
    }
}
