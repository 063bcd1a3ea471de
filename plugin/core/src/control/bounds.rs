//! Bounds on knobs that the player or the app sets, and the frontier within them.

use std::collections::BTreeMap;
use std::sync::Arc;

#[cfg(feature = "bevy")]
use bevy_ecs::reflect::ReflectComponent;
#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;

use crate::frontier::{Frontier, FrontierPoint};
use crate::knobs::{KnobLevels, KnobSpace};

/// The lowest and the highest level that the controller may set, for each knob. A knob without
/// bounds may take all levels. The controller does its best with the rest, under the same budget.
///
/// A menu sets bounds here, or writes a level to the camera's `KnobSettings`, which
/// [pins](Self::pin) that knob. [`release`](Self::release) hands it back to the controller.
///
/// `Selection::status` says whether settings within the bounds meet the budget. Costs of settings
/// that are on no frontier are interpolated; the app's power meter corrects them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::component::Component, bevy_reflect::Reflect))]
#[cfg_attr(feature = "bevy", reflect(Component, Default, Clone, Debug, PartialEq))]
pub struct KnobBounds {
    /// The lowest and the highest level, by the knob's name.
    bounds: BTreeMap<String, (usize, usize)>,
}

impl KnobBounds {
    /// Holds the knob called `name` at `level`; a level beyond its last counts as the last.
    pub fn pin(&mut self, name: &str, level: usize) -> &mut Self {
        self.bound(name, |_| (level, level))
    }

    /// Sets the lowest level of the knob called `name`. Higher values keep its quality and leave less
    /// for other knobs.
    pub fn at_least(&mut self, name: &str, level: usize) -> &mut Self {
        self.bound(name, |(_, most)| (level, most.max(level)))
    }

    /// Sets the highest level of the knob called `name`. Lower values leave more for other knobs.
    pub fn at_most(&mut self, name: &str, level: usize) -> &mut Self {
        self.bound(name, |(least, _)| (least.min(level), level))
    }

    fn bound(
        &mut self,
        name: &str,
        new: impl FnOnce((usize, usize)) -> (usize, usize),
    ) -> &mut Self {
        let bound = self.bounds.entry(name.to_owned()).or_insert((0, usize::MAX));
        *bound = new(*bound);
        self
    }

    /// Hands the knob called `name` back to the controller.
    pub fn release(&mut self, name: &str) -> &mut Self {
        self.bounds.remove(name);
        self
    }

    /// Hands all knobs back to the controller.
    pub fn clear(&mut self) {
        self.bounds.clear();
    }

    /// The lowest and the highest level of the knob called `name`; `None` where it has no bound.
    pub fn get(&self, name: &str) -> Option<(usize, usize)> {
        self.bounds.get(name).copied()
    }

    /// Whether no knob has a bound.
    pub fn is_empty(&self) -> bool {
        self.bounds.is_empty()
    }

    /// Pins every knob of `space` in which `new` differs from `old`.
    pub fn pin_changes(&mut self, space: &KnobSpace, old: KnobLevels, new: KnobLevels) {
        for (index, knob) in space.knobs().iter().enumerate() {
            if old.level(index) != new.level(index) {
                self.pin(&knob.name, new.level(index));
            }
        }
    }

    /// The nearest settings within the bounds.
    fn nearest(&self, space: &KnobSpace, settings: KnobLevels) -> KnobLevels {
        space.from_levels(|index, knob| {
            let level = settings.level(index);
            self.get(&knob.name).map_or(level, |(least, most)| level.max(least).min(most))
        })
    }

    /// The frontier of the nearest settings within the bounds to those of `frontier`.
    fn within(&self, space: &KnobSpace, frontier: &Frontier) -> Frontier {
        let nearest = |point: &FrontierPoint| {
            let settings = self.nearest(space, point.settings);
            Some(FrontierPoint { settings, cost: frontier.estimate(space, settings)? })
        };
        Frontier::from_points(frontier.points().iter().filter_map(nearest))
    }
}

/// The frontier within a camera's bounds that was found last: it is made once for an address.
#[derive(Debug, Default)]
pub struct BoundedFrontier(Option<Bounded>);

#[derive(Debug)]
struct Bounded {
    bounds: KnobBounds,
    /// A map that changes has another space.
    space: Arc<KnobSpace>,
    /// Address of the whole frontier.
    whole: usize,
    within: Arc<Frontier>,
}

impl BoundedFrontier {
    /// `frontier` within `bounds`; `None` where there are none. Allocates at another address alone.
    pub fn get(
        &mut self,
        bounds: &KnobBounds,
        space: &Arc<KnobSpace>,
        frontier: &Frontier,
    ) -> Option<Arc<Frontier>> {
        if bounds.is_empty() {
            self.0 = None;
            return None;
        }
        let whole = std::ptr::from_ref(frontier).addr();
        let is_current = |it: &Bounded| {
            it.whole == whole && Arc::ptr_eq(&it.space, space) && it.bounds == *bounds
        };
        if !self.0.as_ref().is_some_and(is_current) {
            let within = Arc::new(bounds.within(space, frontier));
            let (bounds, space) = (bounds.clone(), Arc::clone(space));
            self.0 = Some(Bounded { bounds, space, whole, within });
        }
        self.0.as_ref().map(|it| Arc::clone(&it.within))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use crate::units::Watts;

    #[test]
    fn a_bounded_frontier_keeps_the_bounds_and_costs_what_the_whole_one_says() {
        let (space, frontier) = (Arc::new(testing::space()), testing::frontier(1.0));
        let names: Vec<&str> = space.knobs().iter().map(|knob| knob.name.as_str()).collect();
        let mut cache = BoundedFrontier::default();
        let mut bounds = KnobBounds::default();
        assert!(cache.get(&bounds, &space, &frontier).is_none());
        bounds.at_least(names[0], 2).at_most(names[1], 1);
        let within = cache.get(&bounds, &space, &frontier).expect("a frontier");
        assert!(!within.is_empty());
        for point in within.points() {
            assert!(point.settings.level(0) >= 2 && point.settings.level(1) <= 1, "{point:?}");
            assert_eq!(frontier.estimate(&space, point.settings), Some(point.cost));
        }
        let again = cache.get(&bounds, &space, &frontier).expect("a frontier");
        assert!(Arc::ptr_eq(&within, &again), "made once");
        let other = testing::frontier(5.0);
        let there = cache.get(&bounds, &space, &other).expect("a frontier");
        assert!(there.points()[0].cost.power > Watts(4.0), "another address");
    }

    #[test]
    fn bounds_widen_each_other_and_are_released() {
        let mut bounds = KnobBounds::default();
        bounds.pin("a", 3).at_least("b", 2).at_most("b", 1).at_most("c", 4).at_least("c", 6);
        assert_eq!(bounds.get("a"), Some((3, 3)));
        assert_eq!(bounds.get("b"), Some((1, 1)), "the latest bound holds");
        assert_eq!(bounds.get("c"), Some((6, 6)));
        bounds.release("a").release("unknown");
        assert_eq!((bounds.get("a"), bounds.is_empty()), (None, false));
        bounds.clear();
        assert!(bounds.is_empty());
        // Levels beyond the last count as the last.
        let space = testing::space();
        bounds.pin(&space.knobs()[0].name, usize::MAX);
        let nearest = bounds.nearest(&space, KnobLevels::default());
        assert_eq!(nearest.level(0), space.knobs()[0].levels.len() - 1);
    }
}
