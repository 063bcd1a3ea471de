//! Validation of descriptions: ranges, and rules between fields.

use std::ops::Bound::{self, Excluded, Included, Unbounded};
use std::ops::RangeBounds;

use frugal_core::knobs::did_you_mean;
use frugal_trace::light::Light;
use glam::Vec3;

use super::description::{BUILT_IN, Environment, Geometry, SceneDescription};
use super::path::CameraPath;

/// A problem of a description, and its remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Problem {
    /// The field, as [`locate`](super::locate) writes it.
    pub(super) field: String,
    /// The problem.
    pub(super) problem: String,
    /// The remedy.
    pub(super) remedy: String,
}

fn invalid(
    field: impl Into<String>,
    problem: impl Into<String>,
    remedy: impl Into<String>,
) -> Result<(), Problem> {
    Err(Problem { field: field.into(), problem: problem.into(), remedy: remedy.into() })
}

/// Checks `value` against a range, described by `allowed`; NaN is in no range.
fn number(
    field: &str,
    value: f32,
    range: impl RangeBounds<f32>,
    allowed: &str,
) -> Result<(), Problem> {
    if value.is_finite() && range.contains(&value) {
        Ok(())
    } else {
        invalid(field, format!("is {value}"), format!("give a finite {allowed}"))
    }
}

/// Above 0, up to `end`.
fn up_to(end: Bound<f32>) -> (Bound<f32>, Bound<f32>) {
    (Excluded(0.0), end)
}

/// Each number of a triple.
fn each(
    field: &str,
    values: [f32; 3],
    range: impl RangeBounds<f32> + Clone,
    allowed: &str,
) -> Result<(), Problem> {
    (0..3).try_for_each(|i| number(&format!("{field}[{i}]"), values[i], range.clone(), allowed))
}

fn finite(field: &str, vector: Vec3) -> Result<(), Problem> {
    each(field, vector.to_array(), .., "number of metres")
}

fn direction(field: &str, vector: Vec3) -> Result<(), Problem> {
    finite(field, vector)?;
    // In double precision, so that a short direction's square does not underflow.
    if vector.as_dvec3().length() < 1e-12 {
        return invalid(
            field,
            "is zero",
            "give the direction in which the light travels, such as (0.0, -1.0, 0.0)",
        );
    }
    Ok(())
}

/// A name that is not one of [`BUILT_IN`].
pub(super) fn no_such_scene(name: &str) -> Problem {
    let known = BUILT_IN.map(|name| format!("\"{name}\"")).join(", ");
    Problem {
        field: "geometry[0]".into(),
        problem: format!("no procedural scene is called \"{name}\""),
        remedy: format!("{}use one of {known}", did_you_mean(name, BUILT_IN)),
    }
}

/// Checks every value of a description, but not the files that it names.
pub(super) fn check(description: &SceneDescription) -> Result<(), Problem> {
    if let Geometry::Procedural(name) = &description.geometry
        && !BUILT_IN.contains(&name.as_str())
    {
        return Err(no_such_scene(name));
    }
    for (i, each) in description.lights.iter().enumerate() {
        light(&format!("lights[{i}]"), each)?;
    }
    match &description.environment {
        Environment::None => {}
        Environment::Constant(luminance) => {
            each("environment[0]", *luminance, 0.0.., "luminance of at least 0 nits")?;
        }
        Environment::Map(_, intensity) => {
            number("environment[1]", *intensity, 0.0.., "intensity of at least 0 nits")?;
        }
    }
    let (exposure, camera) = (description.exposure_ev100, &description.camera);
    number("exposure_ev100", exposure, -20.0..=30.0, "exposure value from -20 to 30")?;
    let (angles, allowed) =
        (up_to(Excluded(180.0)), "angle between 0 and 180 degrees, both excluded");
    number("camera.vertical_fov", camera.vertical_fov, angles, allowed)?;
    number("camera.near", camera.near, up_to(Unbounded), "distance greater than 0 m")?;
    number("camera.far", camera.far, up_to(Unbounded), "distance greater than 0 m")?;
    if camera.near >= camera.far {
        return invalid(
            "camera.far",
            format!("is {}, not beyond near, {}", camera.far, camera.near),
            "give a far greater than near",
        );
    }
    if let Some(bounds) = &description.bounds {
        finite("bounds.min", bounds.min)?;
        finite("bounds.max", bounds.max)?;
        for axis in 0..3 {
            let (min, max) = (bounds.min[axis], bounds.max[axis]);
            if min >= max {
                let name = ["x", "y", "z"][axis];
                let remedy = "give a box whose max is greater than its min along every axis";
                return invalid(
                    format!("bounds.max[{axis}]"),
                    format!("the box is empty: max {name} is {max} and min {name} is {min}"),
                    remedy,
                );
            }
        }
    }
    description.paths.iter().try_for_each(|(name, keys)| path(&format!("paths[{name:?}]"), keys))
}

fn light(field: &str, light: &Light) -> Result<(), Problem> {
    let of = |name: &str| format!("{field}.{name}");
    let (Light::Directional { color, .. } | Light::Point { color, .. } | Light::Spot { color, .. }) =
        light;
    each(&of("color"), *color, 0.0.., "linear colour of at least 0")?;
    if let Light::Directional { direction: vector, .. } | Light::Spot { direction: vector, .. } =
        light
    {
        direction(&of("direction"), *vector)?;
    }
    if let Light::Directional { illuminance, .. } = light {
        number(&of("illuminance"), *illuminance, 0.0.., "illuminance of at least 0 lux")?;
    }
    if let Light::Point { position, luminous_power, range, .. }
    | Light::Spot { position, luminous_power, range, .. } = light
    {
        finite(&of("position"), *position)?;
        number(&of("luminous_power"), *luminous_power, 0.0.., "power of at least 0 lumens")?;
        number(&of("range"), *range, up_to(Unbounded), "range greater than 0 m")?;
    }
    if let Light::Spot { inner_angle, outer_angle, .. } = *light {
        let allowed = "half angle from 0 to 90 degrees";
        number(&of("inner_angle"), inner_angle, 0.0..=90.0, allowed)?;
        let allowed = "half angle above 0 and up to 90 degrees";
        number(&of("outer_angle"), outer_angle, up_to(Included(90.0)), allowed)?;
        if inner_angle > outer_angle {
            let problem = format!("is {outer_angle}, less than inner_angle, {inner_angle}");
            let remedy = "give an inner_angle of at most that: its default is 30";
            return invalid(of("outer_angle"), problem, remedy);
        }
    }
    Ok(())
}

fn path(field: &str, path: &CameraPath) -> Result<(), Problem> {
    if path.keys.is_empty() {
        return invalid(
            field,
            "has no keys",
            "give at least one (time: …, position: …, look_at: …), or leave the path out",
        );
    }
    let mut previous: Option<f32> = None;
    for (i, key) in path.keys.iter().enumerate() {
        let of = |name: &str| format!("{field}[{i}].{name}");
        number(&of("time"), key.time, .., "number of seconds")?;
        if let Some(previous) = previous.filter(|previous| *previous >= key.time) {
            let problem = format!("is {}, not after the key before it, {previous}", key.time);
            return invalid(of("time"), problem, "give every key a later time than the one before");
        }
        previous = Some(key.time);
        finite(&of("position"), key.position)?;
        finite(&of("look_at"), key.look_at)?;
        if key.look_at == key.position {
            let problem = "is the camera's own position, and gives no direction";
            return invalid(of("look_at"), problem, "give the point in the middle of the image");
        }
    }
    Ok(())
}
