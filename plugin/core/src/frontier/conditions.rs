//! What a store's watts and errors refer to, and how well an app matches it.

#[cfg(feature = "bevy")]
use bevy_ecs::reflect::{ReflectComponent, ReflectResource};
#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use glam::{UVec2, Vec3};

use super::{Bounds, CameraView, Capture, SceneIdentity};
use crate::power::MeterInfo;
use crate::units::Watts;

/// Conditions of a store's frontiers.
#[derive(Clone, Copy, Debug)]
pub struct Conditions<'a> {
    /// The scene.
    pub scene: &'a SceneIdentity,
    /// Image size, frame rate and field of view.
    pub capture: &'a Capture,
    /// The power meter.
    pub meter: &'a MeterInfo,
    /// Where the sample cameras are.
    pub bounds: &'a Bounds,
    /// Idle power of the device that the frontiers' power includes, once for each camera.
    pub idle: Watts,
}

/// The scene that the app shows, for the comparison with a camera's map. Optional: without it the
/// scenes are not compared.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::resource::Resource, bevy_reflect::Reflect))]
#[cfg_attr(feature = "bevy", reflect(Resource, Default, Clone, Debug, PartialEq))]
pub struct ShownScene(pub SceneIdentity);

/// What is known of the app that shows a camera; `None` is unknown.
#[derive(Clone, Copy, Debug, Default)]
pub struct AppConditions<'a> {
    /// The scene.
    pub scene: Option<&'a SceneIdentity>,
    /// Size of the camera's image before resolution scale, pixels.
    pub size: Option<UVec2>,
    /// Frames per second.
    pub frames_per_second: Option<f64>,
    /// The power meter.
    pub meter: Option<&'a MeterInfo>,
}

/// How well a camera's map fits the app. Where it does not, predicted watts and errors are those of
/// another image. Written by the controller, read-only for the app.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::component::Component, bevy_reflect::Reflect))]
#[cfg_attr(feature = "bevy", reflect(Component, Default, Clone, Debug, PartialEq))]
pub struct MapFit {
    /// Whether the map was made for the scene of [`ShownScene`]; `None` while unknown.
    pub scene: Option<bool>,
    /// Whether the app's power is metered as the map's was; `None` while unknown. The watts of
    /// another meter may differ by any factor.
    pub meter: Option<bool>,
    /// Pixels of the app's image ÷ the map's; `None` while unknown.
    pub pixels: Option<f64>,
    /// Frame rate of the app ÷ the map's; `None` while unknown.
    pub frame_rate: Option<f64>,
    /// Vertical field of view of the camera minus the map's, degrees; `None` while unknown.
    pub field_of_view: Option<f64>,
    /// Distance of the camera from the map's bounds, metres; 0 inside, `None` while unknown. The
    /// frontier outside is that of the nearest position inside.
    pub outside: Option<f32>,
}

/// A difference between a map and the app that shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
pub enum Misfit {
    /// Another scene, or an earlier state of it.
    Scene,
    /// Another power meter, so another device.
    Meter,
    /// An image of another size.
    Size,
    /// Another frame rate.
    FrameRate,
    /// Another field of view.
    FieldOfView,
    /// A camera outside the map's bounds.
    Outside,
}

impl Misfit {
    /// All, in the order of declaration.
    pub const ALL: [Self; 6] =
        [Self::Scene, Self::Meter, Self::Size, Self::FrameRate, Self::FieldOfView, Self::Outside];
}

impl MapFit {
    /// Relative difference in pixels, and in frame rate, above which they count as different.
    pub const TOLERANCE: f64 = 0.05;
    /// Difference in the field of view above which it counts as different, degrees.
    pub const FIELD_OF_VIEW_TOLERANCE: f64 = 2.0;
    /// Distance from the bounds above which a camera counts as outside, metres.
    pub const OUTSIDE_TOLERANCE: f32 = 0.25;

    /// Compares an app's camera with the conditions of its map.
    pub fn of(conditions: &Conditions<'_>, app: &AppConditions<'_>, view: &CameraView) -> Self {
        let is_same_scene = |scene: &SceneIdentity| {
            // A name may belong to several states of a scene; a fingerprint does not.
            if conditions.scene.fingerprint.is_empty() || scene.fingerprint.is_empty() {
                scene.name == conditions.scene.name
            } else {
                scene.fingerprint == conditions.scene.fingerprint
            }
        };
        let is_same_meter = |info: &MeterInfo| {
            let of_map = conditions.meter;
            (&info.name, &info.provenance) == (&of_map.name, &of_map.provenance)
        };
        let capture = conditions.capture;
        let pixels = |size: UVec2| size.as_dvec2().element_product();
        let [min, max] = [conditions.bounds.min, conditions.bounds.max].map(Vec3::from_array);
        let at = view.position;
        let outside = (min - at).max(at - max).max(Vec3::ZERO).length();
        let ratio = |app: f64, map: f64| Some(app / map).filter(|ratio| ratio.is_finite());
        Self {
            scene: app.scene.map(is_same_scene),
            meter: app.meter.map(is_same_meter),
            // A minimised window has no pixels, and shows nothing that could differ.
            pixels: app
                .size
                .map(pixels)
                .filter(|pixels| *pixels > 0.0)
                .and_then(|of_app| ratio(of_app, pixels(UVec2::from_array(capture.size)))),
            frame_rate: app
                .frames_per_second
                .and_then(|rate| ratio(rate, capture.frames_per_second)),
            field_of_view: Some(f64::from(view.vertical_fov.to_degrees() - capture.vertical_fov))
                .filter(|difference| difference.is_finite()),
            outside: Some(outside).filter(|it| it.is_finite() && at.is_finite()),
        }
    }

    /// Whether `misfit` is known to be the case.
    pub fn has(&self, misfit: Misfit) -> bool {
        let exceeds = |off: Option<f64>, most: f64| off.is_some_and(|off| off.abs() > most);
        let is_other =
            |ratio: Option<f64>| exceeds(ratio.map(|ratio| ratio - 1.0), Self::TOLERANCE);
        match misfit {
            Misfit::Scene => self.scene == Some(false),
            Misfit::Meter => self.meter == Some(false),
            Misfit::Size => is_other(self.pixels),
            Misfit::FrameRate => is_other(self.frame_rate),
            Misfit::FieldOfView => exceeds(self.field_of_view, Self::FIELD_OF_VIEW_TOLERANCE),
            Misfit::Outside => exceeds(self.outside.map(f64::from), Self::OUTSIDE_TOLERANCE.into()),
        }
    }

    /// Everything in which map and app are known to differ; empty where the map fits.
    pub fn misfits(&self) -> impl Iterator<Item = Misfit> + '_ {
        Misfit::ALL.into_iter().filter(|misfit| self.has(*misfit))
    }

    /// The difference in words, with its remedy.
    pub fn describe(&self, misfit: Misfit) -> String {
        let percent = |ratio: Option<f64>| 100.0 * ratio.unwrap_or(1.0);
        match misfit {
            Misfit::Scene => {
                "the map is of another scene: run `frugal precompute` for this one".to_owned()
            }
            Misfit::Meter => "the map's watts are of another meter: reprice the map, or let the controller correct them by this device's meter".to_owned(),
            Misfit::Size => format!(
                "the image has {:.0} % of the map's pixels: run `frugal precompute` with the app's --size",
                percent(self.pixels)
            ),
            Misfit::FrameRate => {
                let percent = percent(self.frame_rate);
                let hold = if percent > 100.0 { "FrameRateLimit" } else { "Budget::with_frame_time" };
                format!(
                    "the frame rate is {percent:.0} % of the map's: hold the map's (`{hold}`), or run `frugal precompute` with the app's --fps"
                )
            }
            Misfit::FieldOfView => format!(
                "the field of view differs from the map's by {:.1} degrees: run `frugal precompute` on the app, or set `camera.vertical_fov` in the scene file",
                self.field_of_view.unwrap_or(0.0)
            ),
            Misfit::Outside => format!(
                "the camera is {:.1} m outside the map's bounds: record cameras and name them by `--cameras`, or widen `bounds` in the scene file",
                self.outside.unwrap_or(0.0)
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::frontier::{FrontierMap, FrontierStore};
    use crate::power::Provenance;
    use crate::testing;

    fn conditions(map: &FrontierMap) -> Conditions<'_> {
        map.conditions().expect("a map has them")
    }

    fn view(position: Vec3) -> CameraView {
        let vertical_fov = 60.0_f32.to_radians();
        CameraView { position, rotation: Quat::IDENTITY, vertical_fov, aspect: 16.0 / 9.0 }
    }

    #[test]
    fn what_is_unknown_is_no_misfit() {
        let map = testing::map(1);
        let fit = MapFit::of(&conditions(&map), &AppConditions::default(), &view(Vec3::ZERO));
        assert_eq!(fit.misfits().count(), 0, "{fit:?}");
        assert_eq!((fit.scene, fit.meter, fit.pixels), (None, None, None));
        assert_eq!(MapFit::default().misfits().count(), 0);
    }

    #[test]
    fn every_difference_is_told() {
        let map = testing::map(1);
        let good = AppConditions {
            scene: Some(&map.scene),
            size: Some(UVec2::new(320, 180)),
            frames_per_second: Some(30.3),
            meter: Some(&map.meter),
        };
        let fit = MapFit::of(&conditions(&map), &good, &view(Vec3::ZERO));
        assert!(fit.misfits().count() == 0 && fit.scene == Some(true), "{fit:?}");
        let other = MeterInfo { provenance: Provenance::Measured, ..map.meter.clone() };
        let scene = SceneIdentity { fingerprint: "ff".into(), ..map.scene.clone() };
        let bad = AppConditions {
            scene: Some(&scene),
            size: Some(UVec2::new(3840, 2160)),
            frames_per_second: Some(144.0),
            meter: Some(&other),
        };
        let wide = CameraView { vertical_fov: 1.5, ..view(Vec3::new(10.0, 0.0, 0.0)) };
        let fit = MapFit::of(&conditions(&map), &bad, &wide);
        assert_eq!(fit.misfits().collect::<Vec<_>>(), Misfit::ALL);
        assert_eq!((fit.pixels, fit.outside), (Some(144.0), Some(6.0)));
        for misfit in Misfit::ALL {
            assert!(fit.describe(misfit).contains(':'), "with a remedy");
        }
    }

    #[test]
    fn scenes_without_fingerprints_are_compared_by_name() {
        let map = testing::map(1);
        let named = |name: &str| SceneIdentity { name: name.into(), fingerprint: String::new() };
        for (name, expected) in [("courtyard", true), ("cornell", false)] {
            let scene = named(name);
            let app = AppConditions { scene: Some(&scene), ..Default::default() };
            let fit = MapFit::of(&conditions(&map), &app, &view(Vec3::ZERO));
            assert_eq!(fit.scene, Some(expected));
        }
    }

    #[test]
    fn extreme_cameras_and_rates_give_no_false_misfit() {
        let map = testing::map(1);
        for odd in [f32::NAN, f32::INFINITY] {
            let app = AppConditions {
                frames_per_second: Some(f64::from(odd)),
                size: Some(UVec2::ZERO),
                ..Default::default()
            };
            let view = CameraView { vertical_fov: f32::NAN, ..view(Vec3::splat(odd)) };
            let fit = MapFit::of(&conditions(&map), &app, &view);
            assert_eq!(fit.misfits().collect::<Vec<_>>(), []);
        }
    }
}
