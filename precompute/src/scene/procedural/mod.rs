//! Procedural scenes, in metres, Y up. Each is merged to at most three materials and few thousand
//! triangles.
//!
//! | name | purpose |
//! |---|---|
//! | `cornell` | colour bleeding and one-bounce light that can be compared with the literature |
//! | `courtyard` | the showcase: sun, shade, drapes, thin and finely textured objects, where every knob has an effect |
//! | `two_rooms` | light leaks: one room is lit, the other must stay black |
//! | `furnace` | energy conservation: the inside of a white sphere, with a closed-form solution |
//! | `hall` | dozens of lights: sixteen rooms with doorways between them |

mod cornell;
mod courtyard;
mod furnace;
mod hall;
mod pattern;
mod two_rooms;

use super::SceneGeometry;

/// The names that [`build`] knows.
pub(crate) const NAMES: [&str; 5] = ["cornell", "courtyard", "two_rooms", "furnace", "hall"];

/// Builds the scene called `name`, merged; `None` for a name that is not in [`NAMES`].
pub(crate) fn build(name: &str) -> Option<SceneGeometry> {
    let geometry = match name {
        "cornell" => cornell::build(),
        "courtyard" => courtyard::build(),
        "two_rooms" => two_rooms::build(),
        "furnace" => furnace::build(),
        "hall" => hall::build(),
        _ => return None,
    };
    Some(geometry.merge())
}

/// Revision of a scene: must be raised whenever its code changes an image, so that older maps are
/// not taken for maps of the new scene. A hash of the geometry would not do, because sines differ
/// between machines. 0 for an unknown name.
pub(crate) fn revision(name: &str) -> u32 {
    u32::from(NAMES.contains(&name))
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
