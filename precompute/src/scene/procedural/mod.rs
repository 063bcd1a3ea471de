//! Scenes made by code, in metres, Y up. Each is merged to at most three materials and few thousand
//! triangles.
//!
//! | name | for |
//! |---|---|
//! | `cornell` | colour bleeding and one-bounce light that can be compared with the literature |
//! | `courtyard` | the showcase: sun, shade, drapes, thin and finely textured things, where every knob shows |
//! | `two_rooms` | light leaks: one room is lit, the other must stay black |
//! | `furnace` | energy: the inside of a white sphere, with a known answer |

mod cornell;
mod courtyard;
mod furnace;
mod pattern;
mod two_rooms;

use super::SceneGeometry;

/// The names that [`build`] knows.
pub const NAMES: [&str; 4] = ["cornell", "courtyard", "two_rooms", "furnace"];

/// Makes the scene called `name`, merged; `None` when it is none of [`NAMES`].
pub fn build(name: &str) -> Option<SceneGeometry> {
    let geometry = match name {
        "cornell" => cornell::build(),
        "courtyard" => courtyard::build(),
        "two_rooms" => two_rooms::build(),
        "furnace" => furnace::build(),
        _ => return None,
    };
    Some(geometry.merge())
}

/// Number of a scene's present shape: to be raised whenever its code changes an image, so that maps
/// of the older shape are not taken for maps of this one. The geometry itself is no identity, for
/// sines differ between machines. 0 for an unknown name.
pub fn revision(name: &str) -> u32 {
    u32::from(NAMES.contains(&name))
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
