//! The scenes that come with the tool, by name: the same files as in `assets/scenes`.
//!
//! | name | purpose |
//! |---|---|
//! | `cornell` | colour bleeding and one-bounce light that can be compared with the literature |
//! | `courtyard` | the showcase: sun, shade, drapes, thin and finely textured objects, where every knob has an effect |
//! | `two_rooms` | light leaks: one room is lit, the other must stay black |
//! | `furnace` | energy conservation: the inside of a white sphere, with a closed-form solution |
//! | `hall` | dozens of lights: sixteen rooms with doorways between them |

/// The names that [`glb`] knows.
pub(super) const NAMES: [&str; 5] = ["cornell", "courtyard", "two_rooms", "furnace", "hall"];

/// The glTF file of the scene called `name`; `None` for a name that is not in [`NAMES`].
pub(super) fn glb(name: &str) -> Option<&'static [u8]> {
    Some(match name {
        "cornell" => include_bytes!("../../../assets/scenes/cornell.glb"),
        "courtyard" => include_bytes!("../../../assets/scenes/courtyard.glb"),
        "two_rooms" => include_bytes!("../../../assets/scenes/two_rooms.glb"),
        "furnace" => include_bytes!("../../../assets/scenes/furnace.glb"),
        "hall" => include_bytes!("../../../assets/scenes/hall.glb"),
        _ => return None,
    })
}

#[cfg(test)]
#[path = "built_in_tests.rs"]
mod tests;
