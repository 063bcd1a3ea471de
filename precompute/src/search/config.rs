//! Extent of a search.

/// Combinations above which a space counts as large: Wang et al. 2016 use more generations for
/// their space of 16,384 than for that of 300.
const LARGE: u64 = 10_000;

/// Settings of the genetic search.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SearchConfig {
    /// Survivors of a generation, at least 4. Higher values keep more of the frontier, lower values
    /// converge in fewer evaluations.
    pub population: usize,
    /// Generations of `population` evaluations after the first; by default 25, and 40 in a space of
    /// more than 10,000 combinations (Wang et al. 2016). Together they bound the evaluations at
    /// population × (generations + 1).
    pub generations: Option<usize>,
    /// Probability, 0 to 1, that a knob of an offspring changes; by default one knob per offspring
    /// on average (Deb et al. 2002, 1/n).
    pub mutation_probability: Option<f64>,
    /// Evaluation budget; the highest and the lowest settings are always evaluated. `None`: limited
    /// by the generations.
    pub max_evaluations: Option<usize>,
    /// Seed of every random choice. The same seed gives the same frontiers where costs are
    /// reproducible.
    pub seed: u64,
}

impl Default for SearchConfig {
    fn default() -> Self {
        Self {
            population: 24,
            generations: None,
            mutation_probability: None,
            max_evaluations: None,
            seed: 0,
        }
    }
}

impl SearchConfig {
    /// Evaluation budget of a search in a space of `combinations`, before other limits.
    pub(crate) fn evaluations(&self, combinations: u64) -> usize {
        let generations = self.generations.unwrap_or(if combinations > LARGE { 40 } else { 25 });
        self.population.max(4).saturating_mul(generations.saturating_add(1))
    }
}
