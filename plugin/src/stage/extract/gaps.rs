//! What a scene's data cannot represent, counted and named.

use std::collections::BTreeMap;

use bevy::ecs::entity::Entity;
use bevy::ecs::name::Name;
use bevy::ecs::world::World;

/// Greatest number of names in a line.
const NAMES_SHOWN: usize = 5;

/// Gaps of an extraction: by what is missing, in which meshes, materials or lights.
#[derive(Debug, Default)]
pub(super) struct Gaps(BTreeMap<&'static str, Vec<String>>);

impl Gaps {
    /// Adds `name` to those with the gap `what`, a sentence without its end.
    pub(super) fn add(&mut self, what: &'static str, name: impl Into<String>) {
        let (names, name) = (self.0.entry(what).or_default(), name.into());
        if !names.contains(&name) {
            names.push(name);
        }
    }

    /// One line per kind of gap.
    pub(super) fn lines(self) -> Vec<String> {
        let line = |(what, names): (&str, Vec<String>)| {
            let more = match names.len().saturating_sub(NAMES_SHOWN) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            format!("{what}: {}{more}", names[..names.len().min(NAMES_SHOWN)].join(", "))
        };
        self.0.into_iter().map(line).collect()
    }
}

/// An entity's name, or its number.
pub(super) fn name(world: &World, entity: Entity) -> String {
    world.get::<Name>(entity).map_or_else(|| entity.to_string(), |name| name.as_str().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_names_are_counted() {
        let mut gaps = Gaps::default();
        (0..7).for_each(|i| gaps.add("no fog", format!("m{i}")));
        gaps.add("no fog", "m0");
        gaps.add("a", "x");
        assert_eq!(gaps.lines(), ["a: x", "no fog: m0, m1, m2, m3, m4 and 2 more"]);
    }
}
