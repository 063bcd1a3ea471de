//! What to believe of a few ratios from a few cameras.
//!
//! One camera says little about its cell, and the whole map's mean ratio is known from all cameras. A cell's ratio is therefore a mean of both, in
//! which the map's counts as many cameras as the data say: those that make its own cameras' spread worth as much as the spread between cells
//! (James and Stein 1961; here the one-way random-effects form, Efron and Morris 1975). Without it, each frame's budget would pick out those
//! cells whose cameras happened to be lucky.

use std::collections::BTreeMap;

/// What one camera said of one anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    /// The cell.
    pub(super) cell: usize,
    /// Which of its cameras.
    pub(super) camera: usize,
    /// Index of the point in the cell's frontier.
    pub(super) point: usize,
    /// Where the anchor lies, comparable between frontiers: 0 is the first, the number of anchors − 1 the last.
    pub(super) slot: usize,
    /// Measured ÷ promised; above 0.
    pub(super) ratio: f64,
}

/// Most cameras that the map's mean counts for: with more, cells would have no say.
const MOST: f64 = 10.0;

/// What is believed of all cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Pooled {
    points: BTreeMap<(usize, usize), f64>,
    slots: BTreeMap<usize, f64>,
}

impl Pooled {
    /// Whether there was a reading of `point` in `cell`.
    pub(super) fn has(&self, cell: usize, point: usize) -> bool {
        self.points.contains_key(&(cell, point))
    }

    /// Ratios at points of `cell`, rising. A cell without any of its own has the map's at its anchors, each given as (point, slot).
    pub(super) fn of_cell(&self, cell: usize, anchors: impl Iterator<Item = (usize, usize)>) -> Vec<(usize, f64)> {
        let own: Vec<_> = self.points.range((cell, 0)..(cell + 1, 0)).map(|((_, point), ratio)| (*point, *ratio)).collect();
        if own.is_empty() { anchors.filter_map(|(point, slot)| Some((point, *self.slots.get(&slot)?))).collect() } else { own }
    }
}

/// A ratio for every cell and point that was read.
pub(super) fn pool(readings: &[Reading]) -> Pooled {
    let mut slots: BTreeMap<usize, Mean> = BTreeMap::new();
    let mut points: BTreeMap<(usize, usize), (usize, Mean)> = BTreeMap::new();
    for reading in readings {
        slots.entry(reading.slot).or_default().add(reading.ratio);
        points.entry((reading.cell, reading.point)).or_insert((reading.slot, Mean::default())).1.add(reading.ratio);
    }
    let map_counts = map_counts(readings, &slots);
    let pooled = |(slot, own): (usize, Mean)| {
        let map = slots.get(&slot).map_or(1.0, |mean| mean.get());
        (own.sum + map_counts * map) / (own.count + map_counts)
    };
    Pooled {
        points: points.into_iter().map(|(key, own)| (key, pooled(own))).collect(),
        slots: slots.into_iter().map(|(slot, mean)| (slot, mean.get())).collect(),
    }
}

/// How many cameras the map's mean counts for: the variance between cameras of a cell ÷ that between cells.
fn map_counts(readings: &[Reading], slots: &BTreeMap<usize, Mean>) -> f64 {
    // In logarithms, and without what all cells have in common at an anchor, so that the anchors of a camera can be averaged.
    let mut cameras: BTreeMap<(usize, usize), Mean> = BTreeMap::new();
    for reading in readings {
        let common = slots.get(&reading.slot).map_or(1.0, |mean| mean.get());
        cameras.entry((reading.cell, reading.camera)).or_default().add((reading.ratio / common).ln());
    }
    let mut cells: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for ((cell, _), mean) in cameras {
        cells.entry(cell).or_default().push(mean.get());
    }
    let several: Vec<&Vec<f64>> = cells.values().filter(|cameras| cameras.len() > 1).collect();
    if several.is_empty() {
        // Nothing tells them apart: a cell's only camera counts as much as the map.
        return 1.0;
    }
    let freedom: usize = several.iter().map(|cameras| cameras.len() - 1).sum();
    let within = several.iter().map(|cameras| squares(cameras)).sum::<f64>() / freedom as f64;
    let means: Vec<f64> = cells.values().map(|cameras| cameras.iter().sum::<f64>() / cameras.len() as f64).collect();
    let of_means = squares(&means) / (means.len() as f64 - 1.0).max(1.0);
    // The means of cells vary for their few cameras, too.
    let noise = within * cells.values().map(|cameras| 1.0 / cameras.len() as f64).sum::<f64>() / cells.len() as f64;
    let between = of_means - noise;
    if within <= 0.0 {
        0.0
    } else if between <= 0.0 {
        MOST
    } else {
        (within / between).min(MOST)
    }
}

/// Sum of squared differences from the mean.
fn squares(numbers: &[f64]) -> f64 {
    let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
    numbers.iter().map(|number| (number - mean).powi(2)).sum()
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, number: f64) {
        self.sum += number;
        self.count += 1.0;
    }

    fn get(self) -> f64 {
        self.sum / self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(cells: &[&[f64]]) -> Vec<Reading> {
        let cameras =
            cells.iter().enumerate().flat_map(|(cell, ratios)| ratios.iter().enumerate().map(move |(i, ratio)| (cell, i, *ratio)));
        cameras.map(|(cell, camera, ratio)| Reading { cell, camera, point: 3, slot: 1, ratio }).collect()
    }

    #[test]
    fn cameras_that_agree_are_believed_and_cells_that_do_not_differ_are_pooled() {
        let agreeing = pool(&readings(&[&[2.0, 2.0], &[4.0, 4.0]])).points;
        assert_eq!(agreeing[&(0, 3)], 2.0);
        assert_eq!(agreeing[&(1, 3)], 4.0);
        let alike = pool(&readings(&[&[1.0, 3.0], &[3.0, 1.0], &[1.0, 3.2]])).points;
        assert!(alike.values().all(|ratio| (ratio - 2.03).abs() < 0.05), "{alike:?}");
    }

    #[test]
    fn a_single_camera_counts_as_much_as_the_map() {
        let pooled = pool(&readings(&[&[1.0], &[3.0]])).points;
        assert_eq!((pooled[&(0, 3)], pooled[&(1, 3)]), (1.5, 2.5));
        assert_eq!(pool(&readings(&[&[3.0]])).points[&(0, 3)], 3.0);
    }

    #[test]
    fn a_cell_without_cameras_is_as_the_map() {
        let pooled = pool(&readings(&[&[1.0], &[3.0]]));
        assert_eq!(pooled.of_cell(1, std::iter::empty()), [(3, 2.5)]);
        assert_eq!(pooled.of_cell(7, [(0, 0), (5, 1)].into_iter()), [(5, 2.0)]);
        assert!(pool(&[]).of_cell(0, [(0, 0)].into_iter()).is_empty());
    }
}
