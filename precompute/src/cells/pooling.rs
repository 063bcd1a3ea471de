//! What to believe of a few measurements at a few cameras.
//!
//! One camera says little about its cell. What the map's cameras say together is a line for each slot along the frontiers: what is measured there, by what
//! corners promised. A cell's cost is therefore a mean of its own cameras' measurements and of what the line makes of its promise, in which the line
//! counts as many cameras as the data say: those that make its own cameras' spread worth as much as the spread between cells (James and Stein 1961;
//! here the one-way random-effects form, Efron and Morris 1975). Without it, each frame's budget would pick out those cells whose cameras
//! happened to be lucky.
//!
//! Lines, not mean ratios: a corner in a wall promises next to no error, and the ratio of a measurement to that is of any size. One such corner would
//! give the whole map errors of many times what is there.

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
    /// What the corner promised, watts or error; finite.
    pub(super) promised: f64,
    /// What it came to, in the same unit; finite.
    pub(super) measured: f64,
}

/// Most cameras that the line counts for: with more, cells would have no say.
const MOST: f64 = 10.0;

/// What is believed of all cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Pooled {
    points: BTreeMap<(usize, usize), f64>,
    slots: BTreeMap<usize, Line>,
}

/// A point of a frontier that may be an anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Anchor {
    /// Index in the frontier.
    pub(super) point: usize,
    /// See [`Reading::slot`].
    pub(super) slot: usize,
    /// See [`Reading::promised`].
    pub(super) promised: f64,
}

impl Pooled {
    /// Whether there was a reading of `point` in `cell`.
    pub(super) fn has(&self, cell: usize, point: usize) -> bool {
        self.points.contains_key(&(cell, point))
    }

    /// What points of `cell` cost, by rising point. A cell without any reading of its own has what the map's lines make of its `anchors`.
    pub(super) fn of_cell(&self, cell: usize, anchors: impl Iterator<Item = Anchor>) -> Vec<(usize, f64)> {
        let own: Vec<_> = self.points.range((cell, 0)..(cell + 1, 0)).map(|((_, point), cost)| (*point, *cost)).collect();
        if !own.is_empty() {
            return own;
        }
        anchors.filter_map(|anchor| Some((anchor.point, self.slots.get(&anchor.slot)?.at(anchor.promised)))).collect()
    }
}

/// A cost for every cell and point that was read.
pub(super) fn pool(readings: &[Reading]) -> Pooled {
    let mut of_slots: BTreeMap<usize, Vec<(f64, f64)>> = BTreeMap::new();
    let mut points: BTreeMap<(usize, usize), (Reading, Mean)> = BTreeMap::new();
    for reading in readings {
        of_slots.entry(reading.slot).or_default().push((reading.promised, reading.measured));
        points.entry((reading.cell, reading.point)).or_insert((*reading, Mean::default())).1.add(reading.measured);
    }
    let slots: BTreeMap<usize, Line> = of_slots.into_iter().map(|(slot, pairs)| (slot, Line::through(&pairs))).collect();
    let line_counts = line_counts(readings, &slots);
    let pooled = |(reading, own): (Reading, Mean)| {
        let line = slots.get(&reading.slot).map_or(reading.promised, |line| line.at(reading.promised));
        (own.sum + line_counts * line) / (own.count + line_counts)
    };
    Pooled { points: points.into_iter().map(|(key, own)| (key, pooled(own))).collect(), slots }
}

/// How many cameras a line counts for: the variance between cameras of a cell ÷ that between cells.
fn line_counts(readings: &[Reading], slots: &BTreeMap<usize, Line>) -> f64 {
    // In units of what a slot's readings usually miss the line by, so that the anchors of a camera can be averaged.
    let mut cameras: BTreeMap<(usize, usize), Mean> = BTreeMap::new();
    for reading in readings {
        let Some(line) = slots.get(&reading.slot) else { continue };
        let off = if line.miss > 0.0 { (reading.measured - line.at(reading.promised)) / line.miss } else { 0.0 };
        cameras.entry((reading.cell, reading.camera)).or_default().add(off);
    }
    let mut cells: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for ((cell, _), mean) in cameras {
        cells.entry(cell).or_default().push(mean.get());
    }
    let several: Vec<&Vec<f64>> = cells.values().filter(|cameras| cameras.len() > 1).collect();
    if several.is_empty() {
        // Nothing tells them apart: a cell's only camera counts as much as the line.
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

/// `measured` by `promised` at one slot.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    at_zero: f64,
    slope: f64,
    /// Root mean square of what readings miss it by.
    miss: f64,
}

impl Line {
    /// The line of least squares through `pairs` that neither falls nor begins below zero: more was promised, more is expected, and never less than
    /// nothing.
    fn through(pairs: &[(f64, f64)]) -> Self {
        let count = pairs.len().max(1) as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
        let (promised, measured) = (mean(|pair| pair.0), mean(|pair| pair.1));
        let spread: f64 = pairs.iter().map(|pair| (pair.0 - promised).powi(2)).sum();
        let together: f64 = pairs.iter().map(|pair| (pair.0 - promised) * (pair.1 - measured)).sum();
        // One promise alone, or none: in proportion to it.
        let most = if promised > 0.0 { measured / promised } else { 0.0 };
        let slope = if spread > 0.0 { (together / spread).clamp(0.0, most.max(0.0)) } else { most };
        let mut line = Self { at_zero: (measured - slope * promised).max(0.0), slope, miss: 0.0 };
        line.miss = (pairs.iter().map(|pair| (pair.1 - line.at(pair.0)).powi(2)).sum::<f64>() / count).sqrt();
        line
    }

    fn at(&self, promised: f64) -> f64 {
        self.at_zero + self.slope * promised
    }
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

    /// Measurements of cells that were all promised 1.
    fn readings(cells: &[&[f64]]) -> Vec<Reading> {
        let cameras = cells.iter().enumerate().flat_map(|(cell, costs)| costs.iter().enumerate().map(move |(i, cost)| (cell, i, *cost)));
        cameras.map(|(cell, camera, measured)| Reading { cell, camera, point: 3, slot: 1, promised: 1.0, measured }).collect()
    }

    #[test]
    fn cameras_that_agree_are_believed_and_cells_that_do_not_differ_are_pooled() {
        let agreeing = pool(&readings(&[&[2.0, 2.0], &[4.0, 4.0]])).points;
        assert_eq!(agreeing[&(0, 3)], 2.0);
        assert_eq!(agreeing[&(1, 3)], 4.0);
        let alike = pool(&readings(&[&[1.0, 3.0], &[3.0, 1.0], &[1.0, 3.2]])).points;
        assert!(alike.values().all(|cost| (cost - 2.03).abs() < 0.05), "{alike:?}");
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
        let anchors = [(0, 0), (5, 1)].map(|(point, slot)| Anchor { point, slot, promised: 2.0 });
        assert_eq!(pooled.of_cell(7, anchors.into_iter()), [(5, 4.0)]);
        assert!(pool(&[]).of_cell(0, anchors.into_iter()).is_empty());
    }

    /// Nine cells get what they were promised. The tenth's corner stood in a wall: no error there, 0.05 in its cell.
    #[test]
    fn a_corner_that_promised_nothing_does_not_spoil_the_others() {
        let cell = |cell: usize| {
            let promised = if cell == 9 { 0.0 } else { 0.01 * (1 + cell) as f64 };
            let measured = if cell == 9 { 0.05 } else { promised };
            [0, 1].map(|camera| Reading { cell, camera, point: 0, slot: 0, promised, measured })
        };
        let pooled = pool(&(0..10).flat_map(cell).collect::<Vec<_>>());
        for cell in 0..9 {
            assert!((pooled.points[&(cell, 0)] - 0.01 * (1 + cell) as f64).abs() < 0.015, "{pooled:?}");
        }
        // Its own cameras agree with each other.
        assert!((pooled.points[&(9, 0)] - 0.05).abs() < 1e-9, "{pooled:?}");
    }

    #[test]
    fn lines_neither_fall_nor_begin_below_zero() {
        let line = Line::through(&[(1.0, 3.0), (2.0, 5.0), (3.0, 7.0)]);
        assert!((line.at_zero - 1.0).abs() < 1e-12 && (line.slope - 2.0).abs() < 1e-12 && line.miss < 1e-9, "{line:?}");
        let falling = Line::through(&[(1.0, 7.0), (3.0, 5.0)]);
        assert_eq!((falling.at_zero, falling.slope), (6.0, 0.0));
        let steep = Line::through(&[(1.0, 0.0), (3.0, 4.0)]);
        assert_eq!((steep.at_zero, steep.slope), (0.0, 1.0));
        for pairs in [&[][..], &[(0.0, 0.0)], &[(0.0, 1.0); 3], &[(5.0, 0.0)]] {
            let line = Line::through(pairs);
            assert!(line.at(7.0).is_finite() && line.at(7.0) >= 0.0, "{line:?}");
        }
    }
}
