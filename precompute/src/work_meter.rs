//! A meter without hardware: it counts each frame's work at fixed prices. The same frames cost the
//! same on every machine.

use std::fmt::Display;
use std::path::Path;

use bevy_frugal_gi::power::MeterError;
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::power::{MeterInfo, Provenance};
use frugal_core::units::Watts;
use frugal_search::cost::{DeviceModel, FrameLayout, Work, price, work_names};
use frugal_search::journal::hash;

/// Prices of the software renderer lavapipe, from `frugal calibrate`.
const LAVAPIPE: &str = include_str!("../prices/lavapipe.prices.ron");
/// Name of the meter: `work`, or `work=FILE` with prices from `frugal calibrate`.
pub(crate) const WORK_METER: &str = "work";
/// Energy is counted in units of 2⁻³⁰ J, which floating point represents exactly up to 8 MJ: means
/// over any number of frames are the same to the last bit.
const UNITS_PER_JOULE: f64 = (1_u64 << 30) as f64;

/// Power of frames by the work that they do: a function of their settings alone.
#[derive(Debug)]
pub(crate) struct WorkMeter {
    /// Name and provenance.
    pub(crate) info: MeterInfo,
    device: DeviceModel,
    layout: FrameLayout,
}

/// Whether `name` names the work meter, and its file of prices.
pub(crate) fn is_work_meter(name: &str) -> Option<Option<&str>> {
    match name.split_once('=') {
        Some((plain, file)) => (plain.trim() == WORK_METER).then(|| Some(file.trim())),
        None => (name.trim() == WORK_METER).then_some(None),
    }
}

/// The meter of a map's file: a file of prices where the command runs, or else beside the map.
pub(crate) fn of_map(name: &str, map: &Path) -> String {
    let beside = is_work_meter(name)
        .flatten()
        .filter(|file| !Path::new(file).exists())
        .map(|file| map.with_file_name(file))
        .filter(|beside| beside.exists());
    beside.map_or_else(|| name.to_owned(), |file| format!("{WORK_METER}={}", file.display()))
}

impl WorkMeter {
    /// Opens a meter at the prices in `file`, or at lavapipe's, for frames of `layout`.
    ///
    /// # Errors
    /// When the file cannot be read, or holds no prices.
    pub(crate) fn open(file: Option<&str>, layout: FrameLayout) -> Result<Self, MeterError> {
        let name =
            file.map_or_else(|| WORK_METER.to_owned(), |file| format!("{WORK_METER}={file}"));
        let unavailable = |reason: String| MeterError::unavailable(name.as_str(), reason);
        let no_prices = |error: &dyn Display| {
            unavailable(format!("{error}; `frugal calibrate` writes such a file"))
        };
        let text = file.map_or_else(|| Ok(LAVAPIPE.to_owned()), std::fs::read_to_string);
        let text = text.map_err(|error| no_prices(&error))?;
        let device: DeviceModel = ron::from_str(&text).map_err(|error| no_prices(&error))?;
        if !device.prices.is_sound() {
            return Err(unavailable(
                "its prices are not finite numbers, 0 or above, one for each kind of work"
                    .to_owned(),
            ));
        }
        let description = format!(
            "work of each frame at the prices of {} ({:08x})",
            device.adapter,
            hash(&text) as u32
        );
        // A map with this name travels; the folders of this machine do not.
        let name = match file.map(|file| Path::new(file).file_name().unwrap_or(file.as_ref())) {
            Some(file) => format!("{WORK_METER}={}", file.display()),
            None => WORK_METER.to_owned(),
        };
        let info = MeterInfo { name, provenance: Provenance::Modelled, description };
        Ok(Self { info, device, layout })
    }

    /// Power of the device at rest.
    pub(crate) fn idle(&self) -> Watts {
        self.device.prices.idle
    }

    /// Power of frames at `settings`.
    pub(crate) fn power(
        &self,
        space: &KnobSpace,
        settings: KnobLevels,
        frames_per_second: f64,
    ) -> Watts {
        let units = (self.joules(space, settings) * UNITS_PER_JOULE).round();
        self.idle() + Watts(units / UNITS_PER_JOULE * frames_per_second)
    }

    /// Energy of a frame at `settings`, without the device's idle energy. Kinds of work without a
    /// price are free.
    fn joules(&self, space: &KnobSpace, settings: KnobLevels) -> f64 {
        let work = Work::of(space, settings, &self.layout);
        let price = |kind: &String| price(&self.device.prices, kind).unwrap_or(0.0);
        work_names(space).iter().zip(&work.0).map(|(kind, work)| price(kind) * work).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYOUT: FrameLayout =
        FrameLayout { size: [160, 90], maps: 2, point_lights: 0, has_sky: true };

    #[test]
    fn power_is_that_of_any_number_of_counted_frames_to_the_last_bit() {
        let space = crate::stage::built_in_knobs(false);
        let meter = WorkMeter::open(None, LAYOUT).expect("prices");
        let power = |settings| meter.power(&space, settings, 30.0);
        let (low, high) = (power(space.lowest()), power(space.highest()));
        let spent = [low, high].map(|power| (power - meter.idle()).0);
        assert!(0.0 < spent[0] && spent[0] < 0.5 * spent[1], "{low} and {high}");
        let joules = meter.joules(&space, space.highest());
        assert!((spent[1] / 30.0 - joules).abs() < 1e-8, "{high}: {joules} J a frame");
        let units = (joules * UNITS_PER_JOULE).round() as u64;
        for (before, frames) in [(0, 1_u64), (0, 7), (123_456_789, 1000), (1 << 50, 333)] {
            let reading = |units: u64| units as f64 / UNITS_PER_JOULE;
            let counted = reading(before + frames * units) - reading(before);
            let mean = meter.idle() + Watts(counted / frames as f64 * 30.0);
            assert_eq!(mean.0.to_bits(), high.0.to_bits(), "{frames} frames after {before}");
        }
    }

    #[test]
    fn prices_travel_beside_a_map() {
        let folder = tempfile::tempdir().expect("a folder");
        let [map, file] = ["a.pareto.ron", "a.prices.ron"].map(|name| folder.path().join(name));
        assert_eq!(of_map("work=a.prices.ron", &map), "work=a.prices.ron", "to be missed by name");
        std::fs::write(&file, LAVAPIPE).expect("writes");
        let meter = WorkMeter::open(file.to_str(), LAYOUT).expect("prices");
        assert_eq!(meter.info.name, "work=a.prices.ron");
        assert_eq!(of_map(&meter.info.name, &map), format!("work={}", file.display()));
        for other in ["work", "cpu-time", "nvml=1"] {
            assert_eq!(of_map(other, &map), other);
        }
    }

    #[test]
    fn files_without_prices_are_one_clear_error() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("prices.ron");
        std::fs::write(&file, LAVAPIPE.replace("joules: [", "joules: [-1.0,")).expect("writes");
        for (path, says) in
            [(file.clone(), "finite"), (folder.path().join("none"), "frugal calibrate")]
        {
            let error = WorkMeter::open(path.to_str(), LAYOUT).expect_err("no prices").to_string();
            assert!(error.contains(says) && error.contains("work="), "{error}");
        }
        assert_eq!(
            (is_work_meter("work"), is_work_meter("work = a"), is_work_meter("nvml=1")),
            (Some(None), Some(Some("a")), None)
        );
    }

    #[test]
    fn the_search_s_model_of_work_knows_the_plugin_s_numbers() {
        use bevy_frugal_gi::gi::{FrugalGi, GiVisibility};
        use frugal_search::cost::{MAX_VPLS_PER_PIXEL, VISIBILITY_RAYS};
        let rays = GiVisibility::ALL.map(|level| [level.rays(), level.sky_rays()]);
        assert_eq!((FrugalGi::MAX_VPLS_PER_PIXEL, rays), (MAX_VPLS_PER_PIXEL, VISIBILITY_RAYS));
        // Its tests are worth what their knobs are.
        let knobs = crate::stage::built_in_knobs(false);
        assert_eq!(frugal_search::testing::knobs(), knobs);
        let every_knob = crate::stage::built_in_knobs(true);
        assert_eq!(frugal_search::testing::every_knob(), every_knob);
    }

    #[test]
    fn every_shared_knob_is_of_app_scope() {
        use bevy_frugal_gi::knobs::{KnobPlugin, KnobRegistry};
        let mut app = bevy::app::App::new();
        app.add_plugins(KnobPlugin);
        let registry = app.world().resource::<KnobRegistry>();
        for name in frugal_search::cost::SHARED_KNOBS {
            let driver = registry.get(name).expect("a built-in knob");
            assert!(driver.is_app_wide(), "{name}");
        }
    }
}
