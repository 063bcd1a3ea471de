//! Comparability of the watts and errors of two maps.

use frugal_core::frontier::{Capture, FrontierMap};
use frugal_core::knobs::KnobSpace;

use crate::device;

/// Fails, in a sentence with a remedy, for two maps whose watts or errors are not comparable.
/// `any_device`: watts of two devices or models of power are compared all the same.
pub(super) fn check(old: &FrontierMap, new: &FrontierMap, any_device: bool) -> Result<(), String> {
    if old.scene.fingerprint != new.scene.fingerprint {
        let scene = |map: &FrontierMap| format!("`{}` ({})", map.scene.name, map.scene.fingerprint);
        return Err(format!(
            "the maps are of different scenes, {} and {}: run `frugal precompute` on one scene with both builds",
            scene(old),
            scene(new)
        ));
    }
    let differs = conditions(old).into_iter().zip(conditions(new)).find(|(old, new)| old != new);
    if let Some(((what, old, remedy), (_, new, _))) = differs {
        return Err(format!("the maps differ in {what}, `{old}` and `{new}`: {remedy}"));
    }
    if !any_device && !device::is_same(&old.meter, &new.meter) {
        let [old, new] =
            [&old.meter, &new.meter].map(|it| format!("{}: {}", it.name, it.description));
        return Err(format!(
            "the maps' watts are of two devices or models, `{old}` and `{new}`: run `frugal precompute` for both on one, or `frugal reprice` both with one file of --prices; --any-device compares all the same"
        ));
    }
    if old.knobs == new.knobs {
        return Ok(());
    }
    let difference = difference(&old.knobs, &new.knobs);
    Err(format!(
        "the maps have different knobs: {difference}; run `frugal precompute` with the same --knobs for both"
    ))
}

/// The conditions that must be equal, each with the remedy where it is not.
fn conditions(map: &FrontierMap) -> [(&'static str, String, &'static str); 5] {
    let Capture { size: [width, height], frames_per_second, vertical_fov, exposure_ev100 } =
        map.capture;
    let again = "run `frugal precompute` again for the older one";
    [
        (
            "size",
            format!("{width}x{height}"),
            "run `frugal precompute` with the same --size for both",
        ),
        (
            "frame rate",
            format!("{frames_per_second} Hz"),
            "run `frugal precompute` with the same --fps for both, or `frugal reprice` one of them",
        ),
        ("field of view", format!("{vertical_fov} degrees"), again),
        ("exposure", format!("EV {exposure_ev100}"), again),
        (
            "meter",
            format!("{}, {}", device::kind(&map.meter.name), map.meter.provenance),
            "run `frugal precompute` with the same --meter for both",
        ),
    ]
}

/// How the knobs of two maps differ.
fn difference(old: &KnobSpace, new: &KnobSpace) -> String {
    let only_in = |one: &KnobSpace, other: &KnobSpace| {
        let names = one.knobs().iter().filter(|knob| other.index_of(&knob.name).is_none());
        names.map(|knob| format!("`{}`", knob.name)).collect::<Vec<_>>().join(", ")
    };
    let only = [("old", only_in(old, new)), ("new", only_in(new, old))].into_iter();
    let only = only.filter(|(_, names)| !names.is_empty());
    let mut parts: Vec<_> =
        only.map(|(which, names)| format!("only the {which} one has {names}")).collect();
    let changed = old
        .knobs()
        .iter()
        .find(|knob| new.index_of(&knob.name).is_some_and(|index| new.knobs()[index] != **knob));
    parts.extend(changed.map(|knob| format!("`{}` has other levels", knob.name)));
    if parts.is_empty() { "they come in another order".to_owned() } else { parts.join(", ") }
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::power::Provenance;
    use frugal_core::knobs::Knob;

    use super::super::testing::map;
    use super::*;

    fn refused(change: impl FnOnce(&mut FrontierMap)) -> String {
        let (old, mut new) = (map(), map());
        change(&mut new);
        check(&old, &new, false).expect_err("maps that differ").to_string()
    }

    #[test]
    fn differences_are_named_with_a_remedy() {
        let capture = map().capture;
        for (message, words) in [
            (
                refused(|map| map.scene.fingerprint = "beef".into()),
                ["different scenes", "00ff", "beef"],
            ),
            (
                refused(|map| map.capture = Capture { size: [64, 36], ..capture }),
                ["size", "64x36", "--size"],
            ),
            (
                refused(|map| map.capture = Capture { frames_per_second: 60.0, ..capture }),
                ["frame rate", "60 Hz", "--fps"],
            ),
            (
                refused(|map| map.capture = Capture { vertical_fov: 90.0, ..capture }),
                ["field of view", "90 degrees", "again"],
            ),
            (
                refused(|map| map.capture = Capture { exposure_ev100: 9.0, ..capture }),
                ["exposure", "EV 9", "again"],
            ),
            (
                refused(|map| map.meter.name = "nvml".into()),
                ["work, modelled", "nvml, modelled", "--meter"],
            ),
            (
                refused(|map| map.meter.provenance = Provenance::Measured),
                ["work, modelled", "work, measured", "--meter"],
            ),
            (
                refused(|map| map.meter.description = "other prices".into()),
                ["work: synthetic", "work: other prices", "--prices"],
            ),
        ] {
            words.iter().for_each(|word| {
                assert!(message.contains(word), "`{word}` is missing in: {message}");
            });
        }
    }

    #[test]
    fn knobs_that_differ_are_named() {
        let knobs =
            |knobs: Vec<Knob>| refused(|map| map.knobs = KnobSpace::new(knobs).expect("a space"));
        let (samples, scale) = (map().knobs.knobs()[0].clone(), map().knobs.knobs()[1].clone());
        let message =
            knobs(vec![samples.clone(), scale.clone(), Knob::new("sharpness", [0.0, 1.0])]);
        assert!(
            message.contains("only the new one has `sharpness`") && message.contains("--knobs"),
            "{message}"
        );
        let renamed = Knob { name: "size".into(), ..scale.clone() };
        let message = knobs(vec![samples.clone(), renamed]);
        assert!(
            message.contains("only the old one has `scale`, only the new one has `size`"),
            "{message}"
        );
        let finer = Knob::new("scale", [0.5, 0.75, 1.0]);
        assert!(knobs(vec![samples, finer]).contains("`scale` has other levels"));
    }

    #[test]
    fn names_and_options_may_differ_and_devices_where_that_is_asked_for() {
        let (old, mut new) = (map(), map());
        new.scene.name = "renamed".into();
        new.meter.name = "work=new.prices.ron".into();
        new.seed = 99;
        assert_eq!(check(&old, &new, false), Ok(()));
        new.meter.description = "another price".into();
        assert!(check(&old, &new, false).expect_err("two prices").contains("--any-device"));
        assert_eq!(check(&old, &new, true), Ok(()));
    }

    #[test]
    fn a_card_that_got_another_number_is_the_same() {
        let of = |description: &str| {
            let mut map = map();
            map.meter.name = "amdgpu".into();
            map.meter.description = description.into();
            map
        };
        let old = of("whole card 0000:04:00.0 (card1, PPT), power1_average of its driver");
        let new = of("whole card 0000:04:00.0 (card0, PPT), power1_average of its driver");
        let other = of("whole card 0000:0b:00.0 (card1, PPT), power1_average of its driver");
        assert_eq!(check(&old, &new, false), Ok(()));
        assert!(check(&old, &other, false).expect_err("two cards").contains("--any-device"));
    }
}
