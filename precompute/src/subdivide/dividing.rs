//! Compares frontiers, and makes the corners that a division needs.

use std::collections::{BTreeMap, BTreeSet};

use bevy_frugal_gi::frontier::ViewDirection;

use super::builder::{Builder, View, settings};
use super::distance::{Distance, half_distance};
use super::lattice::{At, NewCorner, Node};
use super::searching::Wanted;
use crate::search::{Evaluate, Stage};

impl<E: Evaluate> Builder<'_, '_, E> {
    /// Positions of those of `nodes` that have a pair of adjacent corners too far apart in some view.
    pub(super) fn nodes_that_differ(&mut self, nodes: &[(Node, u32)]) -> Result<Vec<usize>, E::Error> {
        let started = self.monitor.seconds();
        let mut differing = Vec::new();
        for (index, (node, _)) in nodes.iter().enumerate() {
            self.report(Stage::Comparing, index, nodes.len());
            if self.node_differs(*node)? {
                differing.push(index);
            }
        }
        self.report(Stage::Comparing, nodes.len(), nodes.len());
        self.statistics.comparing_seconds += self.monitor.seconds() - started;
        Ok(differing)
    }

    fn node_differs(&mut self, node: Node) -> Result<bool, E::Error> {
        for [low, high] in node.edges() {
            for view in ViewDirection::ALL {
                // All pairs are compared only until one differs: what the others say is asked when their new corners are made.
                if self.differ(self.view(low, view), self.view(high, view))? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Whether two views' frontiers are further apart than a threshold. False where they cannot be compared.
    fn differ(&mut self, one: View, other: View) -> Result<bool, E::Error> {
        let (View::Known(one), View::Known(other)) = (one, other) else { return Ok(false) };
        if one == other {
            return Ok(false);
        }
        let pair = [one.min(other), one.max(other)];
        let distance = match self.distances.get(&pair) {
            Some(distance) => *distance,
            None => {
                let Some(distance) = self.measure_distance(pair)? else { return Ok(false) };
                self.distances.insert(pair, distance);
                self.statistics.comparisons += 1;
                distance
            }
        };
        Ok(distance.power > self.power_threshold || distance.error > self.config.error_threshold)
    }

    /// Both halves (equations 3.4 and 3.5). `None` when the monitor says stop, or nothing finite can be compared.
    fn measure_distance(&mut self, [one, other]: [u32; 2]) -> Result<Option<Distance>, E::Error> {
        let mut sum = Distance::default();
        for (from, to) in [(one, other), (other, one)] {
            let mut projected = Vec::new();
            for settings in settings(&self.found[from as usize].frontier) {
                let camera = self.found[to as usize].camera;
                if self.cached.known(camera, settings).is_none() && !self.go_on() {
                    return Ok(None);
                }
                projected.push(self.cached.evaluate(camera, settings)?);
            }
            let Some(half) = half_distance(&projected, &self.found[to as usize].frontier) else { return Ok(None) };
            sum = sum + half;
        }
        Ok(Some(sum))
    }

    /// Makes the corners that the division of `parents` needs, kind by kind, because each kind's parents are of the kind before.
    pub(super) fn add_corners(&mut self, parents: &[Node]) -> Result<(), E::Error> {
        // Corners that neighbours share have the same parents in both.
        let new: BTreeMap<(usize, At), NewCorner> =
            parents.iter().flat_map(|node| node.new_corners()).map(|corner| ((corner.parents.len(), corner.at), corner)).collect();
        for kind in 1..=3 {
            let corners: Vec<&NewCorner> = new.range((kind, [0; 3])..(kind + 1, [0; 3])).map(|(_, corner)| corner).collect();
            let started = self.monitor.seconds();
            let mut wanted = Vec::new();
            for (done, corner) in corners.iter().enumerate() {
                self.report(Stage::Comparing, done, corners.len());
                self.add_corner(corner.at)?;
                for view in ViewDirection::ALL {
                    wanted.extend(self.inherit(corner, view)?);
                }
            }
            self.statistics.comparing_seconds += self.monitor.seconds() - started;
            self.search_all(wanted)?;
        }
        Ok(())
    }

    /// Gives a new view its parents' frontier where they agree; says what to search where they do not.
    fn inherit(&mut self, corner: &NewCorner, view: ViewDirection) -> Result<Option<Wanted>, E::Error> {
        if self.view(corner.at, view) != View::Open {
            return Ok(None);
        }
        let (mut differing, mut agreeing) = (Vec::new(), Vec::new());
        for [low, high] in &corner.parents {
            let pair = [self.view(*low, view), self.view(*high, view)];
            if self.differ(pair[0], pair[1])? {
                differing.extend(pair);
            } else {
                agreeing.extend(pair);
            }
        }
        let known = |view: &View| if let View::Known(index) = view { Some(*index) } else { None };
        if differing.is_empty() {
            if let Some(index) = agreeing.iter().find_map(known) {
                self.set(corner.at, view, View::Known(index));
                self.statistics.inherited += 1;
                return Ok(None);
            }
            // Parents that wait for a search in vain leave this one waiting, too.
            if agreeing.contains(&View::Open) {
                return Ok(None);
            }
        }
        let mut seen = BTreeSet::new();
        let parents = differing.iter().chain(&agreeing).filter_map(known).filter(|index| seen.insert(*index));
        let inherit = parents.flat_map(|index| settings(&self.found[index as usize].frontier)).collect();
        Ok(Some(Wanted { at: corner.at, view, inherit }))
    }
}
